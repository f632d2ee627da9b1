// Draws points of one channel against another on a canvas: the graticule, a dot or a line for each sample, the newest one.

import { range_splits } from '../range';
import type { XyPoints } from './xy';

export interface XyLook {
  width: number; // of the canvas, in device pixels
  height: number;
  ratio: number; // device pixels for one of CSS
  x_range: [number, number];
  y_range: [number, number];
  x_label(value: number): string;
  y_label(value: number): string;
  x_title: string;
  y_title: string;
  colours: { graticule: string; muted: string; trace: string; plot: string; font: string };
}

const kLeft_px = 58;
const kRight_px = 18;
const kTop_px = 10;
const kBottom_px = 42;
const kMostLines = 4000; // of more samples the dots alone are drawn: they lie close enough to be seen as a line

export function paint_xy(context: CanvasRenderingContext2D, points: XyPoints, look: XyLook): void {
  const { width, height, ratio, x_range, y_range, colours } = look;
  const [left, top] = [kLeft_px * ratio, kTop_px * ratio];
  const [right, bottom] = [width - kRight_px * ratio, height - kBottom_px * ratio];
  const x_of = (value: number) => left + ((value - x_range[0]) / (x_range[1] - x_range[0])) * (right - left);
  const y_of = (value: number) => bottom - ((value - y_range[0]) / (y_range[1] - y_range[0])) * (bottom - top);
  context.clearRect(0, 0, width, height);
  paint_axes(context, look, { left, right, top, bottom }, x_of, y_of);
  if (points.size === 0) return;
  context.save();
  context.beginPath();
  context.rect(left, top, right - left, bottom - top);
  context.clip();
  context.strokeStyle = context.fillStyle = colours.trace;
  if (points.size <= kMostLines) paint_line(context, points, x_of, y_of, ratio);
  else paint_dots(context, points, x_of, y_of, ratio);
  context.restore();
  const last = points.size - 1;
  context.beginPath();
  context.arc(x_of(points.x[last] as number), y_of(points.y[last] as number), 4 * ratio, 0, 7);
  context.fillStyle = colours.plot;
  context.fill();
  context.lineWidth = 2 * ratio;
  context.strokeStyle = colours.trace;
  context.stroke();
}

type Place = (value: number) => number;

function paint_line(context: CanvasRenderingContext2D, points: XyPoints, x_of: Place, y_of: Place, ratio: number) {
  const { x, y, starts, size } = points;
  context.lineWidth = ratio;
  context.lineJoin = 'round';
  context.globalAlpha = 0.55;
  context.beginPath();
  for (let at = 0; at < size; ++at) {
    const [here_x, here_y] = [x_of(x[at] as number), y_of(y[at] as number)];
    if (starts[at]) context.moveTo(here_x, here_y);
    else context.lineTo(here_x, here_y);
  }
  context.stroke();
  context.globalAlpha = 1;
  paint_dots(context, points, x_of, y_of, ratio);
}

// One pixel for each sample, each pixel once.
function paint_dots(context: CanvasRenderingContext2D, points: XyPoints, x_of: Place, y_of: Place, ratio: number) {
  const { x, y, size } = points;
  const dot = Math.max(1, Math.round(1.5 * ratio));
  const seen = new Set<number>();
  for (let at = size - 1; at >= 0; --at) {
    const [here_x, here_y] = [Math.round(x_of(x[at] as number)), Math.round(y_of(y[at] as number))];
    const key = here_x * 65_536 + here_y;
    if (seen.has(key)) continue;
    seen.add(key);
    context.fillRect(here_x - (dot >> 1), here_y - (dot >> 1), dot, dot);
  }
}

interface Edges {
  left: number;
  right: number;
  top: number;
  bottom: number;
}

function paint_axes(
  context: CanvasRenderingContext2D,
  look: XyLook,
  { left, right, top, bottom }: Edges,
  x_of: Place,
  y_of: Place,
): void {
  const { ratio, colours, x_range, y_range } = look;
  context.lineWidth = ratio;
  context.strokeStyle = colours.graticule;
  context.fillStyle = colours.muted;
  context.font = `${11 * ratio}px ${colours.font}`;
  context.textBaseline = 'middle';
  context.textAlign = 'right';
  for (const value of range_splits(y_range)) {
    const y = Math.round(y_of(value)) + 0.5;
    line(context, left, y, right, y);
    context.fillText(look.y_label(value), left - 8 * ratio, y);
  }
  context.textAlign = 'center';
  context.textBaseline = 'top';
  for (const value of range_splits(x_range)) {
    const x = Math.round(x_of(value)) + 0.5;
    line(context, x, top, x, bottom);
    context.fillText(look.x_label(value), x, bottom + 6 * ratio);
  }
  context.textAlign = 'right';
  context.fillText(look.x_title, right, bottom + 23 * ratio);
  context.textAlign = 'left';
  context.textBaseline = 'top';
  context.fillText(look.y_title, left + 6 * ratio, top + 2 * ratio);
}

function line(context: CanvasRenderingContext2D, from_x: number, from_y: number, to_x: number, to_y: number): void {
  context.beginPath();
  context.moveTo(from_x, from_y);
  context.lineTo(to_x, to_y);
  context.stroke();
}
