// The ring of samples and the window that a plot takes from it.
import { expect, test } from 'vitest';
import { TraceWindow } from '../src/plots/trace_window';
import { SampleRing, type Column } from '../src/samples';
import { batch } from './fakes';

function window_of(ring: SampleRing, edge_s: number, columns: Column[] = ['position_m', 'setpoint_m']): TraceWindow {
  const window = new TraceWindow(8192, columns);
  window.fill({ ring, shift_s: 0, past: null }, { from_s: edge_s - 60, to_s: edge_s }, 6000); // every sample as it is
  return window;
}

test('samples keep the spacing of the robot, whenever they arrive', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5), 10);
  ring.append(batch(5, 5), 10.2); // 150 ms late
  const window = window_of(ring, ring.edge_s(10.2));
  for (let i = 1; i < 10; ++i) expect((window.time_s[i] ?? 0) - (window.time_s[i - 1] ?? 0)).toBeCloseTo(0.01, 9);
});

test('a jump of seq is a gap, not a line', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5), 10);
  ring.append(batch(20, 5), 10.2);
  const window = window_of(ring, 10.2);
  expect(window.size).toBe(10);
  expect(window.gaps_s[0]).toHaveLength(1);
  const [from_s, to_s] = window.gaps_s[0]?.[0] ?? [0, 0];
  expect(to_s - from_s).toBeCloseTo(0.16, 9);
});

test('a batch that is sent again closes the gap', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5), 10);
  ring.append(batch(20, 5), 10.2);
  ring.append(batch(5, 15, { backfill: true }), 11);
  const window = window_of(ring, 10.2);
  expect(window.size).toBe(25);
  expect(window.gaps_s[0]).toHaveLength(0);
  expect([...window.values[0]!.subarray(0, 25)]).toEqual(Array.from({ length: 25 }, (_, i) => i / 1000));
});

test('a repeated sample is counted once', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5), 10);
  ring.append(batch(0, 5), 10.1);
  expect(ring.received).toBe(5);
});

test('hours of samples stay in the memory of the first minute', () => {
  const ring = new SampleRing(128);
  const arrays = [ring.time_s, ...Object.values(ring.columns)];
  for (let seq = 0; seq < 100_000; seq += 5) ring.append(batch(seq, 5), seq / 100);
  expect([ring.time_s, ...Object.values(ring.columns)]).toEqual(arrays);
  expect(ring.next_index - ring.first_index).toBe(128);
  expect(window_of(ring, 1000).size).toBe(128);
});

test('a sample older than the ring does not overwrite a newer one', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 1), 1);
  ring.append(batch(100, 60), 2);
  ring.append(batch(0, 5), 3);
  expect(ring.holds(0)).toBe(false);
  expect(ring.holds(100 + 59)).toBe(true);
});

test('a reboot starts at seq 0 again and is a gap', () => {
  const ring = new SampleRing(64);
  ring.append(batch(1000, 5), 10);
  ring.append(batch(0, 5, { boot_id: '12' }), 12);
  const window = window_of(ring, 12);
  expect(window.size).toBe(10);
  expect(window.gaps_s[0]).toHaveLength(1);
});

test('a missing setpoint is not drawn', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5, { setpoint_m: null }), 10);
  ring.append(batch(5, 5), 10.05);
  const window = window_of(ring, 10.05);
  expect(window.gaps_s[0]).toHaveLength(0);
  expect(window.gaps_s[1]).toHaveLength(1);
  const [from_s, to_s] = window.gaps_s[1]?.[0] ?? [0, 0];
  expect(from_s).toBeCloseTo(window.time_s[0] ?? 0, 9);
  expect(to_s).toBeCloseTo(window.time_s[5] ?? 0, 9);
});

test('the right edge moves evenly while batches arrive unevenly', () => {
  const ring = new SampleRing(256);
  for (let i = 0; i < 20; ++i) ring.append(batch(i * 5, 5), 10 + i * 0.05 + (i % 3) * 0.01);
  expect(ring.edge_s(11.5) - ring.edge_s(11.4)).toBeCloseTo(0.1, 9);
  expect(ring.time_s[99]).toBeLessThanOrEqual(ring.edge_s(10.95) + 0.005);
});

test('of a disturbance both positions are kept, and the spread lies around where the robot is', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5, { disturbance_m: -0.05, position_m: [0.1, 0.1, 0.1, 0.1, 0.1], position_sd_m: 0.003 }), 10);
  const window = window_of(ring, 10, ['estimate_low_m', 'estimate_high_m', 'position_m', 'estimate_m']);
  expect(window.values.map((column) => Number(column[0]?.toFixed(9)))).toEqual([0.144, 0.156, 0.1, 0.15]);
  expect([...window.low].map((edge) => Number(edge.toFixed(9)))).toEqual([0.144, 0.156, 0.1, 0.15]);
});

test('a spread that is not known is not drawn, and the estimate is', () => {
  const ring = new SampleRing(64);
  ring.append(batch(0, 5, { position_sd_m: null }), 10);
  const window = window_of(ring, 10, ['estimate_low_m', 'estimate_m']);
  expect(window.gaps_s[0]).toHaveLength(1);
  expect(window.gaps_s[1]).toHaveLength(0);
});
