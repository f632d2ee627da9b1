// What can be asked for: crossover and phase margin as a map, with the point that is asked for in it.

import { kCrossover } from './address';
import type { Answer } from './jobs';
import type { MapPoint, TuningMap } from './design_api';
import type { Specification } from './frequency';
import { Graph, type Axis, type Place } from './graph';
import { infeasible_text, number_text } from './words';

const kX: Axis = {
  from: kCrossover.from,
  to: kCrossover.to,
  is_log: true,
  splits: [0.5, 1, 2, 5, 10, 20, 50, 100],
  text: (value) => number_text(value, 2),
};
const kY: Axis = { from: 0, to: 180, splits: [0, 30, 60, 90, 120, 150, 180], text: (value) => number_text(value, 3) };

// The margins that can be had next to a crossover; null: it is beyond the map.
export function is_in_region(points: readonly MapPoint[], asked: Specification): boolean | null {
  const next = nearest_point(points, asked.crossover_rad_s);
  if (!next) return null;
  return next.ranges_deg.some(([low, high]) => asked.phase_margin_deg >= low && asked.phase_margin_deg <= high);
}

function nearest_point(points: readonly MapPoint[], crossover_rad_s: number): MapPoint | null {
  const far = (point: MapPoint) => Math.abs(Math.log(point.crossover_rad_s / crossover_rad_s));
  return points.reduce<MapPoint | null>((best, each) => (best === null || far(each) < far(best) ? each : best), null);
}

interface RegionMapProps {
  answer: Answer<TuningMap>;
  asked: Specification;
  on_move(asked: Specification, is_done: boolean): void;
}

export function RegionMap({ answer, asked, on_move }: RegionMapProps) {
  const points = answer.result?.points ?? [];
  const is_in = is_in_region(points, asked);
  const gaps = infeasible_text(points);
  return (
    <figure class="design-figure design-map">
      <figcaption>
        <b>What can be asked for</b> <span class="quiet">phase margin in degrees over crossover in rad/s</span>
      </figcaption>
      <Graph
        id="design-map"
        label={`Feasible region: ${gaps.join(' ') || 'every crossover has a feasible phase margin'}`}
        x={kX}
        y={kY}
        height_px={250}
        on_pick={(crossover_rad_s, phase_margin_deg, is_done) =>
          on_move({ crossover_rad_s, phase_margin_deg }, is_done)
        }
        draw={(place) => (
          <>
            {regions_of(points).map((region, at) => (
              <path key={at} class="feasible" d={outline(place, region)} />
            ))}
            <line
              class="crossover"
              x1={place.x(asked.crossover_rad_s)}
              x2={place.x(asked.crossover_rad_s)}
              y1={place.top}
              y2={place.bottom}
            />
            <line
              class="crossover"
              x1={place.left}
              x2={place.right}
              y1={place.y(asked.phase_margin_deg)}
              y2={place.y(asked.phase_margin_deg)}
            />
            <circle
              class="asked"
              cx={place.x(asked.crossover_rad_s)}
              cy={place.y(asked.phase_margin_deg)}
              r={6}
              id="design-asked-point"
            />
          </>
        )}
      />
      <p class="design-note quiet" id="design-map-note">
        {answer.result === null
          ? answer.phase === 'failed'
            ? `There is no map: ${answer.error}`
            : 'The map is being computed…'
          : is_in === false
            ? 'What is asked lies outside of the region. Press or drag in the map to ask for something else.'
            : 'In the bright region an iso-damped controller exists. Press or drag in the map to ask.'}
        {gaps.length > 0 && <> None at {gaps.join(' None at ')}</>}
      </p>
    </figure>
  );
}

export interface RegionEdge {
  crossover_rad_s: number;
  low_deg: number;
  high_deg: number;
}

// The ranges of neighbours that overlap belong to one region.
export function regions_of(points: readonly MapPoint[]): RegionEdge[][] {
  const regions: RegionEdge[][] = [];
  let open: RegionEdge[][] = [];
  for (const { crossover_rad_s, ranges_deg } of points) {
    const next: RegionEdge[][] = [];
    for (const [low_deg, high_deg] of ranges_deg) {
      const touches = (region: RegionEdge[]) => {
        const last = region.at(-1)!;
        return !next.includes(region) && low_deg <= last.high_deg && high_deg >= last.low_deg;
      };
      const region = open.find(touches) ?? [];
      if (region.length === 0) regions.push(region);
      region.push({ crossover_rad_s, low_deg, high_deg });
      next.push(region);
    }
    open = next;
  }
  return regions;
}

const kAlone_px = 3; // on either side of a region of one crossover

function outline(place: Place, region: readonly RegionEdge[]): string {
  const spread = region.length === 1 ? kAlone_px : 0;
  const edge = (side: 'low_deg' | 'high_deg') =>
    region.flatMap((each) => {
      const [x, y] = [place.x(each.crossover_rad_s), place.y(each[side])];
      return spread > 0
        ? [
            [x - spread, y],
            [x + spread, y],
          ]
        : [[x, y]];
    });
  const corners = [...edge('high_deg'), ...edge('low_deg').reverse()];
  return `M${corners.map(([x, y]) => `${x!.toFixed(1)} ${y!.toFixed(1)}`).join('L')}Z`;
}
