// What is drawn of a stretch of time: bins that leave no peak out, gaps, and the joint of past and present.
import { expect, test } from 'vitest';
import type { Tile } from '../../src/plots/past';
import { TraceWindow } from '../../src/plots/trace_window';
import { SampleRing } from '../../src/samples';
import { batch } from '../fakes';

// 60 s of samples from 100 s on; position is seq / 1000 but for one peak.
function ring_of(size: number, peak_at = -1): SampleRing {
  const ring = new SampleRing(8192);
  for (let seq = 0; seq < size; seq += 5) {
    const message = batch(seq, 5);
    if (seq === peak_at) message.position_m[2] = 99;
    ring.append(message, 100 + (seq + 4) / 100);
  }
  return ring;
}

const past_of = (first_s: number, last_s: number, step_s: number) => {
  const size = Math.round((last_s - first_s) / step_s);
  const time_s = Float64Array.from({ length: size }, (_, i) => first_s + i * step_s);
  const one = new Float64Array(size).fill(1);
  const tile: Tile = {
    from_s: 0,
    to_s: 1e9,
    known_to_s: 1e9,
    first_s: time_s,
    last_s: time_s,
    columns: { position_m: { min: one, max: one } },
  };
  const asked: [number, number][] = [];
  return {
    asked,
    visit: (from_s: number, to_s: number, _: number, point: (tile: Tile, at: number) => void) => {
      asked.push([from_s, to_s]);
      time_s.forEach((at_s, at) => at_s >= from_s && at_s < to_s && point(tile, at));
    },
  };
};

test('however many samples go into a bin, a peak of one sample is drawn', () => {
  const window = new TraceWindow(4096, ['position_m']);
  window.fill({ ring: ring_of(6000, 3000), shift_s: 0, past: null }, { from_s: 100, to_s: 160 }, 100);
  expect(window.size).toBeLessThanOrEqual(2 * 102);
  expect(window.high[0]).toBe(99);
  expect([...window.values[0]!.subarray(0, window.size)]).toContain(99);
});

test('of long bins whole blocks of samples are taken, with the same extremes, and gaps stay gaps', () => {
  const ring = ring_of(3000, 1500);
  ring.append(batch(3400, 600), 100 + 39.99); // four seconds are missing
  const window = new TraceWindow(4096, ['position_m', 'setpoint_m']);
  window.fill({ ring, shift_s: 0, past: null }, { from_s: 100, to_s: 140 }, 100); // bins of 40 samples
  const first = [...window.values[0]!.subarray(0, window.size)];
  expect(window.high[0]).toBe(99);
  expect(window.low[0]).toBe(0);
  expect(window.gaps_s[0]).toHaveLength(1);
  expect(window.gaps_s[0]![0]![1] - window.gaps_s[0]![0]![0]).toBeCloseTo(4.01, 6);
  window.fill({ ring, shift_s: 0, past: null }, { from_s: 100, to_s: 140 }, 100);
  expect([...window.values[0]!.subarray(0, window.size)]).toEqual(first);
  window.fill({ ring, shift_s: 0, past: null }, { from_s: 100, to_s: 140 }, 200); // sample by sample
  expect([window.low[0], window.high[0]]).toEqual([0, 99]);
});

test('bins lie at fixed times, so that a plot that runs does not shimmer', () => {
  const ring = ring_of(6000);
  const rows = (from_s: number) => {
    const window = new TraceWindow(4096, ['position_m']);
    window.fill({ ring, shift_s: 0, past: null }, { from_s, to_s: from_s + 40 }, 100);
    return new Set([...window.time_s.subarray(4, window.size - 4)].map((time_s) => time_s.toFixed(6)));
  };
  const [a, b] = [rows(110), rows(110.13)];
  const shared = [...a].filter((time) => b.has(time));
  expect(shared.length).toBeGreaterThan(0.95 * a.size);
});

test('where the page has received nothing, the recording is asked, and joined without a gap', () => {
  const past = past_of(90, 200, 0.01);
  const window = new TraceWindow(16_384, ['position_m']);
  window.fill({ ring: ring_of(1000), shift_s: 0, past }, { from_s: 95, to_s: 110 }, 15_000);
  expect(past.asked).toHaveLength(1);
  expect(past.asked[0]![1]).toBeCloseTo(100, 6);
  expect(window.gaps_s[0]).toEqual([]);
  expect(window.size).toBeGreaterThan(1490);
});

