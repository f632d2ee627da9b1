// What is drawn of plans, of sigma, and of the days of a robot.
import { expect, test } from 'vitest';
import type { Fluid } from '../../src/api';
import type { FluidsInForce, Reservation } from '../../src/experiments_api';
import { place_of, rows_of } from '../../src/views/experiments/day_bars';
import { sigma_axis } from '../../src/views/experiments/knowledge';
import { model_for, plan_of } from '../../src/views/experiments/outlook';
import { kPaperModels } from '../../src/views/experiments/preview';

const limits = {
  setpoint_min_m: -1,
  setpoint_max_m: 1,
  setpoint_step_m: 2,
  duty_min: -1,
  duty_max: 1,
  power_duty: 0.9,
  power_s: 60,
  disturbance_max_m: 0.5,
};
const model = { model_gain_m_s: [0.2], model_time_constant_s: [0.1], fit_error: 0, set_by: '', set_at_us: 0 };
const fluids: FluidsInForce = {
  fluids: [
    { fluid: 'water', built_in: true, limits: { ...limits, duty_max: 0.1 }, model: null },
    { fluid: 'oil', built_in: false, limits, model },
  ] as Fluid[],
  limits_where_unknown: { ...limits, duty_max: 0.2 },
};

test('the model is that of the fluid, or where it has none the paper’s', () => {
  expect(model_for('oil', fluids)).toMatchObject({ model: { model_gain_m_s: [0.2] }, name: 'the model of oil' });
  expect(model_for('water', fluids).model).toBe(kPaperModels['(28)']);
  expect(model_for('', null).model).toBe(kPaperModels['(29)']);
});

const kText = `name = "a"
purpose = "b"
[sweep]
duty_factor = [1, 0.5]
repeats = 3
[[step]]
kind = "duty"
duty = 0.15
for_s = 2
`;
const around = { fluid: '', fluids, controller: null };

test('a plan counts all runs and lasts as long as all of them', () => {
  const plan = plan_of(kText, around);
  expect(plan).toMatchObject({ runs_planned: 6, fault: null, problems: [] });
  expect(plan.runs).toHaveLength(2);
  expect(plan.duration_s).toBeCloseTo(6 * 2.0, 6);
});

test('the limits are those of the fluid that the robot is in, or the strictest where it is not known', () => {
  expect(plan_of(kText, { ...around, fluid: 'water' }).problems).toEqual([
    { run: 1, text: 'Step 1: a duty of 15 % is refused; −100 to 10 % is allowed by the station’s limits in water.' },
  ]);
  expect(plan_of(kText.replace('0.15', '0.25'), around).problems[0]?.text).toMatch(/where the fluid is not known/);
});

test('a text that cannot be read has a fault at its line and no runs', () => {
  expect(plan_of(kText.replace('for_s', 'for'), around)).toMatchObject({ profile: null, runs: [], fault: { line: 6 } });
  expect(plan_of('  \n', around)).toMatchObject({ profile: null, fault: null });
});

const kHour_us = 3_600_000_000;
const slot = (robot_id: string, from_h: number, until_h: number) =>
  ({ robot_id, from_us: from_h * kHour_us, until_us: until_h * kHour_us }) as Reservation;

test('a slot lies in the days that are shown as far as it reaches into them', () => {
  expect(place_of(slot('a', 2, 5), 0)).toEqual({ x: 2, width: 3 });
  expect(place_of(slot('a', -5, 5), 0)).toEqual({ x: 0, width: 5 });
  expect(place_of(slot('a', 160, 200), 0)).toEqual({ x: 160, width: 8 });
  expect(place_of(slot('a', -5, -1), 0)).toBeNull();
  expect(place_of(slot('a', 168, 170), 0)).toBeNull();
  expect(place_of(slot('a', 1, 1.01), 0)?.width).toBe(0.5);
});

test('reserved robots come first, and of a large fleet nothing else', () => {
  expect(rows_of([slot('c', 0, 1)], ['a', 'b', 'c'])).toEqual(['c', 'a', 'b']);
  const fleet = Array.from({ length: 600 }, (_, n) => `tank-${n}`);
  expect(rows_of([slot('c', 0, 1), slot('c', 2, 3)], fleet)).toEqual(['c']);
});

test('the axis of sigma holds all sigmas and the target, the smaller one lower', () => {
  const place = sigma_axis([0.2, 0.05, 0.03], 0.02);
  expect(place(0.2)).toBeGreaterThan(place(0.05));
  for (const sigma of [0.2, 0.03, 0.02]) {
    expect(place(sigma)).toBeGreaterThan(0);
    expect(place(sigma)).toBeLessThan(1);
  }
  expect(Number.isFinite(sigma_axis([], 0.02)(0.02))).toBe(true);
});
