// What was predicted of a robot's position in experiments, on the time axis of its plots.
//
// A prediction counts from the beginning of the first step of its run. Of a run that has ended the station knows when that
// was on the robot's clock; of the one that goes on it reports how far it is. Where neither is known nothing is drawn.

import type { Backdrop } from '../chart';
import { kSpread_sd } from '../format';
import type { Plane } from './trace_painter';
import type { Stretch } from './time_axis';

export interface Predicted {
  key: string; // of the experiment and its run
  zero_s: number; // UTC of the beginning of its first step
  t_s: number[];
  position_m: (number | null)[];
  position_sd_m: (number | null)[] | null; // null: how sure it is, is not known
}

export const end_of = ({ zero_s, t_s }: Predicted) => zero_s + (t_s.at(-1) ?? 0);

// The value at a time, of the point before it: nothing is computed between two points. null: there is none.
export function predicted_at(
  predictions: readonly Predicted[],
  at_s: number,
): { m: number; sd_m: number | null } | null {
  for (const { zero_s, t_s, position_m, position_sd_m } of predictions) {
    const since_s = at_s - zero_s;
    if (since_s < 0 || since_s > (t_s.at(-1) ?? -1)) continue;
    let [low, high] = [0, t_s.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if ((t_s[middle] as number) <= since_s) low = middle;
      else high = middle - 1;
    }
    const m = position_m[low] ?? null;
    if (m !== null) return { m, sd_m: position_sd_m?.[low] ?? null };
  }
  return null;
}

export class PredictedBackdrop implements Backdrop {
  predictions: readonly Predicted[] = [];
  colours = { line: '', band: '' };

  within({ from_s, to_s }: Stretch): Predicted[] {
    return this.predictions.filter((each) => each.zero_s < to_s && end_of(each) > from_s);
  }

  range(view: Stretch): [number, number] | null {
    let [low, high] = [Infinity, -Infinity];
    for (const { zero_s, t_s, position_m } of this.within(view)) {
      t_s.forEach((time_s, at) => {
        const value = position_m[at] ?? null;
        if (value === null || zero_s + time_s < view.from_s || zero_s + time_s > view.to_s) return;
        low = Math.min(low, value);
        high = Math.max(high, value);
      });
    }
    return low <= high ? [low, high] : null;
  }

  paint(context: CanvasRenderingContext2D, plane: Plane, view: Stretch): void {
    for (const each of this.within(view)) {
      context.save();
      this.paint_band(context, plane, each);
      context.strokeStyle = this.colours.line;
      context.lineWidth = 1.3 * plane.ratio;
      context.setLineDash([2, 3].map((length) => length * plane.ratio));
      context.beginPath();
      stroke(context, plane, each, each.position_m);
      context.stroke();
      context.restore();
    }
  }

  private paint_band(context: CanvasRenderingContext2D, { x_of, y_of }: Plane, each: Predicted): void {
    const { zero_s, t_s, position_m, position_sd_m } = each;
    if (!position_sd_m) return;
    const edge = (at: number, sign: number) => {
      const [m, sd_m] = [position_m[at] ?? null, position_sd_m[at] ?? null];
      return m === null || sd_m === null ? null : m + sign * kSpread_sd * sd_m;
    };
    context.fillStyle = this.colours.band;
    for (let first = 0; first < t_s.length; ++first) {
      if (edge(first, 1) === null) continue;
      let end = first;
      while (end < t_s.length && edge(end, 1) !== null) ++end;
      context.beginPath();
      for (let at = first; at < end; ++at) context.lineTo(x_of(zero_s + (t_s[at] as number)), y_of(edge(at, 1) ?? 0));
      for (let at = end - 1; at >= first; --at)
        context.lineTo(x_of(zero_s + (t_s[at] as number)), y_of(edge(at, -1) ?? 0));
      context.fill();
      first = end;
    }
  }
}

function stroke(
  context: CanvasRenderingContext2D,
  { x_of, y_of }: Plane,
  { zero_s, t_s }: Predicted,
  values: (number | null)[],
): void {
  let is_down = false;
  values.forEach((value, at) => {
    if (value === null) return void (is_down = false);
    const [x, y] = [x_of(zero_s + (t_s[at] as number)), y_of(value)];
    if (is_down) context.lineTo(x, y);
    else context.moveTo(x, y);
    is_down = true;
  });
}