test('what neither has is a gap of every column, and is not bridged', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 5), 100);
  ring.append(batch(300, 5), 103);
  const past = past_of(0, 0, 1);
  const window = new TraceWindow(4096, ['position_m', 'setpoint_m', 'round_trip_us']);
  window.fill({ ring, shift_s: 0, past }, { from_s: 99, to_s: 103 }, 2000);
  for (const gaps of window.gaps_s.slice(0, 2)) {
    expect(gaps).toHaveLength(1);
    expect(gaps[0]![1] - gaps[0]![0]).toBeCloseTo(2.96, 6);
  }
  expect(window.holes_s).toHaveLength(1);
  expect(past.asked.some(([from_s, to_s]) => from_s > 99.9 && to_s < 103)).toBe(true);
  expect(window.value_at('round_trip_us', 0)).toBeNull();
});

test('the row under the cursor is the nearest, and none where nothing was sampled', () => {
  const window = new TraceWindow(4096, ['position_m']);
  window.fill({ ring: ring_of(1000), shift_s: 1000, past: null }, { from_s: 1100, to_s: 1101 }, 1000);
  const row = window.row_at(1100.504)!;
  expect(window.time_s[row]).toBeCloseTo(1100.5, 6);
  expect(window.value_at('position_m', row)).toBeCloseTo(0.05, 9);
  expect(window.row_at(1090)).toBeNull();
});

test('the "±" of a pixel is that of its estimate, however far the estimate moves in it', () => {
  const values = (...each: number[]) => Float64Array.from(each);
  const columns = {
    estimate_m: { min: values(0, 0.1), max: values(0.1, 0.1) },
    estimate_low_m: { min: values(-0.02, 0.09), max: values(-0.02, 0.09) },
    estimate_high_m: { min: values(0.12, 0.11), max: values(0.12, 0.11) },
  };
  const [first_s, last_s] = [values(100.1, 100.6), values(100.4, 100.9)];
  const tile: Tile = { from_s: 0, to_s: 1e9, known_to_s: 1e9, first_s, last_s, columns };
  const past = {
    visit: (_: number, __: number, ___: number, point: (tile: Tile, at: number) => void) =>
      first_s.forEach((____, at) => point(tile, at)),
  };
  const window = new TraceWindow(64, ['estimate_low_m', 'estimate_high_m', 'estimate_m']);
  window.fill({ ring: new SampleRing(8), shift_s: 0, past }, { from_s: 100, to_s: 101 }, 2);
  const found = Array.from({ length: window.size }, (_, row) => window.spread_at(row));
  expect(found).toHaveLength(4);
  [0.02, 0.02, 0.01, 0.01].forEach((wanted, row) => expect(found[row]).toBeCloseTo(wanted, 9));
});

test('a point of which only the extremes are known is drawn the way that the trace goes, up as well as down', () => {
  const middles = [0, 1, 2, 3, 3, 2, 1, 0]; // a rising flank, and a falling one
  const values = (at: (middle: number) => number) => Float64Array.from(middles.map(at));
  const first_s = Float64Array.from(middles.map((_, at) => 100 + at + 0.1));
  const last_s = Float64Array.from(middles.map((_, at) => 100 + at + 0.9));
  const columns = { position_m: { min: values((m) => m - 0.5), max: values((m) => m + 0.5) } };
  const tile: Tile = { from_s: 0, to_s: 1e9, known_to_s: 1e9, first_s, last_s, columns };
  const past = {
    visit: (_: number, __: number, ___: number, point: (tile: Tile, at: number) => void) =>
      first_s.forEach((____, at) => point(tile, at)),
  };
  const window = new TraceWindow(64, ['position_m']);
  window.fill({ ring: new SampleRing(8), shift_s: 0, past }, { from_s: 100, to_s: 108 }, 8);
  const drawn = [...window.values[0]!.subarray(0, window.size)];
  expect(drawn).toEqual([-0.5, 0.5, 0.5, 1.5, 1.5, 2.5, 2.5, 3.5, 2.5, 3.5, 2.5, 1.5, 1.5, 0.5, 0.5, -0.5]);
});

test('a ring that grows keeps what it has', () => {
  const ring = ring_of(1000);
  ring.grow(65_536);
  const window = new TraceWindow(4096, ['position_m']);
  window.fill({ ring, shift_s: 0, past: null }, { from_s: 100, to_s: 110 }, 2000);
  expect(window.size).toBe(1000);
  ring.append(batch(1000, 5), 110.04);
  expect(ring.received).toBe(1005);
  expect(ring.next_index - ring.first_index).toBe(1005);
});
