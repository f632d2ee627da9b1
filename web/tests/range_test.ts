// Ranges of the charts.
import { expect, test } from 'vitest';
import { next_range, range_splits, round_step } from '../src/range';

test('a range has round ends around the data', () => {
  const [from, to] = next_range([-0.04, 0.04], 0, 0.101, 0.08);
  expect(from).toBeCloseTo(-0.02, 9);
  expect(to).toBeCloseTo(0.12, 9);
});

test('a range that still fits does not move', () => {
  const now: [number, number] = [-0.02, 0.12];
  expect(next_range(now, 0, 0.11, 0.08)).toBe(now);
});

test('a range shrinks when the data fill less than half of it', () => {
  const [from, to] = next_range([-1, 1], 0.09, 0.11, 0.08);
  expect(to - from).toBeLessThan(0.2);
});

test('no data leave the range as it is', () => {
  const now: [number, number] = [0, 1];
  expect(next_range(now, Infinity, -Infinity, 1)).toBe(now);
});

test('steps are 1, 2 or 5 times a power of ten', () => {
  expect([0.013, 0.2, 3, 70].map(round_step)).toEqual([0.02, 0.2, 5, 100]);
  expect(range_splits([0, 100])).toEqual([0, 20, 40, 60, 80, 100]);
});
