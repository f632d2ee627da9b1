// The open loop of a design: Bode and Nyquist, with what is asked in magenta.

import { useMemo } from 'preact/hooks';
import type { Near } from './design_api';
import { decibels, degrees, loop_at, radians, spaced, type Law, type Plant, type Specification } from './frequency';
import { Graph, path_of, type Axis, type GraphPoint } from './graph';
import { number_text } from './words';

const kFrequencies = spaced(0.1, 300, 260);
const kOmega: Axis = {
  from: 0.1,
  to: 300,
  is_log: true,
  splits: [0.1, 1, 10, 100],
  text: (value) => number_text(value, 2),
};
const kMagnitude: Axis = { from: -60, to: 60, splits: [-60, -40, -20, 0, 20, 40, 60], text: text_of };
const kPhase: Axis = { from: -270, to: 0, splits: [-270, -180, -90, 0], text: text_of };
const kReal: Axis = { from: -2.4, to: 1, splits: [-3, -2, -1, 0, 1, 2], text: text_of };
const kImaginary: Axis = { from: -2, to: 1, splits: [-3, -2, -1, 0, 1, 2], text: text_of };

function text_of(value: number): string {
  return number_text(value, 3);
}

interface LoopProps {
  plant: Plant;
  law: Law | null; // null: nothing meets what is asked
  asked: Specification;
  near: Near | null; // drawn in its place
  is_final: boolean; // by the station
}

export function LoopPlots({ plant, law, asked, near, is_final }: LoopProps) {
  const loop = useMemo(
    () => (law ? kFrequencies.map((omega_rad_s) => loop_at(plant, law, omega_rad_s)) : []),
    [plant, law],
  );
  const { crossover_rad_s, phase_margin_deg } = asked;
  const margin_at = -180 + phase_margin_deg;
  const way = is_final ? '' : 'preliminary';
  const said = near
    ? `nothing meets what is asked; drawn is the nearest, ${number_text(near.crossover_rad_s, 3)} rad/s with ${number_text(near.phase_margin_deg, 3)} degrees`
    : law
      ? `gain 1 at ${number_text(crossover_rad_s, 3)} rad/s with a phase margin of ${number_text(phase_margin_deg, 3)} degrees`
      : 'no controller meets what is asked';
  const magnitude: GraphPoint[] = loop.map((point) => [point.omega_rad_s, decibels(point.magnitude)]);
  const phase: GraphPoint[] = loop.map((point) => [point.omega_rad_s, degrees(point.phase_rad)]);
  const plane: GraphPoint[] = loop
    .filter((point) => point.magnitude < 50)
    .map((point) => [point.magnitude * Math.cos(point.phase_rad), point.magnitude * Math.sin(point.phase_rad)]);
  return (
    <>
      <figure class="design-figure">
        <figcaption>
          <b>Bode</b>{' '}
          <span class="quiet">{near ? 'of the nearest that can be had' : 'open loop'}, dB and degrees over rad/s</span>
        </figcaption>
        <Graph
          id="design-bode-magnitude"
          label={`Bode magnitude of the open loop: ${said}`}
          x={kOmega}
          y={kMagnitude}
          height_px={150}
          draw={(place) => (
            <>
              <line class="zero" x1={place.left} x2={place.right} y1={place.y(0)} y2={place.y(0)} />
              <Crossover x={place.x(crossover_rad_s)} top={place.top} bottom={place.bottom} />
              <path class={`loop ${way}`} d={path_of(place, magnitude)} />
              <circle class="asked" cx={place.x(crossover_rad_s)} cy={place.y(0)} r={4} />
            </>
          )}
        />
        <Graph
          id="design-bode-phase"
          label={`Bode phase of the open loop: ${said}`}
          x={kOmega}
          y={kPhase}
          height_px={150}
          draw={(place) => (
            <>
              <line class="zero" x1={place.left} x2={place.right} y1={place.y(-180)} y2={place.y(-180)} />
              <Crossover x={place.x(crossover_rad_s)} top={place.top} bottom={place.bottom} />
              <line
                class="margin"
                x1={place.x(crossover_rad_s)}
                x2={place.x(crossover_rad_s)}
                y1={place.y(-180)}
                y2={place.y(margin_at)}
              />
              <path class={`loop ${way}`} d={path_of(place, phase)} />
              <circle class="asked" cx={place.x(crossover_rad_s)} cy={place.y(margin_at)} r={4} />
            </>
          )}
        />
      </figure>
      <figure class="design-figure">
        <figcaption>
          <b>Nyquist</b> <span class="quiet">with the unit circle and −1</span>
        </figcaption>
        <Graph
          id="design-nyquist"
          label={`Nyquist plot of the open loop: ${said}`}
          x={kReal}
          y={kImaginary}
          height_px={300}
          is_square
          draw={(place) => (
            <>
              <circle class="zero" cx={place.x(0)} cy={place.y(0)} r={Math.abs(place.x(1) - place.x(0))} />
              <path
                class="zero"
                d={`M${place.left} ${place.y(0)}H${place.right}M${place.x(0)} ${place.top}V${place.bottom}`}
              />
              <line
                class="margin"
                x1={place.x(0)}
                y1={place.y(0)}
                x2={place.x(Math.cos(radians(margin_at)))}
                y2={place.y(Math.sin(radians(margin_at)))}
              />
              <path class={`loop ${way}`} d={path_of(place, plane)} />
              <path class="minus-one" d={cross(place.x(-1), place.y(0))} />
              <circle
                class="asked"
                cx={place.x(Math.cos(radians(margin_at)))}
                cy={place.y(Math.sin(radians(margin_at)))}
                r={4}
              />
            </>
          )}
        />
      </figure>
    </>
  );
}

const Crossover = ({ x, top, bottom }: { x: number; top: number; bottom: number }) => (
  <line class="crossover" x1={x} x2={x} y1={top} y2={bottom} />
);
const cross = (x: number, y: number) => `M${x - 5} ${y - 5}L${x + 5} ${y + 5}M${x - 5} ${y + 5}L${x + 5} ${y - 5}`;
