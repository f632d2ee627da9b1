// The last minutes of one robot's samples in fixed memory, and the part of them that a plot shows.
//
// A slot is chosen by the sample's number, so a batch that is sent again later falls into its place and a lost sample
// simply stays missing. Each boot of the robot counts from 0 again; `base` lines the boots up with one slot between
// them. Times on the plot are page time in seconds (performance.now() / 1000), laid on the robot's own clock at the
// first batch of a boot: the spacing of samples is the robot's, never that of their arrival.

import type { SamplesMessage } from './api';
import { kSpread_sd } from './format';
import { kBatchNumbers, kSampleFields } from './telemetry_fields';

// Every number of a live batch, and what is computed of it: position_m is what the controller sees, the disturbance
// included; estimate_m where the robot believes that it is, and estimate_low_m and estimate_high_m lie two standard
// deviations below and above that.
export const kColumns = [
  ...kSampleFields,
  ...kBatchNumbers,
  'estimate_m',
  'estimate_low_m',
  'estimate_high_m',
] as const;
export type Column = (typeof kColumns)[number];

// Where the robot believes that it is: what its controller sees, less the disturbance that was injected. null: not known.
export function estimate_of(
  position_m: number | null | undefined,
  disturbance_m: number | null | undefined,
): number | null {
  if (position_m === null || position_m === undefined || disturbance_m === null || disturbance_m === undefined)
    return null;
  return position_m - disturbance_m;
}

// Consecutive samples further apart than this many periods are not joined by a line.
const kGapPeriods = 1.5;
// How fast the right edge may fall back when samples come later than they used to, in s per s.
const kEdgeRelaxation = 0.02;

export class SampleRing {
  readonly capacity: number;
  readonly time_s: Float64Array;
  readonly columns: Record<Column, Float64Array>;
  received = 0; // samples, without repetitions
  private readonly slot_index: Float64Array; // the running index held by a slot, -1: none
  private boot_id = '';
  private base = 0; // running index = base + seq
  private newest = -1; // highest running index
  private time_base_s = 0; // page time = robot time + this
  private lead_s = -Infinity; // how far the newest sample is ahead of page time
  private lead_at_s = 0;
  private period_s = 0.01;

  constructor(capacity = 8192) {
    this.capacity = capacity;
    this.time_s = new Float64Array(capacity);
    this.slot_index = new Float64Array(capacity).fill(-1);
    this.columns = Object.fromEntries(
      kColumns.map((name) => [name, new Float64Array(capacity)]),
    ) as typeof this.columns;
  }

  // Lays a batch down; page_now_s is when it arrived.
  append(batch: SamplesMessage, page_now_s: number): void {
    const size = batch.position_m.length;
    if (size === 0) return;
    const last_robot_s = (batch.first_robot_time_us + (size - 1) * batch.period_us) / 1e6;
    this.period_s = batch.period_us / 1e6;
    if (batch.boot_id !== this.boot_id) {
      this.boot_id = batch.boot_id;
      this.base = this.newest + 2 - batch.first_seq;
      if (this.newest < 0) this.base = 0;
      this.time_base_s = page_now_s - last_robot_s;
      this.lead_s = -Infinity;
    }
    const first = this.base + batch.first_seq;
    const spread_m = batch.position_sd_m === null ? NaN : kSpread_sd * batch.position_sd_m;
    for (let i = 0; i < size; ++i) {
      const index = first + i;
      if (index <= this.newest - this.capacity || index < 0) continue; // too old to be shown
      const slot = index % this.capacity;
      if (this.slot_index[slot] !== index) this.received += 1;
      this.slot_index[slot] = index;
      this.time_s[slot] = (batch.first_robot_time_us + i * batch.period_us) / 1e6 + this.time_base_s;
      for (const name of kSampleFields) this.columns[name][slot] = batch[name][i] ?? NaN;
      for (const name of kBatchNumbers) this.columns[name][slot] = batch[name] ?? NaN;
      if (batch.setpoint_m === null) this.columns.reference_m[slot] = NaN; // there is nothing that the robot follows
      const estimate_m = estimate_of(batch.position_m[i], batch.disturbance_m) ?? NaN;
      this.columns.estimate_m[slot] = estimate_m;
      this.columns.estimate_low_m[slot] = estimate_m - spread_m;
      this.columns.estimate_high_m[slot] = estimate_m + spread_m;
    }
    if (first + size - 1 <= this.newest) return; // sent again: the edge is led by new samples alone
    this.newest = first + size - 1;
    const lead_s = last_robot_s + this.time_base_s - page_now_s;
    const relaxed_s = this.lead_s - kEdgeRelaxation * (page_now_s - this.lead_at_s);
    this.lead_s = Math.max(lead_s, relaxed_s);
    this.lead_at_s = page_now_s;
  }

