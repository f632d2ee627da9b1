// Samples of a replay in pages of fixed memory: which one is at a moment, what a gap is, and what is not known.
import { expect, test } from 'vitest';
import { readout_at } from '../../src/views/runs/replay/past_readout';
import { kPages, kRowsOfPage, Reel, type Row } from '../../src/views/runs/replay/reel';
import { at, kOrigin_us, kPeriod_us, sample, samples } from './made';

const kEnd_us = at(1_000_000);
const reel_with = (...pages: [number, ReturnType<typeof samples>][]) => {
  const reel = new Reel(kOrigin_us, kPeriod_us);
  for (const [number, list] of pages) reel.take(number, list, kEnd_us);
  return reel;
};

test('at a moment stands the sample at or before it, and no value between two', () => {
  const reel = reel_with([0, samples(0, 1000)]);
  expect(reel.at(at(500))?.seq).toBe(500);
  expect(reel.at(at(500) + 9999)?.seq).toBe(500);
  expect(reel.at(at(500) - 1)?.seq).toBe(499);
  expect(reel.at(at(500))?.value('position_m')).toBe(0.5);
  expect(reel.at(at(500))?.value('estimate_m')).toBeCloseTo(0.52, 12);
});

test('of a page that has not come nothing is known; what a page has nothing of was not recorded', () => {
  const reel = reel_with([0, samples(0, 1000)], [2, []]);
  expect(reel.at(at(1500))).toBeNull();
  reel.take(1, samples(1000, 1100), kEnd_us);
  expect(reel.at(at(1500))?.seq).toBe(1099);
  expect(reel.at(at(2500))?.seq).toBe(1099);
});

test('in a gap the readout is that of the last sample, and marked', () => {
  const reel = reel_with([0, samples(0, 1000, [300, 500])]);
  const in_gap = readout_at(reel.at(at(400)), at(400), reel.gap_s);
  expect([in_gap.position_m, in_gap.stale]).toEqual([0.299, true]);
  expect(in_gap.sample_age_ms).toBeCloseTo(1010, 6);
  const before = readout_at(reel.at(at(299) + 9000), at(299) + 9000, reel.gap_s);
  expect([before.position_m, before.stale]).toEqual([0.299, false]);
  expect(readout_at(null, at(0), reel.gap_s)).toMatchObject({ position_m: null, stale: true });
});

test('the readout has what was recorded, with its model and its mode', () => {
  const reel = reel_with([0, [sample(0, { mode: 'emergency', emergency_id: '7', setpoint_m: null, flags: 64 })]]);
  const now = readout_at(reel.at(at(0)), at(0), reel.gap_s);
  expect(now).toMatchObject({ mode: 'emergency', emergency_id: '7', setpoint_m: null, reference_m: null });
  expect(now.model).toBe('model confirmed');
});

test('a step leads to the next sample, over gaps and empty pages, and says which page it lacks', () => {
  const reel = reel_with([0, samples(0, 1000, [300, 500])], [1, []]);
  const seq = (found: Row | number | null) => (found as Row).seq;
  expect(seq(reel.next_to(at(10), 1, kEnd_us))).toBe(11);
  expect(seq(reel.next_to(at(10) + 5, 1, kEnd_us))).toBe(11);
  expect(seq(reel.next_to(at(10), -1, kEnd_us))).toBe(9);
  expect(seq(reel.next_to(at(10) + 5, -1, kEnd_us))).toBe(10);
  expect(seq(reel.next_to(at(299), 1, kEnd_us))).toBe(500);
  expect(seq(reel.next_to(at(500), -1, kEnd_us))).toBe(299);
  expect(reel.next_to(at(999), 1, kEnd_us)).toBe(2);
  reel.take(2, samples(2000, 3000), kEnd_us);
  expect(seq(reel.next_to(at(999), 1, kEnd_us))).toBe(2000);
  expect(seq(reel.next_to(at(2000), -1, kEnd_us))).toBe(999);
  expect(reel.next_to(at(0), -1, kEnd_us)).toBeNull();
  expect(reel.next_to(at(5000), 1, kEnd_us)).toBe(5);
});

test('the plots get what lies before the moment, and nothing after it', () => {
  const reel = reel_with([0, samples(0, 1000)], [1, samples(1000, 2000)]);
  reel.show_until(at(1200));
  const shown = [];
  for (let index = reel.first_index; index < reel.next_index; ++index)
    if (reel.holds(index)) shown.push(reel.time_s[index % reel.capacity]);
  expect(shown).toHaveLength(1201);
  expect(shown.at(-1)).toBeCloseTo(at(1200) / 1e6, 6);
});

test('a page takes the place of the one a whole round before it, and no other', () => {
  const reel = reel_with([0, samples(0, 1000)], [1, samples(1000, 2000)]);
  const far = kPages;
  reel.take(far, samples(far * 1000, far * 1000 + 1000), kEnd_us);
  expect(reel.page(0)).toBeNull();
  expect(reel.at(at(500))).toBeNull();
  expect(reel.page(1)?.rows).toBe(1000);
  expect(reel.at(at(far * 1000 + 3))?.seq).toBe(far * 1000 + 3);
  expect(reel.capacity).toBe(kPages * kRowsOfPage);
});

test('samples of another page, or out of order, do no harm', () => {
  const reel = reel_with([0, [sample(3), sample(1), sample(2), sample(1500)]]);
  expect(reel.page(0)?.rows).toBe(3);
  expect(reel.at(at(2))?.seq).toBe(2);
});
