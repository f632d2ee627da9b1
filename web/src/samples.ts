// The last minutes of one robot's samples in fixed memory.
//
// A slot is chosen by the sample's number, so a batch that is sent again later falls into its place and a lost sample
// simply stays missing. Each boot of the robot counts from 0 again; `base` lines the boots up with one slot between
// them. Times in it are page time in seconds (performance.now() / 1000), laid on the robot's own clock at the
// first batch of a boot: the spacing of samples is the robot's, never that of their arrival.

import type { SamplesMessage } from './api';
import { kSpread_sd } from './format';
import { kBatchNumbers, kSampleFields } from './telemetry_fields';

// Every number of a live batch, and what is computed of it: position_m is what the controller sees, the disturbance
// included; estimate_m where the robot believes that it is, and estimate_low_m and estimate_high_m lie two standard
// deviations below and above that. round_trip_us is the link's at the time when the sample came.
export const kColumns = [
  ...kSampleFields,
  ...kBatchNumbers,
  'estimate_m',
  'estimate_low_m',
  'estimate_high_m',
  'round_trip_us',
] as const;
export type Column = (typeof kColumns)[number];
export type DerivedColumn = `=${string}`; // computed from others: plots/derived.ts
export type AnyColumn = Column | DerivedColumn;

// What plots read samples from: rows in order of time, of which some may be missing. Row i lies in slot i % capacity.
export interface SampleRows {
  readonly capacity: number;
  readonly period_s: number;
  readonly gap_s: number; // rows further apart than this are not joined
  readonly time_s: Float64Array;
  readonly first_index: number;
  readonly next_index: number;
  readonly epoch: number; // changes when rows that were read are others now
  rewritten_from: number; // the lowest index that was written since somebody set it to Infinity
  holds(index: number): boolean;
  column(name: AnyColumn): Float64Array;
}
export const kNoColumn = new Float64Array(0);

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
export const kGapPeriods = 1.5;
// How fast the right edge may fall back when samples come later than they used to, in s per s.
const kEdgeRelaxation = 0.02;

export class SampleRing implements SampleRows {
  readonly epoch = 0;
  rewritten_from = Infinity;
  capacity: number;
  time_s: Float64Array;
  columns: Record<Column, Float64Array>;
  received = 0; // samples, without repetitions
  round_trip_us = NaN; // of the link now
  period_s = 0.01;
  time_base_s = 0; // page time = robot time + this, of the newest boot
  private slot_index: Float64Array; // the running index held by a slot, -1: none
  private boot_id = '';
  private base = 0; // running index = base + seq
  private newest = -1; // highest running index
  private lead_s = -Infinity; // how far the newest sample is ahead of page time
  private lead_at_s = 0;

  constructor(capacity = 8192) {
    this.capacity = capacity;
    this.time_s = new Float64Array(capacity);
    this.slot_index = new Float64Array(capacity).fill(-1);
    this.columns = Object.fromEntries(
      kColumns.map((name) => [name, new Float64Array(capacity)]),
    ) as typeof this.columns;
  }

  // Makes room for more of what comes, and keeps what there is.
  grow(capacity: number): void {
    if (capacity <= this.capacity) return;
    const grown = new SampleRing(capacity);
    for (let index = this.first_index; index < this.next_index; ++index) {
      if (!this.holds(index)) continue;
      const [from, to] = [index % this.capacity, index % capacity];
      grown.slot_index[to] = index;
      grown.time_s[to] = this.time_s[from] as number;
      for (const name of kColumns) grown.columns[name][to] = this.columns[name][from] as number;
    }
    const { time_s, columns, slot_index } = grown;
    Object.assign(this, { capacity, time_s, columns, slot_index });
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
    this.rewritten_from = Math.min(this.rewritten_from, first);
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
      this.columns.round_trip_us[slot] = batch.backfill ? NaN : this.round_trip_us;
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
  column(name: AnyColumn): Float64Array {
    return this.columns[name as Column] ?? kNoColumn;
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
