// Which plots a run has: traces, unit and range of each, and the value at the cursor in words.

import { millimetres, millivolts, percent } from '../../format';
import type { PlotContent, PlotLine, PlotTrace } from './run_plot';
import type { Moment } from './moments';
import { row_near, type Column, type Traces } from './traces';

export interface Strip {
  name: string;
  title: string;
  unit: string;
  traces: (Omit<PlotTrace, 'values'> & { column: Column })[];
  has_band?: boolean;
  label: (value: number) => string;
  text: (value: number | null) => string;
  least_span: number;
  fixed_range?: [number, number];
  splits?: number[];
}

const acceleration = (value_m_s2: number | null) =>
  value_m_s2 === null ? '–' : value_m_s2.toFixed(3).replace('-', '\u2212');

export const kStrips: readonly Strip[] = [
  {
    name: 'position',
    title: 'Position',
    unit: 'mm',
    has_band: true,
    traces: [
      { column: 'reference_m', colour: '--commanded-soft', width_px: 1.2 },
      { column: 'setpoint_m', colour: '--commanded', width_px: 1.4, dash_px: [7, 5], holds: true },
      { column: 'position_m', colour: '--seen', width_px: 1.2 },
      { column: 'estimate_m', colour: '--measured', width_px: 1.8 },
    ],
    label: (value) => millimetres(value, 0),
    text: (value) => millimetres(value),
    least_span: 0.02,
  },
  {
    name: 'duty',
    title: 'Duty',
    unit: '%',
    traces: [{ column: 'duty', colour: '--duty', width_px: 1.3 }],
    label: (value) => percent(value, 0),
    text: percent,
    least_span: 1,
    fixed_range: [-1.08, 1.08],
    splits: [-1, 0, 1],
  },
  {
    name: 'velocity',
    title: 'Velocity',
    unit: 'mm/s',
    traces: [{ column: 'velocity_m_s', colour: '--measured', width_px: 1.3 }],
    label: (value) => millimetres(value, 0),
    text: (value) => millimetres(value),
    least_span: 0.01,
  },
  {
    name: 'acceleration',
    title: 'Acceleration',
    unit: 'm/s²',
    traces: [{ column: 'acceleration_m_s2', colour: '--measured', width_px: 1.1 }],
    label: (value) => String(Number(value.toFixed(3))).replace('-', '\u2212'),
    text: acceleration,
    least_span: 0.1,
  },
  {
    name: 'impedance',
    title: 'Impedance',
    unit: 'mV',
    traces: [{ column: 'impedance_mv', colour: '--impedance', width_px: 1.3 }],
    label: (value) => millivolts(value).replace('.0', ''),
    text: millivolts,
    least_span: 10,
  },
];

const kLines: Record<Moment['kind'], Omit<PlotLine, 'at_s' | 'label'>> = {
  marker: { colour: '--muted', dash_px: [] },
  command: { colour: '--commanded-soft', dash_px: [2, 3] },
  event: { colour: '--line-strong', dash_px: [2, 3] },
  alarm: { colour: '--alarm', dash_px: [] },
};

export function lines_of(
  moments: readonly Moment[],
  origin_us: number,
  picked_s: number | null,
  with_labels: boolean,
): PlotLine[] {
  const lines = moments.map((moment) => ({
    ...kLines[moment.kind],
    at_s: (moment.utc_us - origin_us) / 1e6,
    label: with_labels && (moment.kind === 'marker' || moment.kind === 'alarm') ? moment.text : '',
  }));
  if (picked_s !== null) lines.push({ at_s: picked_s, label: '', colour: '--ink', dash_px: [6, 3] });
  return lines;
}

export function content_of(
  strip: Strip,
  traces: Traces,
  lines: PlotLine[],
  waits_s: [number, number][] = [],
): PlotContent {
  const { time_s, columns, gaps_s } = traces;
  return {
    time_s,
    bands: strip.has_band ? [{ low: columns.low_m, high: columns.high_m, colour: '--spread' }] : [],
    traces: strip.traces.map(({ column, ...look }) => ({ ...look, values: columns[column] })),
    gaps_s,
    waits_s,
    lines,
  };
}

// What stands at a time: one value, or the least and the largest of the samples that the point has.
export function cursor_text(strip: Strip, traces: Traces, at_s: number | null): string {
  const row = at_s === null ? null : row_near(traces, at_s);
  if (at_s === null) return '';
  if (row === null) return 'no samples';
  const main = strip.traces.at(-1)?.column as Column;
  const column = main === 'estimate_m' && (traces.columns.estimate_m[row] ?? null) === null ? 'position_m' : main;
  const extremes = rows_of_point(traces, row).map((each) => traces.columns[column][each] ?? null);
  const numbers = extremes.filter((value) => value !== null);
  const least = numbers.length > 0 ? Math.min(...numbers) : null;
  const largest = numbers.length > 0 ? Math.max(...numbers) : null;
  const [low_text, high_text] = [strip.text(least), strip.text(largest)];
  const value = low_text === high_text ? low_text : `${low_text} to ${high_text}`;
  return `${value}${spread_text(strip, traces, row, column, least)}${setpoint_text(strip, traces, row)} ${strip.unit}`;
}

function rows_of_point({ point_at }: Traces, row: number): number[] {
  return [row - 1, row, row + 1].filter((each) => point_at[each] === point_at[row]);
}

function spread_text(strip: Strip, traces: Traces, row: number, column: Column, least: number | null): string {
  if (!strip.has_band) return '';
  if (column === 'position_m') return ', as the controller sees it,';
  const low_m = traces.columns.low_m[row] ?? null;
  return low_m === null || least === null ? '' : ` ± ${millimetres(least - low_m)}`;
}

function setpoint_text(strip: Strip, { columns }: Traces, row: number): string {
  const setpoint_m = strip.has_band ? (columns.setpoint_m[row] ?? null) : null;
  return setpoint_m === null ? '' : `, setpoint ${millimetres(setpoint_m)}`;
}
