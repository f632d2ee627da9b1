// The samples of a stretch of time as points of one channel against another.
//
// A point is a sample: what the station gives only as least and largest values has no point. Where samples are missing,
// or one of both has no value, points are not joined.

import type { AnyColumn, SampleRows } from '../samples';
import type { Past, Tile } from './past';
import type { Stretch } from './time_axis';

export const kMostPoints = 65_536; // of more the newest

export interface XySource {
  rows: SampleRows;
  shift_s: number;
  past: Pick<Past, 'visit'> | null;
}

export class XyPoints {
  x = new Float64Array(1024);
  y = new Float64Array(1024);
  starts = new Uint8Array(1024); // 1: not joined to the point before
  size = 0;
  x_range: [number, number] = [Infinity, -Infinity];
  y_range: [number, number] = [Infinity, -Infinity];
  from_s = NaN; // of the first point
  most_sd_m = 0; // the largest of the position; NaN: of some point it is not known
  is_cut = false; // there were more than kMostPoints
  private previous_s = -Infinity;
  private is_broken = true;

  fill({ rows, shift_s, past }: XySource, { from_s, to_s }: Stretch, x_name: AnyColumn, y_name: AnyColumn): void {
    this.clear();
    const { gap_s, capacity, time_s } = rows;
    const [x, y, sd_m] = [rows.column(x_name), rows.column(y_name), rows.column('position_sd_m')];
    const least_s = to_s - kMostPoints * rows.period_s;
    this.is_cut = least_s > from_s;
    const first_s = Math.max(from_s, least_s);
    let known_to_s = first_s;
    const look_up = (start_s: number, end_s: number) => {
      if (!past || end_s - start_s <= gap_s) return;
      past.visit(start_s, end_s, 0, (tile, at) => this.put_point(tile, at, start_s, end_s, x_name, y_name, gap_s));
    };
    for (let index = rows.first_index; index < rows.next_index; ++index) {
      if (!rows.holds(index)) continue;
      const slot = index % capacity;
      const at_s = (time_s[slot] as number) + shift_s;
      if (at_s < first_s || at_s <= this.previous_s) continue;
      if (at_s > to_s) break;
      look_up(known_to_s, at_s);
      this.put(at_s, x[slot] as number, y[slot] as number, sd_m[slot] ?? NaN, gap_s);
      known_to_s = at_s;
    }
    look_up(known_to_s, to_s);
  }

  private clear(): void {
    this.size = 0;
    this.x_range = [Infinity, -Infinity];
    this.y_range = [Infinity, -Infinity];
    this.previous_s = -Infinity;
    this.is_broken = true;
    this.from_s = NaN;
    this.most_sd_m = 0;
  }

  private put_point(
    tile: Tile,
    at: number,
    start_s: number,
    end_s: number,
    x_name: AnyColumn,
    y_name: AnyColumn,
    gap_s: number,
  ): void {
    const time_s = tile.first_s[at] as number;
    if (tile.first_s !== tile.last_s || time_s < start_s || time_s >= end_s || time_s <= this.previous_s) return;
    const of = (name: AnyColumn) => tile.columns[name]?.max[at] ?? NaN;
    this.put(time_s, of(x_name), of(y_name), of('position_sd_m'), gap_s);
  }

  private put(at_s: number, x: number, y: number, sd_m: number, gap_s: number): void {
    if (at_s - this.previous_s > gap_s) this.is_broken = true;
    this.previous_s = at_s;
    if (!Number.isFinite(x) || !Number.isFinite(y)) return void (this.is_broken = true);
    if (this.size === this.x.length) this.grow();
    if (this.size === 0) this.from_s = at_s;
    this.x[this.size] = x;
    this.y[this.size] = y;
    this.starts[this.size] = this.is_broken ? 1 : 0;
    this.is_broken = false;
    this.size += 1;
    this.most_sd_m = Math.max(this.most_sd_m, sd_m);
    this.x_range = [Math.min(this.x_range[0], x), Math.max(this.x_range[1], x)];
    this.y_range = [Math.min(this.y_range[0], y), Math.max(this.y_range[1], y)];
  }

  private grow(): void {
    const longer = <T extends Float64Array | Uint8Array>(values: T, next: T): T => (next.set(values), next);
    this.x = longer(this.x, new Float64Array(2 * this.x.length));
    this.y = longer(this.y, new Float64Array(2 * this.y.length));
    this.starts = longer(this.starts, new Uint8Array(2 * this.starts.length));
  }
}
