// The page's closed loop beside the reference trajectories of the project.
import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { kPaperPlants } from '../../src/views/design/frequency';
import { closed_loop, modes_of, pole_angle, type ControlLawStep } from '../../src/views/design/time_response';

interface Case {
  plant: string;
  duty_limits: string;
  recurrence_memory: string;
  k: number[];
  measured: number[];
  duty: number[];
}
const golden = JSON.parse(
  readFileSync(new URL('../../../tests/data/closed_loop_cases.json', import.meta.url), 'utf8'),
) as { controller_b: number[]; controller_a: number[]; sampled: Case[] };

// The recurrence of the reference, with what it remembers unclamped.
class Recurrence implements ControlLawStep {
  private readonly errors: number[] = [];
  private readonly outputs: number[] = [];
  constructor(
    private readonly low: number,
    private readonly high: number,
  ) {}
  step(error_m: number): number {
    this.errors.unshift(error_m);
    let output = 0;
    golden.controller_b.forEach((b, at) => (output += b * (this.errors[at] ?? 0)));
    golden.controller_a.slice(1).forEach((a, at) => (output -= a * (this.outputs[at] ?? 0)));
    this.outputs.unshift(output);
    return Math.min(this.high, Math.max(this.low, output));
  }
}

const experiment = { setpoint_m: 0.1, disturbance_m: -0.05, disturbance_at_s: 20, duration_s: 40, period_s: 0.01 };
const kLimits: Record<string, [number, number]> = { none: [-Infinity, Infinity], '0..1': [0, 1], '-1..1': [-1, 1] };

for (const each of golden.sampled.filter(({ recurrence_memory }) => recurrence_memory === 'unsaturated')) {
  test(`follows the reference in ${each.plant}, duty limits ${each.duty_limits}`, () => {
    const plant = each.plant === 'Eq(29)' ? kPaperPlants['29'] : kPaperPlants['28'];
    const [low, high] = kLimits[each.duty_limits]!;
    const found = closed_loop(modes_of(plant), new Recurrence(low, high), experiment);
    each.k.forEach((tick, at) => {
      expect(Math.abs(found.position_m[tick]! - each.measured[at]!)).toBeLessThan(1e-6);
      expect(Math.abs(found.duty[tick]! - each.duty[at]!)).toBeLessThan(2e-4);
    });
  });
}

test('the poles of the paper’s model are found', () => {
  expect(pole_angle(kPaperPlants['29'])).toBeCloseTo(Math.atan2(6.76897722966639, -18.42490850221537), 2);
  expect(pole_angle(kPaperPlants['28'])).toBeCloseTo(Math.PI, 2);
});

test('a dead time delays the response by whole ticks', () => {
  const law = () => ({ step: () => 0.3 });
  const at_once = closed_loop(modes_of(kPaperPlants['29']), law(), { ...experiment, duration_s: 1 });
  const late = closed_loop(modes_of({ ...kPaperPlants['29'], dead_time_s: 0.07 }), law(), {
    ...experiment,
    duration_s: 1,
  });
  expect(late.position_m[7]).toBe(0);
  for (const tick of [10, 50, 93]) expect(late.position_m[tick + 7]).toBeCloseTo(at_once.position_m[tick]!, 12);
});
