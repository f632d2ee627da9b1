// What the robot has believed of its position since a run began, with its "±", at the times of the run's prediction.

import type { Overview } from '../../api';
import { kSpread_sd } from '../../format';
import type { Robot } from '../../robot';
import type { SampleRing } from '../../samples';

export interface Measured {
  t_s: number[];
  position_m: number[]; // of an estimate
  low_m: number[]; // two standard deviations below and above it; NaN: not known
  high_m: number[];
  until_s: number; // where its run was interrupted first; Infinity: it was not
}

const kPaused_s = 1; // the beginning that is reported moves so far only by a pause

// Now, in the times of a robot's ring. By the robot's clock, where the station knows it: the ring is laid on page time by when
// its first batch came, which may be some tenths of a second late.
export const ring_now_s = (robot: Robot, utc_minus_steady_us: number | null, utc_s: number, page_now_s: number) =>
  utc_s - robot.utc_shift_s(utc_minus_steady_us, utc_s - page_now_s);

// When the run that goes on began: of what is reported of it, the report that was the least late says best. The station gives
// the robot's time of a step only when the run has ended.
export class RunBegin {
  private key = '';
  private began_s = Infinity;
  private elapsed_s = 0;

  // `key`: of the experiment and its run.
  of(key: string, elapsed_s: number, now_s: number): number {
    if (key !== this.key) [this.key, this.began_s, this.elapsed_s] = [key, Infinity, 0];
    const said_s = now_s - elapsed_s;
    const goes_on = elapsed_s > this.elapsed_s; // else its first step, or one that is repeated, is still to begin
    if (elapsed_s < this.elapsed_s) this.began_s = Infinity;
    this.elapsed_s = elapsed_s;
    if (goes_on) this.began_s = said_s > this.began_s + kPaused_s ? said_s : Math.min(this.began_s, said_s);
    return Number.isFinite(this.began_s) ? this.began_s : said_s;
  }
}

// As far as the page has received it. Times of the ring are page time.
export function measured_of(ring: SampleRing, began_s: number, elapsed_s: number): Measured {
  const found: Measured = { t_s: [], position_m: [], low_m: [], high_m: [], until_s: Infinity };
  const { estimate_m, estimate_low_m, estimate_high_m } = ring.columns;
  for (let index = ring.first_index; index < ring.next_index; ++index) {
    const slot = index % ring.capacity;
    const since_s = (ring.time_s[slot] ?? NaN) - began_s;
    if (!ring.holds(index) || !(since_s >= 0 && since_s <= elapsed_s)) continue;
    found.t_s.push(since_s);
    found.position_m.push(estimate_m[slot] ?? NaN);
    found.low_m.push(estimate_low_m[slot] ?? NaN);
    found.high_m.push(estimate_high_m[slot] ?? NaN);
  }
  return found;
}

// The same of a run that has ended, as it is recorded, up to a moment; `zero_us`: the UTC at which its prediction begins.
export function measured_in(overview: Overview, zero_us: number, until_s = Infinity): Measured {
  const { first_utc_us, last_utc_us, estimated_position_m: estimate_m, position_sd_m } = overview;
  const found: Measured = { t_s: [], position_m: [], low_m: [], high_m: [], until_s };
  first_utc_us.forEach((first_us, at) => {
    const since_s = ((first_us + (last_utc_us[at] ?? first_us)) / 2 - zero_us) / 1e6;
    if (since_s >= until_s) return;
    const least_m = estimate_m?.min[at] ?? NaN;
    const largest_m = estimate_m?.max[at] ?? NaN;
    const spread_m = kSpread_sd * (position_sd_m?.max[at] ?? NaN);
    found.t_s.push(since_s);
    found.position_m.push((least_m + largest_m) / 2);
    found.low_m.push(least_m - spread_m);
    found.high_m.push(largest_m + spread_m);
  });
  return found;
}

// Lower edge, upper edge and estimate at the times of a prediction: of the nearest sample within two of its steps.
export function beside(measured: Measured, at_s: readonly number[]): (number | null)[][] {
  const { t_s, position_m, low_m, high_m } = measured;
  const reach_s = 2 * ((at_s[1] ?? 1) - (at_s[0] ?? 0));
  let next = 0;
  const nearest = at_s.map((time_s) => {
    while (next + 1 < t_s.length && Math.abs(t_s[next + 1]! - time_s) <= Math.abs(t_s[next]! - time_s)) next += 1;
    return Math.abs((t_s[next] ?? Infinity) - time_s) <= reach_s ? next : -1;
  });
  const known = (value: number | undefined) => (value === undefined || Number.isNaN(value) ? null : value);
  return [low_m, high_m, position_m].map((values) => nearest.map((at) => known(values[at])));
}
