// Traces of several runs on one axis of time, and below them what each differs by from the reference.

import { signal, type Signal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { band_cut_text, kSpread_sd, millimetres, millivolts, percent } from '../../format';
import { go_to, route } from '../../route';
import type { Comparison } from './alignment';
import { RunPlot, type PlotContent, type PlotOptions } from './run_plot';
import type { AlignedRun, AlignedRuns } from './runs_api';
import { since_text, time_splits, time_step_s } from './time_axis';
import { kNoExtent, type Extent } from '../../range';
import type { Values } from './traces';

const kPixelsOfALabel = 96;
const kMostBands = 3; // more of them cover each other

interface Shown {
  name: string;
  title: string;
  unit: string;
  channel: string;
  is_difference?: boolean;
  label: (value: number) => string;
  text: (value: number | null) => string;
  least_span: number;
  fixed_range?: [number, number];
}

const whole_mv = (value: number) => millivolts(value).replace('.0', '');
const kShown: readonly Shown[] = [
  {
    name: 'position',
    title: 'Position, as the controller sees it',
    unit: 'mm',
    channel: 'position_m',
    label: (v) => millimetres(v, 0),
    text: millimetres,
    least_span: 0.02,
  },
  {
    name: 'difference',
    title: 'Difference of the position',
    unit: 'mm',
    channel: 'position_m',
    is_difference: true,
    label: millimetres,
    text: (v) => millimetres(v, 2),
    least_span: 0.002,
  },
  {
    name: 'duty',
    title: 'Duty',
    unit: '%',
    channel: 'duty',
    label: (v) => percent(v, 0),
    text: percent,
    least_span: 1,
    fixed_range: [-1.08, 1.08],
  },
  {
    name: 'velocity',
    title: 'Velocity',
    unit: 'mm/s',
    channel: 'velocity_m_s',
    label: (v) => millimetres(v, 0),
    text: millimetres,
    least_span: 0.01,
  },
  {
    name: 'impedance',
    title: 'Impedance',
    unit: 'mV',
    channel: 'impedance_mv',
    label: whole_mv,
    text: millivolts,
    least_span: 10,
  },
];

export const run_colour = (at: number) => `--run-${at % 6}`;
const dash_of = (at: number) => (at >= 6 ? [6, 4] : undefined);

const values_of = (run: AlignedRun, { channel, is_difference }: Shown): Values | null =>
  (is_difference ? run.differences?.[channel] : run.traces[channel]) ?? null;

// The ± of a trace: that of the position, or of the difference of two positions.
function band_of(run: AlignedRun, at: number, shown: Shown): PlotContent['bands'][number] | null {
  const sd_m = shown.channel !== 'position_m' ? null : shown.is_difference ? run.difference_sd_m : run.position_sd_m;
  const values = values_of(run, shown);
  if (!sd_m || !values) return null;
  const edge = (sign: number) =>
    values.map((value, row) => {
      const spread_m = sd_m[row] ?? null;
      return value === null || spread_m === null ? null : value + sign * kSpread_sd * spread_m;
    });
  return { low: edge(-1), high: edge(1), colour: run_colour(at), alpha: '20' };
}

export function content_of({ time_s, runs }: AlignedRuns, shown: Shown): PlotContent {
  const drawn = runs.map((run, at) => ({ run, at })).filter(({ run }) => values_of(run, shown) !== null);
  const bands =
    drawn.length > kMostBands
      ? []
      : drawn.map(({ run, at }) => band_of(run, at, shown)).filter((band) => band !== null);
  return {
    time_s,
    bands,
    traces: drawn.map(({ run, at }) => ({
      values: values_of(run, shown) as Values,
      colour: run_colour(at),
      width_px: 1.5,
      dash_px: dash_of(at),
    })),
    gaps_s: [],
    lines: [{ at_s: 0, colour: '--line-strong', dash_px: [], label: '' }],
  };
}

function extent_of(columns: readonly Values[]): Extent | null {
  let [low, high] = kNoExtent;
  for (const values of columns) {
    for (const value of values) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  return low <= high ? [low, high] : null;
}

export const extents_of = ({ traces, bands }: PlotContent) => ({
  traces: extent_of(traces.map(({ values }) => values)),
  bands: extent_of(bands.flatMap(({ low, high }) => [low, high])),
});

// The farthest that a band reaches from its trace.
export function largest_spread_m({ bands }: PlotContent): number {
  const spreads = bands.flatMap(({ low, high }) => high.map((value, row) => ((value ?? 0) - (low[row] ?? 0)) / 2));
  return spreads.reduce((largest, spread) => Math.max(largest, spread), 0);
}

export function cursor_text({ time_s, runs, grid_s }: AlignedRuns, shown: Shown, at_s: number | null): string {
  if (at_s === null || time_s.length === 0) return '';
  const row = Math.round((at_s - (time_s[0] as number)) / grid_s);
  return `${runs
    .filter((run) => values_of(run, shown) !== null)
    .map((run) => `#${run.run_id} ${shown.text(values_of(run, shown)?.[row] ?? null)}`)
    .join('  ')} ${shown.unit}`;
}

interface Props {
  aligned: AlignedRuns;
  comparison: Comparison;
  is_loading: boolean;
}

export function ComparePlots({ aligned, comparison, is_loading }: Props) {
  const hosts = useRef<(HTMLDivElement | null)[]>([]);
  const plots = useRef<RunPlot[]>([]);
  const cursors = useRef(kShown.map(() => signal(''))).current;
  const cuts = useRef(kShown.map(() => signal(''))).current; // what is said of a band that is cut
  const cursor_time = useRef(signal('')).current;
  const latest = useRef(aligned);
  latest.current = aligned;
  const zoom = (from_s: number, to_s: number) => {
    const now = route.peek();
    go_to({ ...now, query: { ...now.query, from: from_s.toFixed(2), to: to_s.toFixed(2) } });
  };
  const options_of = (at: number): PlotOptions => {
    const { label, fixed_range, least_span } = kShown[at] as Shown;
    return {
      group: 'compared',
      label,
      fixed_range,
      splits: fixed_range ? [-1, 0, 1] : undefined,
      least_span,
      shows_x: at === 0 || at === kShown.length - 1,
      x_splits: (from, to, width_px) =>
        time_splits(from, to, time_step_s(to - from, Math.max(2, width_px / kPixelsOfALabel))),
      x_label: (at_s) => since_text(at_s),
      on_select: zoom,
      on_cursor: (at_s) => {
        kShown.forEach((shown, i) => ((cursors[i] as Signal<string>).value = cursor_text(latest.current, shown, at_s)));
        cursor_time.value = at_s === null ? '' : since_text(at_s);
      },
    };
  };
  useEffect(() => {
    plots.current = kShown.map((_, at) => new RunPlot(hosts.current[at] as HTMLDivElement, options_of(at)));
    const restyle = () => plots.current.forEach((plot) => plot.restyle());
    const theme = matchMedia('(prefers-color-scheme: light)');
    theme.addEventListener('change', restyle);
    void document.fonts.ready.then(restyle);
    return () => {
      theme.removeEventListener('change', restyle);
      plots.current.forEach((plot) => plot.destroy());
    };
  }, []);
  const { time_s } = aligned;
  const view = comparison.window_s ?? ([time_s[0] ?? 0, time_s.at(-1) ?? 1] as [number, number]);
  useEffect(() => {
    plots.current.forEach((plot, at) => {
      const content = content_of(aligned, kShown[at] as Shown);
      const is_cut = plot.show(content, view, extents_of(content));
      (cuts[at] as Signal<string>).value = is_cut ? band_cut_text(largest_spread_m(content)) : '';
    });
  }, [aligned, view[0], view[1]]);
  const reference = aligned.runs.find((run) => run.run_id === aligned.reference_run_id);
  return (
    <section class="run-plots" aria-label="Plots">
      <div class="plot-tools" role="toolbar" aria-label="What the plots show">
        <button
          type="button"
          id="whole-run"
          disabled={comparison.window_s === null}
          onClick={() => go_to({ ...route.peek(), query: { ...route.peek().query, from: '', to: '' } })}
        >
          All of it
        </button>
        <span class="window" id="plot-window" role="status">
          {since_text(view[0], 1)} to {since_text(view[1], 1)} around the moment
        </span>
        <output class="cursor-time">{cursor_time}</output>
        <span class="quiet">
          {is_loading ? 'being read' : `a value each ${since_text(aligned.grid_s)}`}
          {aligned.runs.some((run) => run.uncertain_s > 0.015) &&
            `; aligned within ${since_text(Math.max(...aligned.runs.map((run) => run.uncertain_s)))}`}
        </span>
      </div>
      <div class="run-strips">
        {kShown.map((shown, at) => (
          <figure class={`strip ${shown.name}`} key={shown.name}>
            <figcaption>
              <b>{shown.title}</b> <span class="unit">{shown.unit}</span>
              {shown.is_difference && reference && <span class="quiet"> from #{reference.run_id}</span>}
              {at === 0 && <RunKey runs={aligned.runs} />}
              {at < 2 && aligned.runs.length <= kMostBands && <span class="quiet"> ± 2 sd</span>}
              <span class="band-cut">{cuts[at]}</span>
              <output class="cursor">{cursors[at]}</output>
            </figcaption>
            <div class="plot" ref={(host) => void (hosts.current[at] = host)} />
          </figure>
        ))}
      </div>
    </section>
  );
}

const RunKey = ({ runs }: { runs: AlignedRun[] }) => (
  <span class="key">
    {runs.map(({ run_id }, at) => (
      <span class="of-run" key={run_id}>
        <i class={`run-swatch run-${at % 12}`} /> #{run_id}
      </span>
    ))}
  </span>
);
