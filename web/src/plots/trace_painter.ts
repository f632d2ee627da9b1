// Draws one column of a TraceWindow, and the band between two.
//
// A trace that hardly moves is a smooth line. Where it goes up and down within nearly each bin it is drawn as a column of
// pixels for each bin: without a graphics card a browser takes a hundred times as long for the same as a line.

import type { Box } from '../chart';
import type { TraceWindow } from './trace_window';

export interface Plane {
  box: Box; // in device pixels
  x_of(time_s: number): number;
  y_of(value: number): number;
  ratio: number; // device pixels for one of CSS
}

export interface Pen {
  colour: string;
  width_px: number;
  dash_px?: number[];
}

const kDense = 3; // travel up and down, in widths of the plot, from which a line is no longer worth its time

export function paint_trace(
  context: CanvasRenderingContext2D,
  window: TraceWindow,
  at: number,
  plane: Plane,
  pen: Pen,
): void {
  const values = window.values[at];
  if (!values || window.size === 0) return;
  const gaps = window.gaps_s[at] ?? [];
  const is_dense = window.bin_s > 0 && travel_px(window, values, plane) > kDense * plane.box.width;
  context.save();
  if (is_dense) paint_columns(context, window, values, gaps, plane, pen);
  else paint_line(context, window, values, gaps, plane, pen);
  context.restore();
}

function travel_px({ size }: TraceWindow, values: Float64Array, { y_of }: Plane): number {
  const per_unit = Math.abs(y_of(1) - y_of(0));
  let travel = 0;
  for (let row = 1; row < size; ++row) {
    const step = Math.abs((values[row] as number) - (values[row - 1] as number));
    if (step > 0) travel += step; // not NaN
  }
  return travel * per_unit;
}

function paint_line(
  context: CanvasRenderingContext2D,
  { time_s, size }: TraceWindow,
  values: Float64Array,
  gaps: [number, number][],
  { x_of, y_of, ratio }: Plane,
  pen: Pen,
): void {
  context.strokeStyle = pen.colour;
  context.lineWidth = pen.width_px * ratio;
  context.lineJoin = 'round';
  if (pen.dash_px) context.setLineDash(pen.dash_px.map((length) => length * ratio));
  context.beginPath();
  let gap = 0;
  let is_down = false;
  for (let row = 0; row < size; ++row) {
    const at_s = time_s[row] as number;
    const value = values[row] as number;
    while (gap < gaps.length && (gaps[gap] as [number, number])[1] <= at_s) {
      is_down = false;
      gap += 1;
    }
    if (!(value === value)) {
      is_down = false;
      continue;
    }
    const [x, y] = [x_of(at_s), y_of(value)];
    if (!is_down && is_alone(values, row, gaps[gap], time_s)) context.rect(x - ratio / 2, y - ratio / 2, ratio, ratio);
    if (is_down) context.lineTo(x, y);
    else context.moveTo(x, y);
    is_down = true;
  }
  context.stroke();
}

// A sample between two gaps has no line to be seen by.
function is_alone(values: Float64Array, row: number, gap: [number, number] | undefined, time_s: Float64Array): boolean {
  const next = values[row + 1] ?? NaN;
  return next !== next || (gap !== undefined && gap[0] <= (time_s[row] as number));
}

function paint_columns(
  context: CanvasRenderingContext2D,
  { time_s, size, bin_s }: TraceWindow,
  values: Float64Array,
  gaps: [number, number][],
  { x_of, y_of, ratio }: Plane,
  pen: Pen,
): void {
  context.fillStyle = pen.colour;
  const thick = Math.max(1, Math.round(pen.width_px * ratio));
  let gap = 0;
  let [low, high] = [Infinity, -Infinity]; // of the open column, in pixels
  let x = NaN;
  let previous = NaN; // where the trace was last, so that columns join
  const close = () => {
    if (high >= low) context.fillRect(x, Math.round(low), thick, Math.max(thick, Math.round(high - low)));
    [low, high] = [Infinity, -Infinity];
  };
  for (let row = 0; row < size; ++row) {
    const at_s = time_s[row] as number;
    const value = values[row] as number;
    while (gap < gaps.length && (gaps[gap] as [number, number])[1] <= at_s) {
      previous = NaN;
      gap += 1;
    }
    const here = Math.round(x_of(Math.floor(at_s / bin_s) * bin_s));
    if (here !== x) {
      close();
      x = here;
    }
    if (!(value === value)) {
      previous = NaN;
      continue;
    }
    const y = y_of(value);
    low = Math.min(low, y, previous === previous ? previous : y);
    high = Math.max(high, y, previous === previous ? previous : y);
    previous = y;
  }
  close();
}

// The surface between two columns; the lower's least and the upper's largest value of each bin.
export function paint_band(
  context: CanvasRenderingContext2D,
  window: TraceWindow,
  low_at: number,
  high_at: number,
  plane: Plane,
  colour: string,
): void {
  const [low, high] = [window.values[low_at], window.values[high_at]];
  if (!low || !high) return;
  const { time_s, size, gap_rows } = window;
  context.fillStyle = colour;
  if (window.bin_s > 0) return paint_band_columns(context, window, low, high, plane);
  for (const [first, end] of stretches(low, size, gap_rows)) {
    context.beginPath();
    for (let row = first; row < end; ++row)
      context.lineTo(plane.x_of(time_s[row] as number), plane.y_of(high[row] as number));
    for (let row = end - 1; row >= first; --row)
      context.lineTo(plane.x_of(time_s[row] as number), plane.y_of(low[row] as number));
    context.fill();
  }
}

function paint_band_columns(
  context: CanvasRenderingContext2D,
  { time_s, size, bin_s, gap_rows }: TraceWindow,
  low: Float64Array,
  high: Float64Array,
  { x_of, y_of }: Plane,
): void {
  const is_break = new Set(gap_rows);
  let [x, bottom, top] = [NaN, NaN, NaN];
  const close = (to_x: number) => {
    if (bottom === bottom)
      context.fillRect(x, Math.round(top), Math.max(1, to_x - x), Math.round(bottom) - Math.round(top));
  };
  for (let row = 0; row < size; ++row) {
    const here = Math.round(x_of(Math.floor((time_s[row] as number) / bin_s) * bin_s));
    if (here !== x) {
      close(is_break.has(row) ? x + 1 : here);
      [x, bottom, top] = [here, NaN, NaN];
    }
    const [from, to] = [y_of(low[row] as number), y_of(high[row] as number)];
    if (!(from >= to)) continue;
    bottom = bottom === bottom ? Math.max(bottom, from) : from;
    top = top === top ? Math.min(top, to) : to;
  }
  close(x + 1);
}

// Rows that follow one another with a value and without a gap, as [first, end).
function* stretches(values: Float64Array, size: number, gap_rows: readonly number[]): Generator<[number, number]> {
  const is_break = new Set(gap_rows);
  let first = -1;
  for (let row = 0; row < size; ++row) {
    const missing = Number.isNaN(values[row]);
    if (first >= 0 && (missing || is_break.has(row))) {
      yield [first, row];
      first = -1;
    }
    if (!missing && first < 0) first = row;
  }
  if (first >= 0) yield [first, size];
}
