// What an overview does not have: the ± of the position, setpoint and disturbance, known at some samples of a run.
//
// A knot is a stored sample. Knots lie evenly over the window that is looked at and on either side of each step, so that
// setpoint and disturbance between two knots that agree are those of both. Where two neighbours differ and are not
// consecutive samples, what lies between is not known, and nothing is drawn there.

import type { Step, StoredSample, Window } from './runs_api';

export interface Knot {
  utc_us: number;
  robot_time_us: number;
  boot_id: string;
  position_sd_m: number | null;
  setpoint_m: number | null; // null: in no mode that has one
  disturbance_m: number | null;
}

export interface Between {
  position_sd_m: number | null; // the larger of both sides
  setpoint_m: number | null | undefined; // undefined: not known here
  disturbance_m: number | null | undefined;
}

export const kEvenKnots = 24;
const kMostSteps = 60; // of a window, whose knots are asked for
const kAtOnce = 6; // requests; a browser opens no more connections
const kConsecutive = 1.5; // periods
export const kGapless = 0.9; // periods: so near is no sample but the one that is meant

export const knot_of = (sample: StoredSample): Knot => ({
  utc_us: sample.utc_us,
  robot_time_us: sample.robot_time_us,
  boot_id: sample.boot_id,
  position_sd_m: sample.position_sd_m,
  setpoint_m: sample.setpoint_m,
  disturbance_m: sample.disturbance_m,
});

// The moments at which a window needs knots. `step_starts_us` are the first samples of steps, and the ends of the last ones.
export function wanted_moments(window: Window, step_starts_us: readonly number[], period_us: number): number[] {
  const { from_us, to_us } = window;
  const even = Array.from({ length: kEvenKnots }, (_, at) => from_us + ((to_us - from_us) * at) / (kEvenKnots - 1));
  even[kEvenKnots - 1] = to_us - period_us; // from to_us on there is none
  const steps = step_starts_us
    .filter((at_us) => at_us > from_us - period_us && at_us < to_us + period_us)
    .slice(0, kMostSteps)
    .flatMap((at_us) => [at_us - 1.5 * period_us, at_us - 0.5 * period_us]);
  return [...even, ...steps].map(Math.round).sort((a, b) => a - b);
}

// Beginnings and ends of steps in UTC. A step says when it began since the first sample of its span.
export function step_bounds_us(steps: readonly Step[], span_starts_us: readonly number[], period_us: number): number[] {
  return steps.flatMap((step) => {
    const start_us = span_starts_us[step.span];
    if (start_us === undefined) return [];
    const from_us = start_us + step.at_s * 1e6;
    return [from_us, from_us + (step.last_seq - step.first_seq + 1) * period_us];
  });
}

export class Knots {
  private list: readonly Knot[] = []; // in order of time

  constructor(readonly period_us: number) {}

  get all(): readonly Knot[] {
    return this.list;
  }

  add(more: readonly Knot[]): void {
    const by_time = new Map([...this.list, ...more].map((knot) => [knot.utc_us, knot]));
    this.list = [...by_time.values()].sort((a, b) => a.utc_us - b.utc_us);
  }

  // Asks for those that are wanted and not near one that is known. `within_us`: near enough.
  async ask(
    moments: readonly number[],
    within_us: number,
    sample_at: (from_us: number) => Promise<StoredSample | null>,
  ): Promise<void> {
    const open = moments.filter((at_us) => !this.has_near(at_us, within_us));
    const found: Knot[] = [];
    const next = async (): Promise<void> => {
      for (let at_us = open.shift(); at_us !== undefined; at_us = open.shift()) {
        const sample = await sample_at(at_us);
        if (sample) found.push(knot_of(sample));
      }
    };
    await Promise.all(Array.from({ length: kAtOnce }, next));
    this.add(found);
  }

  at(utc_us: number): Between {
    const after_at = this.index_after(utc_us);
    const before = this.list[after_at - 1];
    const after = this.list[after_at];
    if (!before || !after) {
      const only = before ?? after;
      const is_at = only !== undefined && Math.abs(only.utc_us - utc_us) <= kConsecutive * this.period_us;
      return is_at ? of_one(only) : { position_sd_m: null, setpoint_m: undefined, disturbance_m: undefined };
    }
    const holds = after.utc_us - before.utc_us <= kConsecutive * this.period_us; // nothing lies between
    const is_one_boot = before.boot_id === after.boot_id;
    const agreed = <T>(a: T, b: T): T | undefined => (holds ? a : a === b && is_one_boot ? a : undefined);
    return {
      position_sd_m: is_one_boot ? larger(before.position_sd_m, after.position_sd_m) : null,
      setpoint_m: agreed(before.setpoint_m, after.setpoint_m),
      disturbance_m: agreed(before.disturbance_m, after.disturbance_m),
    };
  }

  // UTC of a moment on the clock of a boot; null where no knot is of it.
  utc_of(boot_id: string, robot_time_us: number): number | null {
    let best: Knot | null = null;
    for (const knot of this.list) {
      if (knot.boot_id !== boot_id) continue;
      const is_nearer =
        !best || Math.abs(knot.robot_time_us - robot_time_us) < Math.abs(best.robot_time_us - robot_time_us);
      if (is_nearer) best = knot;
    }
    return best && best.utc_us + robot_time_us - best.robot_time_us;
  }

  private has_near(at_us: number, within_us: number): boolean {
    const after_at = this.index_after(at_us - 1);
    const after = this.list[after_at];
    return after !== undefined && after.utc_us - at_us <= within_us;
  }

  // The index of the first knot later than a moment.
  private index_after(utc_us: number): number {
    let [low, high] = [0, this.list.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.list[middle] as Knot).utc_us <= utc_us) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

const of_one = ({ position_sd_m, setpoint_m, disturbance_m }: Knot): Between => ({
  position_sd_m,
  setpoint_m,
  disturbance_m,
});

const larger = (a: number | null, b: number | null): number | null =>
  a === null || b === null ? null : Math.max(a, b);
