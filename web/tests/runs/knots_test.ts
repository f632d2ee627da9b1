// What is known between stored samples: ±, setpoint, disturbance.

import { expect, test } from 'vitest';
import { kEvenKnots, knot_of, Knots, step_bounds_us, wanted_moments } from '../../src/views/runs/knots';
import type { Step } from '../../src/views/runs/runs_api';
import { made_sample } from './made';

const kPeriod_us = 10_000;
const knots_of = (...samples: ReturnType<typeof made_sample>[]) => {
  const knots = new Knots(kPeriod_us);
  knots.add(samples.map(knot_of));
  return knots;
};

test('between two knots that agree, what they say holds; the larger ± counts', () => {
  const knots = knots_of(
    made_sample(0, { setpoint_m: 0.1, position_sd_m: 0.001 }),
    made_sample(1_000_000, { setpoint_m: 0.1, position_sd_m: 0.004 }),
  );
  expect(knots.at(500_000)).toEqual({ position_sd_m: 0.004, setpoint_m: 0.1, disturbance_m: 0 });
});

test('between two that differ, nothing is known, unless they are consecutive samples', () => {
  const far = knots_of(made_sample(0, { disturbance_m: 0 }), made_sample(1_000_000, { disturbance_m: -0.05 }));
  expect(far.at(500_000).disturbance_m).toBeUndefined();
  const near = knots_of(made_sample(0, { disturbance_m: 0 }), made_sample(kPeriod_us, { disturbance_m: -0.05 }));
  expect(near.at(5000).disturbance_m).toBe(0);
  expect(near.at(kPeriod_us).disturbance_m).toBe(-0.05);
});

test('over a reboot nothing is known', () => {
  const knots = knots_of(made_sample(0), made_sample(1_000_000, { boot_id: '8' }));
  expect(knots.at(500_000)).toEqual({ position_sd_m: null, setpoint_m: undefined, disturbance_m: undefined });
});

test('before the first and after the last knot, only their own sample is known', () => {
  const knots = knots_of(made_sample(1_000_000, { setpoint_m: 0.1 }));
  expect(knots.at(1_000_000 + kPeriod_us).setpoint_m).toBe(0.1);
  expect(knots.at(2_000_000).setpoint_m).toBeUndefined();
  expect(new Knots(kPeriod_us).at(0).position_sd_m).toBeNull();
});

test('knots are wanted over the window and on either side of each step in it', () => {
  const step = { span: 1, at_s: 2, first_seq: 100, last_seq: 299 } as Step;
  const bounds_us = step_bounds_us([step], [0, 10_000_000], kPeriod_us);
  expect(bounds_us).toEqual([12_000_000, 14_000_000]);
  const moments = wanted_moments({ from_us: 11_000_000, to_us: 13_000_000 }, bounds_us, kPeriod_us);
  expect(moments.length).toBe(kEvenKnots + 2);
  expect(moments).toContain(12_000_000 - 15_000); // from here on the last sample before the step
  expect(moments).toContain(12_000_000 - 5000); // and from here its first one
  expect(moments).toEqual([...moments].sort((a, b) => a - b));
});

test('a sample that is known is not asked for again', async () => {
  const knots = knots_of(made_sample(1_000_000));
  const asked: number[] = [];
  const station = async (from_us: number) => (asked.push(from_us), made_sample(from_us + 3000));
  await knots.ask([999_995, 2_000_000], 9000, station);
  await knots.ask([2_000_000], 9000, station);
  expect(asked).toEqual([2_000_000]);
  expect(knots.all.map(({ utc_us }) => utc_us)).toEqual([1_000_000, 2_003_000]);
});

test('the time of an event is that of the nearest knot of its boot', () => {
  const knots = knots_of(
    made_sample(1_000_000, { robot_time_us: 100 }),
    made_sample(9_000_000, { robot_time_us: 8_000_050 }), // the clocks drift
    made_sample(20_000_000, { robot_time_us: 500, boot_id: '8' }),
  );
  expect(knots.utc_of('7', 8_000_000)).toBe(8_999_950);
  expect(knots.utc_of('8', 600)).toBe(20_000_100);
  expect(knots.utc_of('9', 600)).toBeNull();
});
