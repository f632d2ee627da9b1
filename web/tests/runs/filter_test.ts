// Which runs are meant by what is typed.

import { expect, test } from 'vitest';
import {
  completeness,
  looks_here,
  matches,
  parse_filter,
  parse_moment,
  parse_numbers,
} from '../../src/views/runs/filter';
import { made_run } from './made';

const filter = (query: Record<string, string>) => parse_filter(query).filter;

test('every word must be somewhere in what is said of a run', () => {
  const run = made_run({ run_id: 12, name: 'First light', notes: 'the pump was warm', tube: 'PVC 12 mm' });
  for (const q of ['light', 'LIGHT pump', '#12', 'pvc warm', '']) expect(matches(run, filter({ q })), q).toBe(true);
  for (const q of ['dark', 'light dark', '#13']) expect(matches(run, filter({ q })), q).toBe(false);
});

test('a fluid is meant as it is written, not as a part of it', () => {
  expect(matches(made_run({ fluid: 'water' }), filter({ fluid: 'water' }))).toBe(true);
  expect(matches(made_run({ fluid: 'salt_water' }), filter({ fluid: 'water' }))).toBe(false);
});

test('a day of the second date belongs to the range, a time of day is exact', () => {
  const at = (...time: [number, number, number, number, number]) =>
    made_run({ started_at_us: new Date(...time).getTime() * 1000 });
  const days = filter({ from: '2026-11-25', to: '2026-11-26' });
  expect(matches(at(2026, 10, 26, 23, 59), days)).toBe(true);
  expect(matches(at(2026, 10, 27, 0, 0), days)).toBe(false);
  expect(matches(at(2026, 10, 24, 23, 59), days)).toBe(false);
  expect(matches(at(2026, 10, 26, 14, 30), filter({ to: '2026-11-26 14:30' }))).toBe(false);
  expect(matches(at(2026, 10, 26, 14, 29), filter({ to: '2026-11-26 14:30' }))).toBe(true);
});

test('what is no date is said, with the way to write one, and does not filter', () => {
  for (const from of ['26/11', '2026-13-01', '2026-02-30', '2026-11-26 25:00', 'yesterday']) {
    expect(parse_moment(from), from).toBeNull();
    const { problem, filter: found } = parse_filter({ from });
    expect(problem).toContain(`“${from}” is no date. Write it as 2026-11-26`);
    expect(found.from_ms).toBe(-Infinity);
  }
  expect(parse_filter({ from: '2026-11-27', to: '2026-11-25' }).problem).toContain('not before');
  expect(parse_filter({ from: '2026-11-26', to: '2026-11-26' }).problem).toBe('');
});

test('the station is asked page after page only for what it cannot filter itself', () => {
  expect(looks_here(filter({ robot: 'sim-1', state: 'open' }))).toBe(false);
  for (const query of [{ q: 'a' }, { fluid: 'water' }, { from: '2026-11-26' }, { to: '2026-11-26' }])
    expect(looks_here(filter(query as unknown as Record<string, string>))).toBe(true);
});

test('numbers of an address', () => {
  expect(parse_numbers('3,4,4,x,-1,0,1.5,')).toEqual([3, 4]);
  expect(parse_numbers(undefined)).toEqual([]);
});

test('a run is called complete only when every sample is stored', () => {
  const run = (stored: number, lost: number) =>
    made_run({ samples_expected: 100, samples_stored: stored, samples_lost: lost });
  expect(completeness(run(100, 0))).toEqual({ tone: '', text: 'complete' });
  expect(completeness(run(95, 5))).toEqual({ tone: 'caution', text: '5 lost' });
  expect(completeness(run(90, 0))).toEqual({ tone: 'caution', text: '10 missing' });
  expect(completeness({ ...run(90, 0), state: 'open' }).text).toBe('recording');
  expect(completeness({ ...run(100, 0), missed_ticks: 264 }).text).toBe('complete; 264 missed by the robot');
  expect(completeness({ ...run(95, 5), missed_ticks: 1 }).text).toBe('5 lost; 1 missed by the robot');
});
