// One channel against another: a point for each sample, breaks where samples are missing, the newest last.
import { expect, test } from 'vitest';
import type { Tile } from '../../src/plots/past';
import { kMostPoints, XyPoints, type XySource } from '../../src/plots/xy';
import { note_of } from '../../src/plots/xy_plot';
import { SampleRing } from '../../src/samples';
import { batch } from '../fakes';

function filled(ring: SampleRing, from_s: number, to_s: number, past: XySource['past'] = null) {
  const points = new XyPoints();
  points.fill({ rows: ring, shift_s: 0, past }, { from_s, to_s }, 'position_m', 'duty');
  return points;
}

test('each sample of the time shown is one point, in order', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 1000), 9.99); // sample n at n / 100 s
  const points = filled(ring, 2, 4);
  expect(points.size).toBe(201);
  expect([points.x[0], points.x[200]]).toEqual([0.2, 0.4]);
  expect(points.y[0]).toBe(0.5);
  expect(points.x_range).toEqual([0.2, 0.4]);
  expect([...points.starts.subarray(0, points.size)].filter((start) => start === 1)).toHaveLength(1);
});

test('over a gap, and over samples without a value, points are not joined', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 100), 0.99);
  ring.append(batch(200, 100), 2.99);
  ring.append(batch(300, 5, { duty: [0, 0, NaN, 0, 0] }), 3.04);
  const points = filled(ring, 0, 4);
  expect(points.size).toBe(204);
  const starts = [...points.starts.subarray(0, points.size)].flatMap((start, at) => (start ? [at] : []));
  expect(starts).toEqual([0, 100, 202]);
});

test('where the page has no samples those of the recording are points, and extremes are not', () => {
  const time_s = Float64Array.from([1, 1.01, 1.02]);
  const column = { min: Float64Array.from([5, 6, 7]), max: Float64Array.from([5, 6, 7]) };
  const tile = (first_s: Float64Array, last_s: Float64Array) =>
    ({ first_s, last_s, columns: { position_m: column, duty: column } }) as unknown as Tile;
  const visited = (shown: Tile) =>
    ({
      visit: (_a: number, _b: number, _c: number, point: (tile: Tile, at: number) => void) =>
        time_s.forEach((_, at) => point(shown, at)),
    }) as unknown as XySource['past'];
  expect(filled(new SampleRing(64), 0, 2, visited(tile(time_s, time_s))).size).toBe(3);
  expect(filled(new SampleRing(64), 0, 2, visited(tile(time_s, time_s.slice()))).size).toBe(0);
});

test('of too many samples the newest are drawn, and it says so', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 10), 0.09);
  const points = filled(ring, -kMostPoints, 1);
  expect(points.is_cut).toBe(true);
  expect(points.size).toBe(10);
  expect(filled(ring, 0, 1).is_cut).toBe(false);
});

test('a position is drawn with how sure it is at worst, and other channels are not', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 100), 0.99);
  ring.append(batch(100, 100, { position_sd_m: 0.003 }), 1.99);
  const said = (to_s: number, columns: string[]) => note_of(filled(ring, 0, to_s), columns);
  expect(said(0.5, ['duty', 'estimate_m'])).toMatch(/The position is ± 2\.0 mm \(2 sd, the largest\)\.$/);
  expect(said(2, ['=low-pass position_m (0.5 s)', 'duty'])).toContain('± 6.0 mm');
  expect(said(2, ['position_sd_m', 'duty'])).not.toContain('±');
  ring.append(batch(200, 10, { position_sd_m: null }), 2.09);
  expect(said(3, ['duty', 'estimate_m'])).toContain('± – mm');
});
