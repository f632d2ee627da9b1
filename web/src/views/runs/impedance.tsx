// The impedance of runs against the position, going forward and coming back, with detections and deliveries.

import { signal, useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { count, millimetres, millivolts, words } from '../../format';
import { change_query, type Route } from '../../route';
import { Choice } from '../../parts/choice';
import { range_splits } from '../../range';
import { RunPlot, type PlotOptions } from './run_plot';
import { said } from './run_page';
import type { ImpedanceBins, ImpedanceMap, RunsApi } from './runs_api';
import type { Values } from './traces';

const kWidths_mm = ['1', '2', '5', '10', '20', '50'];

interface Columns {
  position_m: number[]; // middle of each bin
  mean: { forward: Values; backward: Values };
  low: { forward: Values; backward: Values };
  high: { forward: Values; backward: Values };
}

// Both directions on one axis of bins; a bin that only one of them has is null in the other, and so is an empty one.
export function columns_of({ bin_m, forward, backward }: ImpedanceMap): Columns {
  const number_of = (from_m: number) => Math.round(from_m / bin_m);
  const bins = [...forward.from_m, ...backward.from_m].map(number_of);
  const first = Math.min(...bins);
  const size = bins.length > 0 ? Math.max(...bins) - first + 1 : 0;
  const made = (of: ImpedanceBins, value: (at: number) => number): Values => {
    const values: Values = new Array<number | null>(size).fill(null);
    of.from_m.forEach((from_m, at) => (values[number_of(from_m) - first] = value(at)));
    return values;
  };
  const both = (sign: number) => {
    const of = (bin: ImpedanceBins) => made(bin, (at) => (bin.mean_mv[at] ?? 0) + sign * 2 * (bin.sd_mv[at] ?? 0));
    return { forward: of(forward), backward: of(backward) };
  };
  const position_m = Array.from({ length: size }, (_, at) => (first + at + 0.5) * bin_m);
  return { position_m, mean: both(0), low: both(-1), high: both(1) };
}

// `map` in the address is the width of a bin in mm; without it the map is closed.
export function ImpedanceSection({ api, runs, route }: { api: RunsApi; runs: number[]; route: Route }) {
  const bin_mm = Number(route.query['map'] ?? '');
  const map = useSignal<ImpedanceMap | null>(null);
  const problem = useSignal('');
  const key = runs.join(',');
  useEffect(() => {
    if (!(bin_mm > 0)) return;
    let is_ours = true;
    map.value = null;
    problem.value = '';
    api.impedance(runs, bin_mm).then(
      (found) => is_ours && (map.value = found),
      (error: unknown) => is_ours && (problem.value = said(error)),
    );
    return () => void (is_ours = false);
  }, [key, bin_mm]);

  return (
    <section aria-label="Impedance map" id="impedance-map">
      <h2>Impedance map</h2>
      {!(bin_mm > 0) ? (
        <button type="button" id="open-map" onClick={() => change_query({ map: '5' })}>
          Show impedance against position
        </button>
      ) : (
        <div class="map-tools">
          <Choice
            id="bin-width"
            label="Width of a bin"
            value={String(bin_mm)}
            options={[...new Set([...kWidths_mm, String(bin_mm)])].map((width) => ({
              value: width,
              text: `bins of ${width} mm`,
            }))}
            on_choose={(width) => change_query({ map: width })}
          />
          <button type="button" onClick={() => change_query({ map: '' })}>
            Close
          </button>
        </div>
      )}
      {problem.value && (
        <p class="problem" role="alert">
          {problem.value}
        </p>
      )}
      {bin_mm > 0 && !map.value && !problem.value && <p class="quiet">Being computed…</p>}
      {bin_mm > 0 && map.value && <Map map={map.value} />}
    </section>
  );
}

function Map({ map }: { map: ImpedanceMap }) {
  const host = useRef<HTMLDivElement>(null);
  const cursor = useRef(signal('')).current;
  useEffect(() => {
    const columns = columns_of(map);
    const { position_m, mean, low, high } = columns;
    const options: PlotOptions = {
      group: 'impedance',
      label: (value) => String(Math.round(value * 100) / 100),
      least_span: 10,
      shows_x: true,
      x_splits: (from, to) => range_splits([from, to]),
      x_label: (value) => `${millimetres(value, 0)} mm`,
      on_cursor: (at_m) => (cursor.value = map_text(columns, map, at_m)),
    };
    const plot = new RunPlot(host.current as HTMLDivElement, options);
    const bands = (['forward', 'backward'] as const).map((way) => ({
      low: low[way],
      high: high[way],
      colour: '--spread',
    }));
    const content = {
      time_s: position_m,
      bands,
      traces: [
        { values: mean.backward, colour: '--seen', width_px: 1.3, dash_px: [5, 4] },
        { values: mean.forward, colour: '--impedance', width_px: 1.6 },
      ],
      gaps_s: [],
      lines: map.events.flatMap(({ kind, position_m: at_m }) =>
        at_m === null ? [] : [{ at_s: at_m, colour: '--ink', dash_px: [2, 3], label: words(kind) }],
      ),
    };
    const values = [...low.forward, ...high.forward, ...low.backward, ...high.backward].filter(
      (value) => value !== null,
    );
    const range: [number, number] | null = values.length > 0 ? [Math.min(...values), Math.max(...values)] : null;
    const half_m = map.bin_m / 2;
    const show = () => {
      plot.show(content, [(position_m[0] ?? 0) - half_m, (position_m.at(-1) ?? 1) + half_m], { traces: range });
      plot.restyle();
    };
    show();
    const theme = matchMedia('(prefers-color-scheme: light)');
    theme.addEventListener('change', show);
    return () => {
      theme.removeEventListener('change', show);
      plot.destroy();
    };
  }, [map]);
  return (
    <>
      <figure class="strip map">
        <figcaption>
          <b>Impedance</b> <span class="unit">mV</span>
          <span class="key">
            <span class="swatch forward">forward ± 2 sd</span>
            <span class="swatch backward">backward ± 2 sd</span>
          </span>
          <output class="cursor">{cursor}</output>
        </figcaption>
        <div class="plot" ref={host} />
      </figure>
      <p class="quiet">
        {count(map.samples)} samples{map.samples_left_out > 0 && `, ${count(map.samples_left_out)} left out`}
        {map.events.length === 0 && '; nothing was detected'}.
      </p>
      {map.warnings.map((warning) => (
        <p class="caution" key={warning}>
          {warning[0]?.toUpperCase() + warning.slice(1)}.
        </p>
      ))}
    </>
  );
}

function map_text({ position_m, mean }: Columns, { bin_m }: ImpedanceMap, at_m: number | null): string {
  if (at_m === null) return '';
  const at = position_m.findIndex((middle_m) => Math.abs(middle_m - at_m) <= bin_m / 2);
  const text = (values: Values) => millivolts(values[at] ?? null);
  return `forward ${text(mean.forward)}, backward ${text(mean.backward)} mV at ${millimetres(at_m)} mm`;
}
