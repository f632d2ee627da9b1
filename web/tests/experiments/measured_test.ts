// What a robot believed of its position beside what was predicted: at the same times, and never without its "±".
import { expect, test } from 'vitest';
import { SampleRing } from '../../src/samples';
import { beside, measured_of } from '../../src/views/experiments/measured';
import { batch } from '../fakes';

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
