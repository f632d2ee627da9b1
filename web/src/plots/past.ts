// What the station has recorded of a robot, in tiles that are asked for when they are looked at, and kept.
//
// Level 0 holds every sample, 10 s in a tile. Above it a tile holds 600 points, each with the least and the largest value
// of its samples: 60 s in a tile of level 1, four times as much with each level. A tile that reaches into the present is
// asked for again when what came later is wanted.

import type { Overview, StoredSample } from '../api';
import { kSpread_sd } from '../format';
import { estimate_of, kGapPeriods, type AnyColumn, type Column } from '../samples';
import { kSampleFields } from '../telemetry_fields';
import { column_of, DerivedRows, lead_s, ListRows, type DerivedSpec } from './derived';

export const kTilePoints = 600;
const kSamplesTile_s = 10;
const kFirstTile_s = 60;
const kTileGrowth = 4;
const kMaxLevel = 9;
const kMaxTiles = 160;
const kAtOnce = 2; // requests on their way
const kAgain_s = 4; // before a tile is asked for again
const kSettled_s = 3; // what is this old has reached the station's disk or memory

export interface Extremes {
  min: Float64Array;
  max: Float64Array;
}

export interface Tile {
  from_s: number;
  to_s: number;
  known_to_s: number; // it has what was recorded until then
  first_s: Float64Array; // of each point: when its first sample was made, and its last
  last_s: Float64Array;
  columns: Partial<Record<AnyColumn, Extremes>>;
}

export interface PastWays {
  samples(from_us: number, to_us: number): Promise<StoredSample[]>;
  overview(from_us: number, to_us: number, points: number): Promise<Overview>;
  now_s(): number; // UTC
}

export const tile_span_s = (level: number) =>
  level === 0 ? kSamplesTile_s : kFirstTile_s * kTileGrowth ** (level - 1);

// The coarsest level that still has a point for each bin.
export function level_of(bin_s: number): number {
  let level = 0;
  while (level < kMaxLevel && tile_span_s(level + 1) / kTilePoints <= bin_s) ++level;
  return level;
}

export class Past {
  problem: string | null = null; // why the last request failed
  private readonly tiles = new Map<string, Tile>(); // the ones used last stand last
  private readonly asked_at_s = new Map<string, number>();
  private wanted: { level: number; number: number }[] = [];
  private under_way = 0;
  private is_closed = false;
  private derived: readonly DerivedSpec[] = [];

  // `least_level`: 1 where the caller has the samples themselves from elsewhere.
  constructor(
    private readonly ways: PastWays,
    private readonly on_change: () => void,
    private readonly least_level = 0,
  ) {}

  // What is computed of samples. Tiles of samples are asked for anew.
  derive(specs: readonly DerivedSpec[]): void {
    if (JSON.stringify(specs) === JSON.stringify(this.derived)) return;
    this.derived = specs;
    for (const key of [...this.tiles.keys()].filter((each) => each.startsWith('0/'))) {
      this.tiles.delete(key);
      this.asked_at_s.delete(key);
    }
  }

  get is_loading(): boolean {
    return this.under_way > 0;
  }

  close(): void {
    this.is_closed = true;
  }

  // Around each drawing: only what was looked at last is asked for.
  begin(): void {
    this.wanted = [];
  }
  end(): void {
    // The newest first: that is where the eye is.
    this.wanted.reverse();
    this.hurry();
  }

  // Calls `point` for each point within the stretch, in order of time.
  visit(from_s: number, to_s: number, bin_s: number, point: (tile: Tile, at: number) => void): void {
    const level = Math.max(this.least_level, level_of(bin_s));
    const span_s = tile_span_s(level);
    for (let number = Math.floor(from_s / span_s); number * span_s < to_s; ++number) {
      const [start_s, end_s] = [Math.max(from_s, number * span_s), Math.min(to_s, (number + 1) * span_s)];
      const tile = this.find(level, number);
      if (!tile || tile.known_to_s < end_s) this.wanted.push({ level, number });
      const drawn = tile ?? this.coarser(level, start_s);
      if (drawn) each_point(drawn, start_s, end_s, point);
    }
  }

  private find(level: number, number: number): Tile | undefined {
    const key = `${level}/${number}`;
    const tile = this.tiles.get(key);
    if (tile) {
      this.tiles.delete(key);
      this.tiles.set(key, tile);
    }
    return tile;
  }

  // Until the finer one has come.
  private coarser(level: number, at_s: number): Tile | undefined {
    for (let above = level + 1; above <= kMaxLevel; ++above) {
      const tile = this.tiles.get(`${above}/${Math.floor(at_s / tile_span_s(above))}`);
      if (tile) return tile;
    }
    return undefined;
  }

  private hurry(): void {
    const now_s = this.ways.now_s();
    while (this.under_way < kAtOnce && !this.is_closed) {
      const next = this.wanted.find(({ level, number }) => {
        const asked_s = this.asked_at_s.get(`${level}/${number}`) ?? -Infinity;
        return now_s - asked_s > kAgain_s && number * tile_span_s(level) < now_s;
      });
      if (!next) return;
      this.asked_at_s.set(`${next.level}/${next.number}`, now_s);
      void this.load(next.level, next.number, now_s);
    }
  }

