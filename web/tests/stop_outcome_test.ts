// What became of a stop of one robot and of hundreds, in words that stay short.
import { expect, test } from 'vitest';
import { Api, type CommandRecord } from '../src/api';
import { outcome_of, phase_of, words_of_all } from '../src/stop_outcome';

const record = (robot_id: string, state: CommandRecord['state'], reason = '') =>
  ({ robot_id, state, reason }) as CommandRecord;
const fleet = (size: number, state: CommandRecord['state'], name = 'tank') =>
  Array.from({ length: size }, (_, n) => record(`${name}-${n}`, state));

test('621 robots are counted, and a few are named', () => {
  const words = words_of_all(outcome_of([...fleet(3, 'acknowledged', 'rheo'), ...fleet(618, 'queued')]), '41 ms');
  expect(words).toContain('Stopped 3 of 621 robots in 41 ms.');
  expect(words).toContain('tank-0, tank-1, tank-2 and 615 more');
  expect(words.length).toBeLessThan(250);
});

test('what failed comes first, with its reason and what to do', () => {
  const outcome = outcome_of([record('a', 'acknowledged'), record('b', 'failed', 'link_lost'), record('c', 'sent')]);
  expect(phase_of(outcome)).toBe('failed');
  expect(words_of_all(outcome, '9 ms')).toMatch(/^b: the stop may not have arrived .*Press again/);
  expect(words_of_all(outcome, '9 ms')).toContain('c: not answered yet');
});

test('the worst decides, and a stop of nobody is none', () => {
  expect(phase_of(outcome_of([record('a', 'verified')]))).toBe('stopped');
  expect(phase_of(outcome_of([record('a', 'verified'), record('b', 'queued')]))).toBe('kept');
  expect(phase_of(outcome_of([record('a', 'queued'), record('b', 'sent')]))).toBe('unanswered');
  expect(phase_of(outcome_of([]))).toBe('failed');
});

const summary = {
  robots: 5,
  acknowledged: 2,
  unanswered: 0,
  failed: 1,
  kept: 0,
  left_out: 2,
  not_named: 0,
  not_acknowledged: [{ robot_id: 'b', outcome: 'failed' as const }],
};
const answer = (status: number, body: object) =>
  new Api(() => Promise.resolve(new Response(JSON.stringify(body), { status })));

test('the summary of the station is taken, also of a stop that failed for some', async () => {
  for (const status of [200, 500]) {
    const outcome = await answer(status, {
      summary,
      commands: [record('b', 'failed', 'link_lost')],
    }).emergency_stop_all('key');
    expect(outcome).toEqual({ summary, reason: 'link_lost' });
    expect(words_of_all(outcome, '9 ms')).toContain('Left out: 2 retired');
  }
});

test('a station that gives none is counted here', async () => {
  const outcome = await answer(200, { commands: fleet(4, 'acknowledged') }).emergency_stop_all('key');
  expect(outcome.summary).toMatchObject({ robots: 4, acknowledged: 4, left_out: 0 });
});

test('an answer that says nothing of robots is an error', async () => {
  await expect(answer(503, { title: 'Unavailable', detail: 'busy' }).emergency_stop_all('key')).rejects.toThrow('busy');
});