  // The time at the right edge of a plot that runs: new samples appear there, and it moves evenly between them.
  edge_s(page_now_s: number): number {
    return this.newest < 0 ? page_now_s : page_now_s + this.lead_s;
  }

  // Running indexes that may be held, oldest first; holds() tells which are.
  get first_index(): number {
    return Math.max(0, this.newest - this.capacity + 1);
  }
  get next_index(): number {
    return this.newest + 1;
  }
  holds(index: number): boolean {
    return index >= 0 && this.slot_index[index % this.capacity] === index;
  }
  get gap_s(): number {
    return kGapPeriods * this.period_s;
  }

  clear(): void {
    this.slot_index.fill(-1);
    this.newest = -1;
    this.boot_id = '';
    this.received = 0;
  }
}

// What a plot draws: times relative to the right edge, values without holes, and the stretches that are not drawn.
export class PlotWindow {
  readonly time_s: Float64Array;
  readonly values: Float64Array[];
  readonly gaps_s: [number, number][][];
  private readonly in_hole: boolean[]; // the sample before had no value
  size = 0;
  low = 0; // over all columns that are ranged
  high = 0;

  // The first `unranged` columns do not count in low and high.
  constructor(
    capacity: number,
    readonly names: readonly Column[],
    private readonly unranged = 0,
  ) {
    this.time_s = new Float64Array(capacity);
    this.values = names.map(() => new Float64Array(capacity));
    this.gaps_s = names.map(() => []);
    this.in_hole = names.map(() => false);
  }

  // Takes from the ring what lies in [edge - span, edge].
  fill(ring: SampleRing, edge_s: number, span_s: number): void {
    this.size = 0;
    this.low = Infinity;
    this.high = -Infinity;
    for (const gaps of this.gaps_s) gaps.length = 0;
    this.in_hole.fill(false);
    let previous_s = -Infinity;
    for (let index = ring.first_index; index < ring.next_index; ++index) {
      if (!ring.holds(index)) continue;
      const slot = index % ring.capacity;
      const time_s = (ring.time_s[slot] ?? 0) - edge_s;
      if (time_s < -span_s - ring.gap_s || time_s > ring.gap_s) continue;
      if (time_s <= previous_s) continue; // a boot that overlaps the one before
      this.put(ring, slot, time_s, time_s - previous_s > ring.gap_s && this.size > 0 ? previous_s : null);
      previous_s = time_s;
    }
  }

  private put(ring: SampleRing, slot: number, time_s: number, gap_from_s: number | null): void {
    const at = this.size;
    this.time_s[at] = time_s;
    for (let c = 0; c < this.names.length; ++c) {
      const name = this.names[c] as Column;
      const values = this.values[c] as Float64Array;
      const gaps = this.gaps_s[c] as [number, number][];
      const value = ring.columns[name][slot] as number;
      const last = gaps[gaps.length - 1];
      if (gap_from_s !== null) gaps.push([gap_from_s, time_s]);
      else if (this.in_hole[c] && last) last[1] = time_s;
      const missing = !Number.isFinite(value);
      if (missing && !this.in_hole[c]) gaps.push([time_s, time_s]);
      this.in_hole[c] = missing;
      values[at] = missing ? (at > 0 ? (values[at - 1] as number) : 0) : value; // a missing one lies in a gap
      if (missing || c < this.unranged) continue;
      this.low = Math.min(this.low, value);
      this.high = Math.max(this.high, value);
    }
    this.size += 1;
  }
}