  private async load(level: number, number: number, now_s: number): Promise<void> {
    const span_s = tile_span_s(level);
    const [from_s, to_s] = [number * span_s, (number + 1) * span_s];
    const [from_us, to_us] = [Math.max(0, Math.round(from_s * 1e6)), Math.round(to_s * 1e6)];
    const { derived } = this;
    const lead_us = Math.round(lead_s(derived) * 1e6);
    this.under_way += 1;
    try {
      const known_to_s = Math.min(to_s, now_s - kSettled_s);
      const tile =
        level === 0
          ? with_derived(await this.ways.samples(Math.max(0, from_us - lead_us), to_us), derived, from_s)
          : tile_of_overview(await this.ways.overview(from_us, to_us, kTilePoints));
      // Meanwhile another set of computed traces may be wanted: then it is asked for again.
      if (level > 0 || derived === this.derived) this.keep(`${level}/${number}`, { ...tile, from_s, to_s, known_to_s });
      this.problem = null;
    } catch (error) {
      this.problem = error instanceof Error ? error.message : String(error);
    } finally {
      this.under_way -= 1;
    }
    if (!this.is_closed) this.on_change();
  }

  private keep(key: string, tile: Tile): void {
    this.tiles.delete(key);
    this.tiles.set(key, tile);
    for (const oldest of this.tiles.keys()) {
      if (this.tiles.size <= kMaxTiles) break;
      this.tiles.delete(oldest);
      this.asked_at_s.delete(oldest);
    }
  }
}

function each_point(tile: Tile, from_s: number, to_s: number, point: (tile: Tile, at: number) => void): void {
  for (let at = 0; at < tile.first_s.length; ++at) {
    if ((tile.last_s[at] as number) < from_s || (tile.first_s[at] as number) >= to_s) continue;
    point(tile, at);
  }
}

type Points = Pick<Tile, 'first_s' | 'last_s' | 'columns'>;
const number_of = (value: number | null | undefined) => value ?? NaN;

export function tile_of_samples(samples: StoredSample[]): Points {
  const time_s = Float64Array.from(samples, (sample) => sample.utc_us / 1e6);
  const columns: Points['columns'] = {};
  const keep = (name: Column, value: (sample: StoredSample) => number | null) => {
    const values = Float64Array.from(samples, (sample) => number_of(value(sample)));
    columns[name] = { min: values, max: values };
  };
  for (const name of kSampleFields) keep(name, (sample) => sample[name]);
  keep('setpoint_m', (sample) => sample.setpoint_m);
  keep('disturbance_m', (sample) => sample.disturbance_m);
  keep('position_sd_m', (sample) => sample.position_sd_m);
  keep('reference_m', (sample) => (sample.setpoint_m === null ? null : sample.reference_m));
  const estimate_m = (sample: StoredSample) => number_of(estimate_of(sample.position_m, sample.disturbance_m));
  const spread_m = (sample: StoredSample) => kSpread_sd * number_of(sample.position_sd_m);
  keep('estimate_m', estimate_m);
  keep('estimate_low_m', (sample) => estimate_m(sample) - spread_m(sample));
  keep('estimate_high_m', (sample) => estimate_m(sample) + spread_m(sample));
  return { first_s: time_s, last_s: time_s, columns };
}

// Computed columns are right from the first sample of a tile on, since what lies before it was asked for as well.
function with_derived(samples: StoredSample[], specs: readonly DerivedSpec[], from_s: number): Points {
  const all = tile_of_samples(samples);
  if (specs.length === 0) return all;
  const size = all.first_s.length;
  const period_s = size > 1 ? median_step_s(all.first_s) : 0.01;
  const recorded = (Object.keys(all.columns) as Column[]).map(
    (name) => [name, (all.columns[name] as Extremes).min] as const,
  );
  const rows = new DerivedRows(
    new ListRows(all.first_s, Object.fromEntries(recorded), period_s, kGapPeriods * period_s),
    specs,
  );
  rows.update();
  const first = all.first_s.findIndex((time_s) => time_s >= from_s);
  const cut = (values: Float64Array) => values.subarray(first < 0 ? size : first, size);
  const columns: Points['columns'] = {};
  for (const name of [...recorded.map(([each]) => each), ...specs.map(column_of)]) {
    const values = cut(rows.column(name));
    columns[name] = { min: values, max: values };
  }
  return { first_s: cut(all.first_s), last_s: cut(all.last_s), columns };
}

function median_step_s(time_s: Float64Array): number {
  const steps = time_s.subarray(1).map((at_s, i) => at_s - (time_s[i] as number));
  return steps.sort()[steps.length >> 1] as number;
}

// The "±" of a point is the largest of its samples. A reference of 0 throughout is what a robot records while it follows
// none.
export function tile_of_overview(overview: Overview): Points {
  const columns: Points['columns'] = {};
  const keep = (column: Column, channel: Overview['position_m']) => {
    if (!channel) return;
    const [min, max] = [Float64Array.from(channel.min, number_of), Float64Array.from(channel.max, number_of)];
    columns[column] = { min, max };
  };
  for (const name of kSampleFields) keep(name, overview[name]);
  for (const name of ['setpoint_m', 'disturbance_m', 'position_sd_m'] as const) keep(name, overview[name]);
  keep('estimate_m', overview.estimated_position_m);
  const { reference_m, estimate_m, position_sd_m } = columns;
  reference_m?.min.forEach((value, at) => {
    if (value === 0 && reference_m.max[at] === 0) reference_m.min[at] = reference_m.max[at] = NaN;
  });
  if (estimate_m && position_sd_m) {
    const spread_m = position_sd_m.max.map((sd_m) => kSpread_sd * sd_m);
    const low_m = estimate_m.min.map((value_m, at) => value_m - (spread_m[at] as number));
    const high_m = estimate_m.max.map((value_m, at) => value_m + (spread_m[at] as number));
    columns.estimate_low_m = { min: low_m, max: low_m };
    columns.estimate_high_m = { min: high_m, max: high_m };
  }
  return {
    first_s: Float64Array.from(overview.first_utc_us, (time_us) => time_us / 1e6),
    last_s: Float64Array.from(overview.last_utc_us, (time_us) => time_us / 1e6),
    columns,
  };
}
