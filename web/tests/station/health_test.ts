// Which word a line of health has, at its thresholds, and that nothing is called good that is not known.

import { expect, test } from 'vitest';
import type { Recording, Station } from '../../src/api';
import { judge, lead_of, summary_of, type HealthInput, type Word } from '../../src/views/station/health';
import { Metrics } from '../../src/views/station/metrics';

const kNow_ms = Date.UTC(2026, 10, 26);
const kDay_us = 86_400e6;

const kRecording: Recording = {
  state: 'recording',
  problem: null,
  space: 'ok',
  queued_samples: 40,
  free_bytes: 74e9,
  database_bytes: 3e6,
  wal_bytes: 500e3,
  wal_held_s: 0,
  losses: [],
  clock_is_doubted: false,
  counters: {
    samples_written: 1000,
    samples_duplicate: 0,
    samples_refused: 0,
    samples_lost: 0,
    samples_given_up: 0,
    samples_returned: 0,
    records_refused: 0,
    batches_malformed: 0,
    events_asked_again: 0,
    largest_commit_samples: 100,
    commits: 20,
    commits_failed: 0,
  },
  retention: {
    retention_days: 0,
    event_retention_days: 0,
    events_purged: 0,
    max_database_bytes: 0,
    samples_purged: 0,
    bytes_returned: 0,
    longest_step_ms: 0,
    all_held: false,
  },
};
const kStation: Station = {
  version: '0.1.0',
  store_id: '1',
  utc_us: kNow_ms * 1000,
  uptime_s: 60,
  http_address: '127.0.0.1:8080',
  robots_address: '127.0.0.1:7070',
  security: { http: 'plain', robots: 'plain', exposed: false, certificate: null },
  losses: [],
};
const kMetrics = new Metrics(`rheonaut_http_connections 2
rheonaut_robot_connections 1
rheonaut_http_connections_refused_total 0
rheonaut_robot_connections_refused_total 0
rheonaut_exceptions_total{where="request"} 0
rheonaut_emergency_stop_seconds_count{stage="acknowledged"} 0`);
const kGood: HealthInput = {
  station: kStation,
  recording: kRecording,
  metrics: kMetrics,
  metrics_problem: '',
  pace: { samples_per_s: 200, commits: 20, over_s: 10 },
  fleet: { connected: 2, known: 3, silent: 0, unstoppable: 0, unmeasured: 0, samples_per_s: 200, worst_ms: 0.4 },
  is_page_measured: true,
  clock_off_ms: 3,
  now_ms: kNow_ms,
  is_current: true,
};
const line = (name: string, change: Partial<HealthInput>) => {
  const found = judge({ ...kGood, ...change }).find((each) => each.name === name);
  if (!found) throw new Error(`no line ${name}`);
  return found;
};
const word = (name: string, change: Partial<HealthInput>): Word => line(name, change).word;
const recording = (change: Partial<Recording>) => ({ recording: { ...kRecording, ...change } });
const counters = (change: Partial<Recording['counters']>) =>
  recording({ counters: { ...kRecording.counters, ...change } });
const fleet = (change: Partial<HealthInput['fleet']>) => ({ fleet: { ...kGood.fleet, ...change } });

test('all is well when nothing is wrong', () => {
  expect(summary_of(judge(kGood))).toEqual({ word: 'good', text: 'all is well', off: [] });
});

test('SAFETY: nothing is good while the page is cut off, and no value is dropped', () => {
  const lines = judge({ ...kGood, is_current: false });
  expect(new Set(lines.map((each) => each.word))).toEqual(new Set(['unknown']));
  expect(lines.find(({ name }) => name === 'recording')?.value).toBe('everything is recorded');
  expect(summary_of(lines).text).toBe('not known now');
});

test('SAFETY: what is not measured yet is not called well', () => {
  expect(word('stop', { is_page_measured: false })).toBe('unknown');
  expect(summary_of(judge({ ...kGood, is_page_measured: false }))).toMatchObject({
    word: 'unknown',
    text: '1 not known yet',
  });
  expect(summary_of(judge({ ...kGood, recording: null })).word).toBe('unknown');
});

test('the way of a stop is bad to one robot, and a caution where it is not measured', () => {
  expect(line('stop', fleet({ unstoppable: 1 }))).toMatchObject({ word: 'bad', value: 'closed to 1 of 2' });
  expect(word('stop', fleet({ unmeasured: 1 }))).toBe('caution');
  expect(word('stop', fleet({ connected: 0, unmeasured: 0 }))).toBe('good');
});

test('a recording that fails is bad and says what the station says', () => {
  expect(line('recording', recording({ state: 'failing', problem: 'The disk is full.' }))).toMatchObject({
    word: 'bad',
    note: 'The disk is full.',
  });
  expect(word('recording', recording({ state: 'low_space', problem: 'Make room.' }))).toBe('caution');
});

test('samples that wait are judged by how long they take to come', () => {
  expect(word('queue', recording({ queued_samples: 400 }))).toBe('good'); // 2 s of 200 a second
  expect(word('queue', recording({ queued_samples: 402 }))).toBe('caution');
  expect(word('queue', recording({ queued_samples: 1602 }))).toBe('bad'); // a robot keeps 8 s
});

