// Traces that are computed from recorded ones: the difference of two, a first-order low-pass filter, a derivative.
//
//   difference   y = a − b
//   low pass     y_i = y_(i−1) + (1 − exp(−Δt / T)) · (x_i − y_(i−1)),   y = x at the first sample after a gap
//   derivative   y_i = (x_i − x_(i−n)) / (t_i − t_(i−n)),   n samples are the window; none within a window after a gap
//
// They are computed from samples. Where the station gives only the least and the largest value of many there are none.

import type { AnyColumn, Column, DerivedColumn, SampleRows } from '../samples';

export type DerivedSpec =
  | { kind: 'difference'; of: Column; less: Column }
  | { kind: 'low_pass'; of: Column; time_constant_s: number }
  | { kind: 'derivative'; of: Column; window_s: number };

export const kLeastTime_s = 0.02;
export const kLongestTime_s = 5;
const kSettled = 8; // time constants after which nothing is seen of where a filter began

// As people read it: "d/dt position_m (0.2 s)".
export function name_of(spec: DerivedSpec): string {
  if (spec.kind === 'difference') return `${spec.of} \u2212 ${spec.less}`;
  if (spec.kind === 'low_pass') return `low-pass ${spec.of} (${spec.time_constant_s} s)`;
  return `d/dt ${spec.of} (${spec.window_s} s)`;
}

export const column_of = (spec: DerivedSpec): DerivedColumn => `=${name_of(spec)}`;

// What must be known before a stretch so that it is right from its first sample on.
export function lead_s(specs: readonly DerivedSpec[]): number {
  const needed = specs.map((spec) =>
    spec.kind === 'low_pass' ? kSettled * spec.time_constant_s : spec.kind === 'derivative' ? spec.window_s : 0,
  );
  return Math.max(0, ...needed);
}

// What a browser has kept, or nothing where it is no derived trace.
export function parse_spec(kept: unknown, columns: readonly Column[]): DerivedSpec | null {
  if (typeof kept !== 'object' || kept === null) return null;
  const { kind, of, less, time_constant_s, window_s } = kept as Record<string, unknown>;
  const is_column = (name: unknown): name is Column => columns.includes(name as Column);
  const is_time = (value: unknown): value is number =>
    typeof value === 'number' && value >= kLeastTime_s && value <= kLongestTime_s;
  if (!is_column(of)) return null;
  if (kind === 'difference' && is_column(less)) return { kind, of, less };
  if (kind === 'low_pass' && is_time(time_constant_s)) return { kind, of, time_constant_s };
  if (kind === 'derivative' && is_time(window_s)) return { kind, of, window_s };
  return null;
}

// Rows with computed columns beside the recorded ones. update() computes what has come or changed since.
export class DerivedRows implements SampleRows {
  epoch = 0;
  rewritten_from = Infinity;
  private columns = new Map<AnyColumn, Float64Array>();
  private of_capacity = 0;
  private computed_to = 0;
  private readonly specs: readonly { name: DerivedColumn; spec: DerivedSpec }[];

  constructor(
    private readonly rows: SampleRows,
    specs: readonly DerivedSpec[],
  ) {
    this.specs = specs.map((spec) => ({ name: column_of(spec), spec }));
  }

  get capacity(): number {
    return this.rows.capacity;
  }
  get period_s(): number {
    return this.rows.period_s;
  }
  get gap_s(): number {
    return this.rows.gap_s;
  }
  get time_s(): Float64Array {
    return this.rows.time_s;
  }
  get first_index(): number {
    return this.rows.first_index;
  }
  get next_index(): number {
    return this.rows.next_index;
  }
  holds(index: number): boolean {
    return this.rows.holds(index);
  }
  column(name: AnyColumn): Float64Array {
    return this.columns.get(name) ?? this.rows.column(name);
  }

  update(): void {
    const { rows } = this;
    if (this.specs.length === 0) return;
    if (this.of_capacity !== rows.capacity) {
      this.of_capacity = rows.capacity;
      this.computed_to = rows.first_index;
      this.columns = new Map(this.specs.map(({ name }) => [name, new Float64Array(rows.capacity)]));
      this.epoch += 1;
    } else if (rows.rewritten_from < this.computed_to) {
      this.computed_to = rows.rewritten_from;
      this.epoch += 1;
    }
    rows.rewritten_from = Infinity;
    const from = Math.max(this.computed_to, rows.first_index);
    for (const { name, spec } of this.specs) compute(spec, rows, this.columns.get(name) as Float64Array, from);
    this.computed_to = Math.max(from, rows.next_index);
  }
}

