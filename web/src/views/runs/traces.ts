// An overview of the station as columns of a plot: two rows for each point, its least and its largest value.
//
// A point that covers several samples is drawn as a stroke from one extreme to the other, in the order that continues the
// trace; together they fill exactly what the samples would. Where nothing is stored a row of nulls keeps the ends apart.

import { kSpread_sd } from '../../format';
import type { Knots } from './knots';
import type { Overview } from './runs_api';

export const kChannels = [
  'position_m',
  'velocity_m_s',
  'acceleration_m_s2',
  'duty',
  'impedance_mv',
  'reference_m',
] as const;
export type Channel = (typeof kChannels)[number];
export const kColumns = [...kChannels, 'estimate_m', 'low_m', 'high_m', 'setpoint_m'] as const;
export type Column = (typeof kColumns)[number];
export type Values = (number | null)[];

export interface Traces {
  time_s: number[]; // since the origin
  point_at: number[]; // of each row, its point in the overview; -1 in a gap
  columns: Record<Column, Values>;
  gaps_s: [number, number][]; // where samples are missing
  period_s: number;
}

const kGapPeriods = 1.5;
const kUsualPeriod_us = 10_000;

// How far consecutive samples are apart, as far as an overview tells.
export function period_us_of({ first_utc_us, last_utc_us, samples }: Overview): number {
  let least_us = Infinity;
  for (let at = 0; at < samples.length; ++at) {
    const size = samples[at] as number;
    const inside_us = ((last_utc_us[at] as number) - (first_utc_us[at] as number)) / (size - 1);
    const step_us = at > 0 ? (first_utc_us[at] as number) - (last_utc_us[at - 1] as number) : Infinity;
    if (size > 1) least_us = Math.min(least_us, inside_us);
    if (step_us > 0) least_us = Math.min(least_us, step_us);
  }
  return Number.isFinite(least_us) && least_us > 0 ? least_us : kUsualPeriod_us;
}

export function traces_of(overview: Overview, origin_us: number, knots: Knots): Traces {
  const { first_utc_us, last_utc_us, samples } = overview;
  const period_us = period_us_of(overview);
  const made: Traces = {
    time_s: [],
    point_at: [],
    columns: Object.fromEntries(kColumns.map((name) => [name, [] as Values])) as Record<Column, Values>,
    gaps_s: [],
    period_s: period_us / 1e6,
  };
  const time_s = (utc_us: number) => (utc_us - origin_us) / 1e6;
  let end_us = NaN;
  for (let at = 0; at < samples.length; ++at) {
    const [from_us, to_us, size] = [first_utc_us[at], last_utc_us[at], samples[at]] as [number, number, number];
    if (from_us - end_us > kGapPeriods * period_us) {
      made.gaps_s.push([time_s(end_us), time_s(from_us)]);
      put_hole(made, time_s((end_us + from_us) / 2));
    }
    // Samples missing inside of a point cannot be drawn as a hole of the trace; they are marked all the same.
    if (to_us - from_us > (size - 1 + kGapPeriods - 1) * period_us) made.gaps_s.push([time_s(from_us), time_s(to_us)]);
    put_point(made, overview, at, origin_us, knots);
    end_us = to_us;
  }
  return made;
}

function put_hole(made: Traces, time_s: number): void {
  made.time_s.push(time_s);
  made.point_at.push(-1);
  for (const name of kColumns) made.columns[name].push(null);
}

function put_point(made: Traces, overview: Overview, at: number, origin_us: number, knots: Knots): void {
  const [from_us, to_us] = [overview.first_utc_us[at], overview.last_utc_us[at]] as [number, number];
  const rows_us = to_us > from_us ? [from_us, to_us] : [from_us];
  const { columns } = made;
  const first_row = made.time_s.length;
  for (const [row, utc_us] of rows_us.entries()) {
    const known = knots.at(utc_us);
    made.time_s.push((utc_us - origin_us) / 1e6);
    made.point_at.push(at);
    for (const name of kChannels) columns[name].push(extreme(overview, name, at, row, columns[name][first_row - 1]));
    const seen_m = columns.position_m.at(-1) ?? null;
    const estimate_m = less(seen_m, known.disturbance_m);
    columns.estimate_m.push(estimate_m);
    const least_m = less(overview.position_m?.min[at] ?? null, known.disturbance_m);
    const largest_m = less(overview.position_m?.max[at] ?? null, known.disturbance_m);
    const spread_m = known.position_sd_m === null ? null : kSpread_sd * known.position_sd_m;
    columns.low_m.push(least_m === null || spread_m === null ? null : least_m - spread_m);
    columns.high_m.push(largest_m === null || spread_m === null ? null : largest_m + spread_m);
    columns.setpoint_m.push(known.setpoint_m ?? null);
    if (known.setpoint_m === null) columns.reference_m[columns.reference_m.length - 1] = null; // nothing is followed
  }
}

const less = (value: number | null, offset: number | null | undefined): number | null =>
  value === null || offset === null || offset === undefined ? null : value - offset;

// The extreme that lies nearer to where the trace ended comes first.
function extreme(overview: Overview, name: Channel, at: number, row: number, before: number | null | undefined) {
  const least = overview[name]?.min[at] ?? null;
  const largest = overview[name]?.max[at] ?? null;
  if (least === null || largest === null) return null;
  const begins_low = before === null || before === undefined || Math.abs(before - least) <= Math.abs(before - largest);
  return begins_low === (row === 0) ? least : largest;
}

// The row at or next to a time; null where no sample is within reach of it.
export function row_near({ time_s, point_at, period_s }: Traces, at_s: number): number | null {
  let [low, high] = [0, time_s.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((time_s[middle] as number) < at_s) low = middle + 1;
    else high = middle;
  }
  const near = [low - 1, low].filter((row) => (point_at[row] ?? -1) >= 0);
  const far = (row: number) => Math.abs((time_s[row] as number) - at_s);
  near.sort((a, b) => far(a) - far(b));
  const best = near[0];
  if (best === undefined) return null;
  const is_inside = near.length === 2 && point_at[near[0] as number] === point_at[near[1] as number];
  const stride_s = near.length === 2 ? Math.abs((time_s[low] as number) - (time_s[low - 1] as number)) : period_s;
  return is_inside || far(best) <= Math.max(period_s, stride_s) ? best : null;
}

// Least and largest value of columns between two times; null where there is none.
export function range_of(
  traces: Traces,
  names: readonly Column[],
  from_s: number,
  to_s: number,
): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (let row = 0; row < traces.time_s.length; ++row) {
    const time_s = traces.time_s[row] as number;
    if (time_s < from_s || time_s > to_s) continue;
    for (const name of names) {
      const value = traces.columns[name][row];
      if (value === null || value === undefined) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  return low <= high ? [low, high] : null;
}

// The farthest that the band reaches from the estimate between two times.
export function largest_spread_m({ time_s, columns }: Traces, from_s: number, to_s: number): number {
  const { estimate_m, low_m, high_m } = columns;
  return time_s.reduce((largest, at_s, row) => {
    const [middle, low, high] = [estimate_m[row] ?? null, low_m[row] ?? null, high_m[row] ?? null];
    if (at_s < from_s || at_s > to_s || middle === null || low === null || high === null) return largest;
    // A row has one extreme of its point, and lies nearer to that edge of the band.
    return Math.max(largest, Math.min(high - middle, middle - low));
  }, 0);
}