test('robots that send and no commit: nothing is written', () => {
  const pace = { samples_per_s: 0, commits: 0, over_s: 10 };
  expect(word('writes', { pace })).toBe('bad');
  expect(word('writes', { pace, ...fleet({ connected: 0, samples_per_s: 0 }) })).toBe('good');
  expect(word('writes', { pace: null })).toBe('unknown');
  expect(word('writes', counters({ commits_failed: 1 }))).toBe('caution');
});

test('losses are a caution, and of the database bad', () => {
  expect(word('lost', counters({ samples_lost: 1 }))).toBe('caution');
  expect(word('records', counters({ records_refused: 1 }))).toBe('bad');
  expect(word('records', counters({ batches_malformed: 1 }))).toBe('caution');
  const losses = [{ noticed_at_us: kNow_ms * 1000, problem: 'It holds 3 of 5.' }];
  expect(line('database', { station: { ...kStation, losses } })).toMatchObject({ word: 'bad' });
});

test('the disk: its state by the station, and how long it lasts by the pace', () => {
  expect(line('disk', {}).value).toBe('74.0 GB, enough for about 64 days');
  expect(word('disk', recording({ space: 'low' }))).toBe('caution');
  expect(word('disk', recording({ space: 'critical' }))).toBe('bad');
  expect(word('log', recording({ wal_held_s: 11 }))).toBe('caution');
});

test('the room left is what max_database_mb or the disk leaves, whichever is less', () => {
  const { retention } = kRecording;
  const limited = (max_database_bytes: number, change: Partial<Recording> = {}) =>
    line('disk', recording({ database_bytes: 10e9, retention: { ...retention, max_database_bytes }, ...change }));
  expect(limited(21.4e9)).toMatchObject({
    word: 'good',
    value: '74.0 GB; the database may grow by 11.4 GB, enough for about 9 days',
    note: 'Near 21.4 GB its oldest samples outside runs are removed.',
  });
  expect(limited(200e9).value).toBe('74.0 GB, enough for about 64 days'); // the disk is full before
  expect(limited(9e9).value).toBe('74.0 GB; the database may grow by 0 B');
  expect(limited(21.4e9, { space: 'low' }).word).toBe('caution');
  const all_held = { ...retention, max_database_bytes: 9e9, all_held: true };
  expect(line('disk', recording({ database_bytes: 10e9, retention: all_held }))).toMatchObject({
    word: 'caution',
    value: '74.0 GB, enough for about 64 days',
  });
});

test('a certificate is judged by its last day, and plain TCP beyond this machine is bad', () => {
  const with_days = (days: number): Partial<HealthInput> => ({
    station: {
      ...kStation,
      security: {
        http: 'tls',
        robots: 'tls',
        exposed: false,
        certificate: {
          names: ['lab'],
          pin_sha256: 'ab',
          not_after_us: kNow_ms * 1000 + days * kDay_us,
          expires_soon: days < 30,
        },
      },
    },
  });
  expect(word('security', with_days(300))).toBe('good');
  expect(word('security', with_days(29))).toBe('caution');
  expect(word('security', with_days(-1))).toBe('bad');
  expect(word('security', { station: { ...kStation, security: { ...kStation.security, exposed: true } } })).toBe('bad');
});

test('silent robots, slow links, refused connections, faults and a wrong clock are cautions', () => {
  expect(word('robots', fleet({ silent: 1 }))).toBe('caution');
  expect(word('links', fleet({ worst_ms: 251 }))).toBe('caution');
  expect(word('links', fleet({ worst_ms: 250 }))).toBe('good');
  const figures = (text: string) => ({ metrics: new Metrics(text) });
  expect(word('faults', figures('rheonaut_exceptions_total{where="model"} 1'))).toBe('caution');
  expect(word('faults', figures(''))).toBe('unknown');
  expect(
    word(
      'connections',
      figures('rheonaut_http_connections 1\nrheonaut_robot_connections 0\nrheonaut_http_connections_refused_total 4'),
    ),
  ).toBe('caution');
  expect(word('clock', { clock_off_ms: -1500 })).toBe('caution');
  expect(word('clock', { recording: { ...kRecording, clock_is_doubted: true } })).toBe('caution');
  expect(line('clock', { clock_off_ms: -90_000 }).value).toBe('1 min behind this machine’s');
});

test('worst first counts: bad before what is to be looked at', () => {
  const lines = judge({ ...kGood, ...fleet({ unstoppable: 1, silent: 1 }) });
  expect(summary_of(lines)).toMatchObject({ word: 'bad', text: '1 bad, 1 to look at' });
});

test('SAFETY: nothing needs you only where every line is known', () => {
  expect(lead_of(judge(kGood))).toMatch(/^Nothing needs you\./);
  const without_figures = judge({ ...kGood, metrics: null, metrics_problem: 'The station answered 503 to /metrics.' });
  expect(lead_of(without_figures)).toBe(
    'What is known is well. Not known: Stops until now, Faults inside, Connections.',
  );
  expect(without_figures.find(({ name }) => name === 'faults')).toMatchObject({
    word: 'unknown',
    note: 'Not read: The station answered 503 to /metrics.',
  });
  expect(lead_of(judge({ ...kGood, ...fleet({ silent: 1 }), pace: null }))).toBe(
    'Look at: Robots. Not known: Writes to the disk.',
  );
});