// From a row on to the newest; what stands before it in `into` is right already.
function compute(spec: DerivedSpec, rows: SampleRows, into: Float64Array, from: number): void {
  if (spec.kind === 'difference') difference(rows, into, from, rows.column(spec.of), rows.column(spec.less));
  else if (spec.kind === 'low_pass') low_pass(rows, into, from, rows.column(spec.of), spec.time_constant_s);
  else derivative(rows, into, from, rows.column(spec.of), spec.window_s);
}

function difference(rows: SampleRows, into: Float64Array, from: number, a: Float64Array, b: Float64Array): void {
  for (let index = from; index < rows.next_index; ++index) {
    const slot = index % rows.capacity;
    if (rows.holds(index)) into[slot] = (a[slot] as number) - (b[slot] as number);
  }
}

function low_pass(rows: SampleRows, into: Float64Array, from: number, x: Float64Array, constant_s: number): void {
  const { time_s, gap_s, capacity } = rows;
  let before = row_before(rows, from);
  for (let index = from; index < rows.next_index; ++index) {
    if (!rows.holds(index)) continue;
    const slot = index % capacity;
    const value = x[slot] as number;
    const passed_s = before < 0 ? Infinity : (time_s[slot] as number) - (time_s[before] as number);
    const y = before < 0 ? NaN : (into[before] as number);
    const goes_on = passed_s > 0 && passed_s <= gap_s && y === y; // not NaN
    into[slot] = goes_on ? y + (1 - Math.exp(-passed_s / constant_s)) * (value - y) : value;
    before = slot;
  }
}

function derivative(rows: SampleRows, into: Float64Array, from: number, x: Float64Array, window_s: number): void {
  const { time_s, capacity, gap_s, period_s } = rows;
  const [least_s, most_s] = [window_s - period_s / 2, window_s + gap_s];
  const begin = Math.max(rows.first_index, from - kSlack * Math.ceil(window_s / period_s) - kSpare);
  let first = begin; // of the window
  let unbroken_from = begin; // after the latest gap
  let before_s = NaN;
  for (let index = begin; index < rows.next_index; ++index) {
    if (!rows.holds(index)) continue;
    const slot = index % capacity;
    const at_s = time_s[slot] as number;
    if (!(at_s - before_s <= gap_s)) first = unbroken_from = index;
    before_s = at_s;
    if (index < from) continue;
    for (let next = first + 1; next < index; ++next) {
      if (!rows.holds(next)) continue;
      if (at_s - (time_s[next % capacity] as number) < least_s) break;
      first = next;
    }
    const start = first % capacity;
    const passed_s = at_s - (time_s[start] as number);
    const is_whole = first >= unbroken_from && passed_s >= least_s && passed_s <= most_s;
    into[slot] = is_whole ? ((x[slot] as number) - (x[start] as number)) / passed_s : NaN;
  }
}

const kSlack = 2; // of the rows that a window has: some hold nothing
const kSpare = 64;

// The slot of the row next before an index, -1 where there is none near it.
function row_before(rows: SampleRows, index: number): number {
  for (let at = index - 1; at >= rows.first_index && at > index - 64; --at)
    if (rows.holds(at)) return at % rows.capacity;
  return -1;
}

// Rows of one array each, as a page of the recording has them.
export class ListRows implements SampleRows {
  readonly epoch = 0;
  rewritten_from = Infinity;
  readonly first_index = 0;

  constructor(
    readonly time_s: Float64Array,
    private readonly columns: Partial<Record<AnyColumn, Float64Array>>,
    readonly period_s: number,
    readonly gap_s: number,
  ) {}

  get capacity(): number {
    return Math.max(1, this.time_s.length);
  }
  get next_index(): number {
    return this.time_s.length;
  }
  holds(index: number): boolean {
    return index >= 0 && index < this.time_s.length;
  }
  column(name: AnyColumn): Float64Array {
    return this.columns[name] ?? new Float64Array(this.time_s.length).fill(NaN);
  }
}
