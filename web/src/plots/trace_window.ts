// What the plots draw: the columns of one stretch of time, from the samples that the page has received and, where it has
// none, from what the station has recorded.
//
// Where there are more samples than pixels they go into bins, and each bin gives the least and the largest value of each
// column in their order, so that no peak is left out. Bins lie at fixed times: a plot that runs does not shimmer. A
// column has one gap for each stretch in which it has no value.

import type { AnyColumn, SampleRows } from '../samples';
import { Blocks, kBlock } from './blocks';
import type { Past, Tile } from './past';
import type { Stretch } from './time_axis';

const kRawSamplesPerBin = 2; // fewer are drawn as they are
const kLeastHole_s = 0.5; // a shorter hole between received samples is not looked up

export interface Source {
  ring: SampleRows;
  shift_s: number; // UTC = time of the ring + this
  past: Pick<Past, 'visit'> | null;
}

export class TraceWindow {
  readonly time_s: Float64Array;
  readonly values: Float64Array[];
  readonly gaps_s: [number, number][][]; // of each column
  readonly holes_s: [number, number][] = []; // in which no sample is known at all
  readonly gap_rows: number[] = []; // the first row after each hole
  readonly low: Float64Array; // of each column
  readonly high: Float64Array;
  size = 0;
  bin_s = 0;
  private readonly bin_row: Int32Array; // the first row of the bin of each row
  private readonly in_hole: boolean[];
  private readonly min: Float64Array; // of the open bin
  private readonly max: Float64Array;
  private readonly rises: boolean[]; // the least value came first
  private readonly seen: boolean[];
  private bin = NaN; // number of the open bin; NaN: none
  private bin_first_s = 0;
  private bin_last_s = 0;
  private rows_in_bin = 0;
  private previous_s = -Infinity; // of the latest sample that was put
  private gap_s = 0.015;
  private readonly blocks: Blocks;

  constructor(
    private readonly capacity: number,
    readonly names: readonly AnyColumn[],
  ) {
    this.blocks = new Blocks(names);
    this.time_s = new Float64Array(capacity);
    this.bin_row = new Int32Array(capacity);
    this.values = names.map(() => new Float64Array(capacity));
    this.gaps_s = names.map(() => []);
    [this.low, this.high, this.min, this.max] = [0, 1, 2, 3].map(() => new Float64Array(names.length)) as [
      Float64Array,
      Float64Array,
      Float64Array,
      Float64Array,
    ];
    this.in_hole = names.map(() => false);
    this.rises = names.map(() => true);
    this.seen = names.map(() => false);
  }

  // `bins`: how many pixels there are for it.
  fill({ ring, shift_s, past }: Source, { from_s, to_s }: Stretch, bins: number): void {
    this.clear();
    this.gap_s = ring.gap_s;
    const span_s = to_s - from_s;
    this.bin_s = span_s / bins > kRawSamplesPerBin * ring.period_s ? span_s / bins : 0;
    const columns = this.names.map((name) => ring.column(name));
    const look_up = (start_s: number, end_s: number) => {
      if (past && end_s - start_s > kLeastHole_s) {
        past.visit(start_s, end_s, span_s / bins, (tile, at) => this.put_point(tile, at, start_s, end_s));
      }
    };
    const [first_s, last_s] = [from_s - this.gap_s - this.bin_s, to_s + this.gap_s + this.bin_s];
    let known_to_s = first_s;
    let newest_s = -Infinity;
    const by_blocks = this.bin_s >= 2 * kBlock * ring.period_s;
    for (let index = ring.first_index; index < ring.next_index; ++index) {
      if (!ring.holds(index)) continue;
      const slot = index % ring.capacity;
      const time_s = (ring.time_s[slot] as number) + shift_s;
      if (time_s <= newest_s) continue; // a boot that overlaps the one before
      newest_s = time_s;
      if (time_s < first_s) {
        known_to_s = Math.max(known_to_s, time_s);
        continue;
      }
      if (time_s > last_s) break;
      if (time_s - known_to_s > kLeastHole_s) look_up(known_to_s, time_s);
      const block = by_blocks && index % kBlock === 0 ? this.blocks.slot_of(ring, index) : -1;
      if (block < 0) {
        this.put(time_s, columns, columns, slot);
        known_to_s = time_s;
        continue;
      }
      index += kBlock - 1;
      known_to_s = newest_s = (ring.time_s[slot + kBlock - 1] as number) + shift_s;
      this.put(time_s, this.blocks.min, this.blocks.max, block, known_to_s);
    }
    if (known_to_s < to_s) look_up(known_to_s, to_s);
    this.flush();
    if (this.size > 0 && this.previous_s < to_s - 1) this.holes_s.push([this.previous_s, to_s]);
    if (this.size === 0) this.holes_s.push([from_s, to_s]);
  }

