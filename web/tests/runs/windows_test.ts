// Windows of time, the axis, and how a comparison is asked for.

import { expect, test } from 'vitest';
import { asked, grid_us, parse_comparison } from '../../src/views/runs/alignment';
import { time_of } from '../../src/views/runs/runs_api';
import { clock_label, since_text, time_splits, time_step_s } from '../../src/views/runs/time_axis';
import { made_run } from './made';
import { around, inside, moved, parse_window, window_query, zoomed } from '../../src/views/runs/windows';

const bounds = { from_us: 0, to_us: 100_000_000 };

test('a window goes through the address and back', () => {
  const window = { from_us: 1_764_120_000_123_000, to_us: 1_764_120_009_000_000 };
  expect(parse_window(window_query(window))).toEqual(window);
  expect(window_query(null)).toEqual({ from: '', to: '' });
  for (const query of [{}, { from: '5' }, { from: '9', to: '5' }, { from: 'a', to: 'b' }]) {
    expect(parse_window(query as Record<string, string>)).toBeNull();
  }
});

test('zooming keeps the middle, moving keeps the length, and both stay in the run', () => {
  expect(zoomed({ from_us: 20_000_000, to_us: 60_000_000 }, 0.5, bounds)).toEqual({
    from_us: 30_000_000,
    to_us: 50_000_000,
  });
  expect(zoomed({ from_us: 20_000_000, to_us: 80_000_000 }, 2, bounds)).toBeNull(); // all of it
  expect(moved({ from_us: 20_000_000, to_us: 60_000_000 }, 0.5, bounds)).toEqual({
    from_us: 40_000_000,
    to_us: 80_000_000,
  });
  expect(moved({ from_us: 60_000_000, to_us: 100_000_000 }, 0.5, bounds)).toEqual({
    from_us: 60_000_000,
    to_us: 100_000_000,
  });
  expect(around(1_000_000, 5_000_000, bounds)).toEqual({ from_us: 0, to_us: 10_000_000 });
  expect(inside({ from_us: -5, to_us: 200_000_000 }, bounds)).toBeNull();
});

test('splits of time are round, also as times of day', () => {
  expect(time_step_s(42, 10)).toBe(5);
  expect(time_step_s(3600, 10)).toBe(600);
  expect(time_splits(0, 42, 15)).toEqual([0, 15, 30]);
  expect(time_splits(0, 42, 15, 7)).toEqual([8, 23, 38]); // began 7 s after a round time
});

test('times since the start read as people say them', () => {
  expect([0, 0.25, 42, 90, 3750, -2].map((time_s) => since_text(time_s))).toEqual([
    '0 s',
    '0.25 s',
    '42 s',
    '1:30',
    '1:02:30',
    '−2 s',
  ]);
  const noon_ms = new Date(2026, 10, 26, 12, 0, 5, 250).getTime();
  expect([60, 1, 0.1].map((step_s) => clock_label(noon_ms, step_s))).toEqual(['12:00', '12:00:05', '12:00:05.25']);
});

test('a comparison is read from the address, and asked for as the station takes it', () => {
  const comparison = parse_comparison({
    runs: '3,4',
    at: 'event',
    number: '2',
    reference: '4',
    from: '-1',
    to: '10.25',
  });
  expect(comparison.problem).toBe('');
  expect(asked(comparison)).toEqual({
    runs: '3,4',
    at: 'event',
    number: 2,
    event: 'detection',
    reference_run_id: 4,
    from_ms: -1000,
    to_ms: 10250,
  });
  expect(asked(parse_comparison({ runs: '3,4' }))).toEqual({ runs: '3,4', at: 'start', reference_run_id: 3 });
  expect(asked(parse_comparison({ runs: '3,4', at: 'marker', marker: 'light' }))).toMatchObject({
    marker: 'light',
    number: 1,
  });
});

test('too few or too many runs are not asked for, and the page says why', () => {
  expect(parse_comparison({ runs: '3' }).problem).toContain('at least two');
  const many = Array.from({ length: 13 }, (_, at) => at + 1).join(',');
  expect(parse_comparison({ runs: many }).problem).toContain('13 runs are too many');
  expect(parse_comparison({ runs: '3,4', at: 'noon', number: 'x', reference: '9' })).toMatchObject({
    at: 'start',
    number: 1,
    reference: 3,
  });
});

test('a grid is as fine as can be drawn, in whole samples', () => {
  expect(grid_us(5, 1000)).toBe(10_000);
  expect(grid_us(42, 1000)).toBe(50_000);
  expect(grid_us(1e9, 1000)).toBe(60_000_000);
});

test('what happened is asked for from the start of a run, and past its end for what was received late', () => {
  const run = made_run({ started_at_us: 1_000_000, ended_at_us: 3_000_000 });
  expect(time_of(run)).toEqual({ from_us: 1_000_000, to_us: 603_000_000 });
  expect(time_of({ ...run, ended_at_us: null })).toEqual({ from_us: 1_000_000 });
});
