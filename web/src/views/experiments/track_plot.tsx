// A prediction as two plots, position over duty, on the time of the run; beside it what was measured, where it is known.

import { useEffect, useRef } from 'preact/hooks';
import uPlot from 'uplot';
import { next_range, range_splits } from '../../range';
import { kSpread_sd, millimetres, percent } from '../../format';
import { beside, type Measured } from './measured';
import type { Track } from './preview';

interface TrackPlotProps {
  track: Track;
  label: string; // what a screen reader says of it
  measured?: Measured | null;
  at_s?: number | null; // where the run is now
  step_begins_s?: number[];
}

interface Drawn {
  at_s: number | null;
  step_begins_s: number[];
}

export function TrackPlot({ track, label, measured = null, at_s = null, step_begins_s = [] }: TrackPlotProps) {
  const position = useRef<HTMLDivElement>(null);
  const duty = useRef<HTMLDivElement>(null);
  const plots = useRef<uPlot[]>([]);
  const drawn = useRef<Drawn>({ at_s, step_begins_s });
  drawn.current = { at_s, step_begins_s };

  useEffect(() => {
    const [above, below] = [position.current, duty.current];
    if (!above || !below) return;
    const build = () => {
      for (const plot of plots.current) plot.destroy();
      plots.current = [position_plot(above, track, measured, drawn), duty_plot(below, track, drawn)];
    };
    build();
    const observer = new ResizeObserver(() => {
      for (const [plot, host] of [
        [plots.current[0], above],
        [plots.current[1], below],
      ] as const) {
        if (host.clientWidth > 0) plot?.setSize({ width: host.clientWidth, height: host.clientHeight });
      }
    });
    observer.observe(above);
    observer.observe(below);
    const theme = matchMedia('(prefers-color-scheme: light)');
    theme.addEventListener('change', build);
    return () => {
      theme.removeEventListener('change', build);
      observer.disconnect();
      for (const plot of plots.current) plot.destroy();
      plots.current = [];
    };
  }, [track, measured]);

  useEffect(() => {
    for (const plot of plots.current) plot.redraw(false);
  }, [at_s]);

  return (
    <div class="track" role="img" aria-label={label}>
      <div class="track-position" ref={position} />
      <div class="track-duty" ref={duty} />
    </div>
  );
}

type Columns = (number | null)[][];

function position_plot(host: HTMLElement, track: Track, measured: Measured | null, drawn: { current: Drawn }): uPlot {
  const sd_m = track.position_sd_m ?? null;
  const edge = (sign: number) =>
    track.position_m.map((at_m, i) => {
      const sd = sd_m?.[i] ?? null;
      return at_m === null || sd === null ? null : at_m + sign * kSpread_sd * sd;
    });
  const columns: Columns = [edge(-1), edge(1), track.setpoint_m, track.position_m];
  if (measured) columns.push(...beside(measured, track.t_s));
  const shown = columns.flat().filter((value): value is number => value !== null);
  const range = next_range([0, 0], Math.min(0, ...minmax(shown)), Math.max(0, ...minmax(shown)), 0.02);
  const edges: uPlot.Series[] = [{ width: 0 }, { width: 0 }];
  return plot_of(
    host,
    track,
    columns,
    range,
    false,
    (value) => millimetres(value, 0),
    drawn,
    (colour) => ({
      bands: [
        { series: [2, 1], fill: colour('--predicted-spread') },
        ...(measured ? [{ series: [6, 5] as [number, number], fill: colour('--spread') }] : []),
      ],
      series: [
        ...edges,
        { stroke: colour('--commanded'), width: 1.5 },
        { stroke: colour('--predicted'), width: 1.5, dash: [6, 3] },
        ...(measured ? [...edges, { stroke: colour('--measured'), width: 1.75 }] : []),
      ],
    }),
  );
}

function duty_plot(host: HTMLElement, track: Track, drawn: { current: Drawn }): uPlot {
  return plot_of(
    host,
    track,
    [track.duty],
    [-1.08, 1.08],
    true,
    (value) => percent(value, 0),
    drawn,
    (colour) => ({
      series: [{ stroke: colour('--duty'), width: 1.25 }],
    }),
  );
}

const minmax = (values: number[]) =>
  values.length === 0
    ? [0]
    : values.reduce<[number, number]>(
        ([low, high], value) => [Math.min(low, value), Math.max(high, value)],
        [Infinity, -Infinity],
      );

function plot_of(
  host: HTMLElement,
  track: Track,
  columns: Columns,
  range: [number, number],
  show_time: boolean,
  label: (value: number) => string,
  drawn: { current: Drawn },
  dressed: (colour: (name: string) => string) => Pick<uPlot.Options, 'bands' | 'series'>,
): uPlot {
  const style = getComputedStyle(host);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const font = `11px ${colour('--numerals')}`;
  const grid = { stroke: colour('--graticule'), width: 1 };
  const axis: uPlot.Axis = { stroke: colour('--muted'), font, grid, ticks: { show: false }, border: { show: false } };
  const { bands = [], series } = dressed(colour);
  const length_s = Math.max(track.t_s.at(-1) ?? 1, 0.1);
  const splits = show_time ? [-1, 0, 1] : range_splits(range);
  return new uPlot(
    {
      width: Math.max(host.clientWidth, 50),
      height: Math.max(host.clientHeight, 40),
      padding: [8, 14, show_time ? 0 : 8, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false, range: () => [0, length_s] }, y: { range: () => range } },
      axes: [
        {
          ...axis,
          size: show_time ? 24 : 0,
          gap: 5,
          splits: () => range_splits([0, length_s]),
          values: (_, at) => (show_time ? at.map((time_s) => `${Number(time_s.toFixed(2))} s`) : []),
        },
        { ...axis, size: 50, gap: 6, splits: () => splits, values: (_, at) => at.map(label) },
      ],
      bands,
      series: [{}, ...series.map((each) => ({ ...each, points: { show: false } }))],
      hooks: { drawAxes: [(u) => draw_times(u, drawn.current, colour)] },
    },
    [track.t_s, ...columns] as uPlot.AlignedData,
    host,
  );
}

// Where each step begins, faint; where the run is now, strong.
function draw_times(u: uPlot, { at_s, step_begins_s }: Drawn, colour: (name: string) => string): void {
  const { left, top, width, height } = u.bbox;
  const line = (time_s: number, stroke: string, dash: number[]) => {
    const x = u.valToPos(time_s, 'x', true);
    if (x < left || x > left + width) return;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.setLineDash(dash);
    u.ctx.lineWidth = devicePixelRatio;
    u.ctx.strokeStyle = stroke;
    u.ctx.moveTo(x, top);
    u.ctx.lineTo(x, top + height);
    u.ctx.stroke();
    u.ctx.restore();
  };
  for (const begins_s of step_begins_s) if (begins_s > 0) line(begins_s, colour('--line-strong'), [2, 4]);
  if (at_s !== null) line(at_s, colour('--ink'), []);
}
