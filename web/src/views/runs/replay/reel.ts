// The samples of a replay, in pages that come and go around the moment that is shown.
//
// A page is a stretch of time of about a thousand samples. Its rows lie in a slot of fixed memory that is chosen by its
// number, so any moment can be sought and nothing grows. What no page holds is not known; what a page holds nothing of was
// never recorded. Between two samples nothing is made up: the row at a moment is the sample at or before it.

import type { StoredSample } from '../../../api';
import { kSpread_sd } from '../../../format';
import {
  estimate_of,
  kColumns,
  kGapPeriods,
  kNoColumn,
  type AnyColumn,
  type Column,
  type SampleRows,
} from '../../../samples';
import { kSampleFields } from '../../../telemetry_fields';

export const kPages = 64; // that are held at once
const kSamplesOfPage = 1000;
export const kRowsOfPage = 1024; // a clock that is set back a little has room; a multiple of the plots' blocks

// What holds for many samples in a row; kept once for all of them.
export interface Situation {
  boot_id: string;
  mode: string;
  sub_state: string;
  emergency_id: string | null;
  emergency_cause: string;
  flags: number;
}

export interface Row {
  utc_us: number;
  seq: number;
  situation: Situation;
  value(column: Column): number | null;
}

interface Page {
  number: number;
  rows: number;
  known_to_us: number; // it has what was recorded until then
}

export class Reel implements SampleRows {
  readonly capacity = kPages * kRowsOfPage;
  readonly time_s = new Float64Array(this.capacity); // UTC
  readonly epoch = 0;
  rewritten_from = Infinity;
  readonly period_s: number;
  readonly page_us: number;
  private moment_index = 0; // rows before this one are of the moment's past
  private readonly utc_us = new Float64Array(this.capacity);
  private readonly seq = new Float64Array(this.capacity);
  private readonly situation_at = new Uint16Array(this.capacity);
  private readonly columns = Object.fromEntries(
    kColumns.map((name) => [name, new Float64Array(this.capacity)]),
  ) as Record<Column, Float64Array>;
  private readonly pages: (Page | null)[] = Array.from({ length: kPages }, () => null);
  private readonly situations: Situation[] = [];
  private readonly situation_of = new Map<string, number>();

  constructor(
    readonly origin_us: number,
    period_us: number,
  ) {
    this.period_s = period_us / 1e6;
    this.page_us = Math.round(kSamplesOfPage * period_us);
  }

  get gap_s(): number {
    return kGapPeriods * this.period_s;
  }
  get first_index(): number {
    return Math.max(0, (Math.floor(this.moment_index / kRowsOfPage) - kPages + 1) * kRowsOfPage);
  }
  get next_index(): number {
    return this.moment_index;
  }
  holds(index: number): boolean {
    const page = this.pages[Math.floor(index / kRowsOfPage) % kPages];
    return page?.number === Math.floor(index / kRowsOfPage) && index % kRowsOfPage < page.rows;
  }
  column(name: AnyColumn): Float64Array {
    return this.columns[name as Column] ?? kNoColumn;
  }

  number_of(utc_us: number): number {
    return Math.max(0, Math.floor((utc_us - this.origin_us) / this.page_us));
  }
  start_us(number: number): number {
    return this.origin_us + number * this.page_us;
  }
  page(number: number): Page | null {
    const page = this.pages[number % kPages] ?? null;
    return page?.number === number ? page : null;
  }

  // `known_to_us`: what is recorded later than that is not in it.
  take(number: number, samples: readonly StoredSample[], known_to_us: number): void {
    const [from_us, to_us] = [this.start_us(number), this.start_us(number + 1)];
    const ours = samples
      .filter(({ utc_us }) => utc_us >= from_us && utc_us < to_us)
      .sort((a, b) => a.utc_us - b.utc_us)
      .slice(0, kRowsOfPage);
    const first = number * kRowsOfPage;
    ours.forEach((sample, at) => this.put((first + at) % this.capacity, sample));
    this.pages[number % kPages] = { number, rows: ours.length, known_to_us };
    this.rewritten_from = Math.min(this.rewritten_from, first);
  }

