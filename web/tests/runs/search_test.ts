// The search for runs over the station's pages.

import { expect, test } from 'vitest';
import { parse_filter } from '../../src/views/runs/filter';
import type { AskedRuns, Run } from '../../src/views/runs/runs_api';
import { RunSearch } from '../../src/views/runs/search';
import { made_run } from './made';

const filter = (query: Record<string, string> = {}) => parse_filter(query).filter;

// A station with runs 1 to `size`; every hundredth is about glucose.
class Station {
  asked: AskedRuns[] = [];
  constructor(public size: number) {}
  page = async (asked: AskedRuns): Promise<Run[]> => {
    this.asked.push(asked);
    const newest = Math.min(this.size, (asked.before ?? Infinity) - 1);
    const numbers = Array.from({ length: Math.max(0, Math.min(asked.limit, newest)) }, (_, at) => newest - at);
    return numbers.map((run_id) => made_run({ run_id, name: run_id % 100 === 0 ? 'glucose' : 'plain' }));
  };
}

test('a screen of runs is one page, and more() goes on where it ended', async () => {
  const station = new Station(250);
  const search = new RunSearch(station.page);
  await search.begin(filter());
  expect(search.found.value.map(({ run_id }) => run_id).slice(0, 2)).toEqual([250, 249]);
  expect([search.found.value.length, search.is_done.value, station.asked.length]).toEqual([100, false, 1]);
  await search.more();
  await search.more();
  expect([search.found.value.length, search.is_done.value]).toEqual([250, true]);
  expect(new Set(search.found.value.map(({ run_id }) => run_id)).size).toBe(250);
  await search.more();
  expect(station.asked.length).toBe(3);
});

test('what the station cannot filter is looked for in all of its pages', async () => {
  const station = new Station(5000);
  const search = new RunSearch(station.page);
  await search.begin(filter({ q: 'glucose', robot: 'sim-1', state: 'ended' }));
  expect(search.found.value.length).toBe(50);
  expect([search.looked_through.value, search.is_done.value]).toEqual([5000, true]);
  expect(station.asked[0]).toMatchObject({ robot_id: 'sim-1', state: 'ended', before: null });
});

test('what an earlier search finds late is dropped', async () => {
  let answer: (runs: Run[]) => void = () => undefined;
  const slow = new Promise<Run[]>((resolve) => (answer = resolve));
  const search = new RunSearch((asked) =>
    asked.robot_id === 'slow' ? slow : Promise.resolve([made_run({ run_id: 2 })]),
  );
  const first = search.begin(filter({ robot: 'slow' }));
  await search.begin(filter({ robot: 'fast' }));
  answer([made_run({ run_id: 1 })]);
  await first;
  expect(search.found.value.map(({ run_id }) => run_id)).toEqual([2]);
  expect(search.is_busy.value).toBe(false);
});

test('a list that is looked through anew keeps its length', async () => {
  const station = new Station(250);
  const search = new RunSearch(station.page);
  await search.begin(filter());
  await search.more();
  station.size = 251;
  await search.begin(filter(), true);
  expect([search.found.value[0]?.run_id, search.found.value.length]).toEqual([251, 200]);
});

test('a failure is a sentence, and the next search may succeed', async () => {
  let fails = true;
  const search = new RunSearch(async () => {
    if (fails) throw new Error('The station did not answer.');
    return [];
  });
  await search.begin(filter());
  expect([search.problem.value, search.is_busy.value]).toEqual(['The station did not answer.', false]);
  fails = false;
  await search.begin(filter());
  expect([search.problem.value, search.is_done.value]).toEqual(['', true]);
});
