// What a robot believed of its position beside what was predicted: at the same times, and never without its "±".
import { expect, test } from 'vitest';
import { Robot } from '../../src/robot';
import { SampleRing } from '../../src/samples';
import { beside, measured_in, measured_of, ring_now_s, RunBegin } from '../../src/views/experiments/measured';
import { batch, robot } from '../fakes';

test('the estimate since the run began, between two standard deviations to either side', () => {
  const ring = new SampleRing(1024);
  ring.append(batch(0, 100), 0.99); // sample n at n / 100 s, position n mm
  const measured = measured_of(ring, 0.5, 0.305);
  expect(measured.t_s).toHaveLength(31);
  const [low, high, estimate] = beside(measured, [0, 0.1, 0.2, 0.3, 0.6]);
  expect(estimate!.map((m) => m && Math.round(m * 1e4) / 1e4)).toEqual([0.05, 0.06, 0.07, 0.08, null]);
  expect(low!.slice(0, 4).map((m, at) => Math.round(((estimate![at] ?? 0) - (m ?? 0)) * 1e6))).toEqual(
    Array(4).fill(2000),
  );
  expect(high!.slice(0, 4).map((m, at) => Math.round(((m ?? 0) - (estimate![at] ?? 0)) * 1e6))).toEqual(
    Array(4).fill(2000),
  );
  expect(high![4]).toBeNull();
});

test('where it is not known how sure the robot was there is no band', () => {
  const ring = new SampleRing(1024);
  ring.append(batch(0, 100, { position_sd_m: null }), 0.99);
  const [low, high, estimate] = beside(measured_of(ring, 0, 0.5), [0, 0.1]);
  expect([low, high]).toEqual([
    [null, null],
    [null, null],
  ]);
  expect(estimate![1]).toBeCloseTo(0.01, 6);
});

test('of a run that has ended the record says it: the middle of each point, and its edges two standard deviations away', () => {
  const overview = {
    source: 'rows' as const,
    first_utc_us: [900_000, 1_000_000, 1_100_000, 1_200_000],
    last_utc_us: [980_000, 1_080_000, 1_180_000, 1_280_000],
    samples: [9, 9, 9, 9],
    estimated_position_m: { min: [0, 0.01, 0.02, null], max: [0, 0.03, 0.04, null] },
    position_sd_m: { min: [0, 0.001, null, null], max: [0, 0.002, null, null] },
    gaps: [],
    gaps_next: null,
  };
  const [low, high, estimate] = beside(measured_in(overview, 1_040_000), [0, 0.1, 0.2, 0.9]);
  expect(estimate!.map((m) => m && Math.round(m * 1e4) / 1e4)).toEqual([0.02, 0.03, null, null]);
  expect(low![0]).toBeCloseTo(0.006, 6);
  expect(high![0]).toBeCloseTo(0.034, 6);
  expect([low![1], high![1]], 'how sure the robot was is not known').toEqual([null, null]);
  expect(measured_in(overview, 1_040_000, 0.05).t_s, 'up to where it was interrupted').toHaveLength(2);
});

// Position n mm at n / 100 s of the robot, which here is page time as well; the first batch came 0.3 s late.
function late_robot(clock: object | null) {
  const one = new Robot(robot('rheo-1', { clock }), 0);
  one.ring.append(batch(0, 100), 0.99 + 0.3);
  return one;
}

test('while a run goes on, what is measured lies on the robot’s clock, however late its first batch came', () => {
  const one = late_robot({ offset_us: 5e6, round_trip_us: 1000 });
  // The run began at 0.5 s; it is 0.79 s old at 1.29 s, which is 1006.29 s of UTC.
  const now_s = ring_now_s(one, 1e9, 1006.29, 1.29);
  const began_s = new RunBegin().of('7-1', 0.79, now_s);
  const [, , estimate] = beside(measured_of(one.ring, began_s, 0.79), [0, 0.1, 0.2]);
  expect(estimate!.map((m) => Math.round((m ?? 0) * 1e3))).toEqual([50, 60, 70]);
});

test('where the robot’s clock is not known yet, it lies where it came', () => {
  expect(ring_now_s(late_robot(null), 1e9, 1006.29, 1.29)).toBeCloseTo(1.29, 9);
});

test('of the reports of a run the one that was the least late counts, until a pause moves its beginning', () => {
  const begin = new RunBegin();
  begin.of('7-1', 0, 9.8); // asked for, and not begun yet
  expect(begin.of('7-1', 1, 11.25)).toBeCloseTo(10.25, 9);
  expect(begin.of('7-1', 2, 12.05)).toBeCloseTo(10.05, 9);
  expect(begin.of('7-1', 3, 13.3)).toBeCloseTo(10.05, 9);
  expect(begin.of('7-1', 3.5, 25), 'after a pause').toBeCloseTo(21.5, 9);
  begin.of('7-1', 3, 30); // a step is repeated, and has not begun yet
  expect(begin.of('7-1', 3.1, 30.5)).toBeCloseTo(27.4, 9);
  expect(begin.of('7-2', 0.5, 20), 'the next run').toBeCloseTo(19.5, 9);
});