  // The row nearest to a time; null when there is no sample near it.
  row_at(at_s: number): number | null {
    let [low, high] = [0, this.size - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.time_s[middle] as number) < at_s) low = middle + 1;
      else high = middle;
    }
    const before = low > 0 && at_s - (this.time_s[low - 1] as number) < Math.abs((this.time_s[low] as number) - at_s);
    const row = before ? low - 1 : low;
    const reach_s = Math.max(2 * this.bin_s, this.gap_s);
    return this.size > 0 && Math.abs((this.time_s[row] as number) - at_s) <= reach_s ? row : null;
  }

  // The value of a column in a row; null where it has none.
  value_at(column: AnyColumn, row: number): number | null {
    const at = this.names.indexOf(column);
    if (at < 0) return null;
    const value = this.values[at]?.[row] ?? NaN;
    return Number.isFinite(value) ? value : null;
  }

  // How far the band of an estimate reaches from it in the bin of a row, on the side on which it reaches farther. The rows
  // of a bin have the extremes of each column: what stands in one row need not be of one sample.
  spread_at(row: number): number | null {
    const first = this.bin_row[row] as number;
    const last = first + 1 < this.size && this.bin_row[first + 1] === first ? first + 1 : first;
    const ends = (column: AnyColumn) => {
      const [one, other] = [this.value_at(column, first), this.value_at(column, last)];
      return one === null || other === null ? null : [Math.min(one, other), Math.max(one, other)];
    };
    const [value, low, high] = [ends('estimate_m'), ends('estimate_low_m'), ends('estimate_high_m')];
    if (!value || !low || !high) return null;
    return Math.max((value[0] as number) - (low[0] as number), (high[1] as number) - (value[1] as number));
  }

  // The farthest that the band of an estimate reaches from it in all that is drawn.
  largest_spread(): number {
    let largest = 0;
    for (let row = 0; row < this.size; ++row) {
      if (this.bin_row[row] === row) largest = Math.max(largest, this.spread_at(row) ?? 0);
    }
    return largest;
  }

  private clear(): void {
    this.size = 0;
    this.bin = NaN;
    this.rows_in_bin = 0;
    this.previous_s = -Infinity;
    this.low.fill(Infinity);
    this.high.fill(-Infinity);
    this.in_hole.fill(false);
    this.holes_s.length = 0;
    this.gap_rows.length = 0;
    for (const gaps of this.gaps_s) gaps.length = 0;
  }

  private readonly point_min: Float64Array[] = [];
  private readonly point_max: Float64Array[] = [];

  private put_point(tile: Tile, at: number, start_s: number, end_s: number): void {
    const first_s = tile.first_s[at] as number;
    const last_s = tile.last_s[at] as number;
    // Its samples are received ones as well at the edges: those are drawn.
    if (first_s < start_s || last_s > end_s || first_s <= this.previous_s) return;
    this.names.forEach((name, c) => {
      this.point_min[c] = tile.columns[name]?.min ?? kNothing;
      this.point_max[c] = tile.columns[name]?.max ?? kNothing;
    });
    this.put(first_s, this.point_min, this.point_max, at, last_s);
  }

  private put(first_s: number, mins: Float64Array[], maxs: Float64Array[], slot: number, last_s = first_s): void {
    const passed_s = first_s - this.previous_s;
    const bin = this.bin_s > 0 ? Math.floor(first_s / this.bin_s) : NaN;
    if (this.size + this.rows_in_bin > 0 && passed_s > this.gap_s && passed_s > this.bin_s) {
      this.flush();
      this.break_at(this.previous_s, first_s);
    } else if (!(bin === this.bin)) {
      this.flush();
    }
    if (this.rows_in_bin === 0) {
      this.bin = bin;
      this.bin_first_s = first_s;
      this.seen.fill(false);
    }
    this.rows_in_bin += 1;
    this.bin_last_s = last_s;
    this.previous_s = last_s;
    const { min, max, seen, rises } = this;
    for (let c = 0; c < min.length; ++c) {
      const least = (mins[c] as Float64Array)[slot] as number;
      const most = (maxs[c] as Float64Array)[slot] as number;
      if (!(least <= most)) continue; // it has no value here
      if (!seen[c]) {
        seen[c] = true;
        rises[c] = this.rises_to(c, least, most);
        min[c] = least;
        max[c] = most;
        continue;
      }
      if (least < (min[c] as number)) {
        min[c] = least;
        rises[c] = false;
      }
      if (most > (max[c] as number)) {
        max[c] = most;
        rises[c] = true;
      }
    }
    if (this.bin_s === 0) this.flush();
  }

  // Of a point of which only the extremes are known: as the trace goes from the bin before to it. Their middles decide and
  // not where the trace ended, or one order would turn all that follow, and a plot that runs would shimmer.
  private rises_to(c: number, least: number, most: number): boolean {
    const values = this.values[c] as Float64Array;
    const last = this.size - 1;
    if (last < 0) return true;
    const before = (values[this.bin_row[last] as number] as number) + (values[last] as number);
    return !(least + most < before); // also where nothing is known before
  }

  private break_at(from_s: number, to_s: number): void {
    this.holes_s.push([from_s, to_s]);
    this.gap_rows.push(this.size);
    for (let c = 0; c < this.names.length; ++c) {
      const gaps = this.gaps_s[c] as [number, number][];
      const last = gaps[gaps.length - 1];
      if (this.in_hole[c] && last) last[1] = to_s;
      else gaps.push([from_s, to_s]);
    }
  }

  // Lays down the open bin as one row, or as two where it has a first and a last time.
  private flush(): void {
    if (this.rows_in_bin === 0) return;
    this.rows_in_bin = 0;
    const is_one = this.bin_last_s <= this.bin_first_s;
    this.bin = NaN;
    if (this.size + 2 > this.capacity) return;
    const row = this.size;
    const rows = is_one ? 1 : 2;
    this.time_s[row] = this.bin_first_s;
    if (!is_one) this.time_s[row + 1] = this.bin_last_s;
    this.bin_row.fill(row, row, row + rows);
    this.size += rows;
    for (let c = 0; c < this.names.length; ++c) {
      const values = this.values[c] as Float64Array;
      const gaps = this.gaps_s[c] as [number, number][];
      const last = gaps[gaps.length - 1];
      const missing = !this.seen[c];
      if (this.in_hole[c] && last) last[1] = missing ? (this.time_s[this.size - 1] as number) : this.bin_first_s;
      else if (missing) gaps.push([this.bin_first_s, this.time_s[this.size - 1] as number]);
      this.in_hole[c] = missing;
      if (missing) {
        values.fill(NaN, row, this.size);
        continue;
      }
      const [least, most] = [this.min[c] as number, this.max[c] as number];
      values[row] = this.rises[c] ? least : most;
      if (!is_one) values[row + 1] = this.rises[c] ? most : least;
      else values[row] = most;
      if (least < (this.low[c] as number)) this.low[c] = least;
      if (most > (this.high[c] as number)) this.high[c] = most;
    }
  }
}

const kNothing = new Float64Array(0);