  // Which rows are of the past at a moment; the plots end there.
  show_until(utc_us: number): void {
    const number = this.number_of(utc_us);
    this.moment_index = number * kRowsOfPage + this.rows_until(number, utc_us);
  }

  // The sample at or next before a moment, as far as pages are held without a break. null: not known, or there is none.
  at(utc_us: number): Row | null {
    const number = this.number_of(utc_us);
    const rows = this.rows_until(number, utc_us);
    if (rows > 0) return this.row(number * kRowsOfPage + rows - 1);
    for (let before = number - 1; before >= 0; --before) {
      const page = this.page(before);
      if (!page || !this.page(number)) return null;
      if (page.rows > 0) return this.row(before * kRowsOfPage + page.rows - 1);
    }
    return null;
  }

  // The sample after or before the one at a moment. A number: that page has to come first. null: there is none.
  next_to(utc_us: number, by: 1 | -1, last_us: number): Row | number | null {
    const number = this.number_of(utc_us);
    if (!this.page(number)) return number;
    const until = by > 0 ? this.rows_until(number, utc_us) : this.rows_until(number, utc_us - 0.5) - 1;
    const here = this.page(number) as Page;
    if (until >= 0 && until < here.rows) return this.row(number * kRowsOfPage + until);
    for (let next = number + by; next >= 0 && this.start_us(next) < last_us; next += by) {
      const page = this.page(next);
      if (!page) return next;
      if (page.rows > 0) return this.row(next * kRowsOfPage + (by > 0 ? 0 : page.rows - 1));
    }
    return null;
  }

  // Of a page, how many of its rows are at or before a moment.
  private rows_until(number: number, utc_us: number): number {
    const first = (number * kRowsOfPage) % this.capacity;
    let [low, high] = [0, this.page(number)?.rows ?? 0];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.utc_us[first + middle] as number) <= utc_us) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  private row(index: number): Row {
    const slot = index % this.capacity;
    return {
      utc_us: this.utc_us[slot] as number,
      seq: this.seq[slot] as number,
      situation: this.situations[this.situation_at[slot] as number] as Situation,
      value: (column) => {
        const value = this.columns[column][slot] as number;
        return Number.isNaN(value) ? null : value;
      },
    };
  }

  private put(slot: number, sample: StoredSample): void {
    const { columns } = this;
    const estimate_m = estimate_of(sample.position_m, sample.disturbance_m) ?? NaN;
    const spread_m = sample.position_sd_m === null ? NaN : kSpread_sd * sample.position_sd_m;
    this.time_s[slot] = sample.utc_us / 1e6;
    this.utc_us[slot] = sample.utc_us;
    this.seq[slot] = sample.seq;
    this.situation_at[slot] = this.number_of_situation(sample);
    for (const name of kSampleFields) columns[name][slot] = sample[name] ?? NaN;
    columns.setpoint_m[slot] = sample.setpoint_m ?? NaN;
    columns.disturbance_m[slot] = sample.disturbance_m ?? NaN;
    columns.position_sd_m[slot] = sample.position_sd_m ?? NaN;
    if (sample.setpoint_m === null) columns.reference_m[slot] = NaN; // there is nothing that the robot follows
    columns.estimate_m[slot] = estimate_m;
    columns.estimate_low_m[slot] = estimate_m - spread_m;
    columns.estimate_high_m[slot] = estimate_m + spread_m;
    columns.round_trip_us[slot] = NaN; // is not recorded
  }

  private number_of_situation(sample: StoredSample): number {
    const { boot_id, mode, sub_state, emergency_id, emergency_cause, flags } = sample;
    const key = `${boot_id} ${mode} ${sub_state} ${emergency_id} ${emergency_cause} ${flags}`;
    const known = this.situation_of.get(key);
    if (known !== undefined) return known;
    this.situations.push({ boot_id, mode, sub_state, emergency_id, emergency_cause, flags });
    this.situation_of.set(key, this.situations.length - 1);
    return this.situations.length - 1;
  }
}
