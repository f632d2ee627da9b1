// What the check list says before an experiment begins, and the words for what the station reports.
import { expect, test } from 'vitest';
import type { RobotState, RunRecord } from '../../src/api';
import { account_of, type Reservation } from '../../src/experiments_api';
import { checks_of, type Check, type Outlook } from '../../src/views/experiments/checks';
import { read_profile } from '../../src/views/experiments/profile';
import { how_long, place_of_refusal, progress_text, situation, who } from '../../src/views/experiments/words';
import { experiment } from './experiment';

const robot = (change: Partial<RobotState> = {}) =>
  ({
    robot_id: 'sim-1',
    link: 'connected',
    mode: 'manual',
    emergency_id: null,
    control: null,
    fluid: null,
    sample: { duty: 0 },
    ...change,
  }) as RobotState;
const profile = (head = '') =>
  read_profile(`name = "a"\npurpose = "b"\n${head}\n[[step]]\nkind = "setpoint"\nsetpoint_m = 0.1\nfor_s = 20\n`);
const kNow_us = 1_800_000_000_000_000;

const outlook = (change: Partial<Outlook> = {}): Outlook => ({
  robot: robot(),
  profile: profile(),
  duration_s: 20,
  me: 'user:anna/session:3',
  now_us: kNow_us,
  reservations: [],
  at_work: undefined,
  queue: [],
  priority: 0,
  newest_run: null,
  ...change,
});
const check = (key: Check['key'], change: Partial<Outlook>) =>
  checks_of(outlook(change)).find((each) => each.key === key)!;

test('a robot that is at rest, free and alone has nothing to wait for', () => {
  expect(checks_of(outlook()).map(({ key, state }) => `${key} ${state}`)).toEqual([
    'connected ok',
    'rest ok',
    'control ok',
    'reservation ok',
    'queue ok',
    'fluid ok',
    'pump ok',
  ]);
});

test('what is not known is not shown as ready', () => {
  expect(check('rest', { robot: robot({ sample: null }) }).state).toBe('unknown');
  expect(check('reservation', { reservations: null }).state).toBe('unknown');
  expect(check('pump', { newest_run: undefined }).state).toBe('unknown');
});

test('what moves, is away or is latched is named with what to do', () => {
  expect(check('connected', { robot: robot({ link: 'disconnected' }) }).state).toBe('waits');
  expect(check('rest', { robot: robot({ link: 'disconnected' }) }).state).toBe('unknown');
  expect(check('rest', { robot: robot({ mode: 'auto' }) }).todo).toMatch(/Set it to manual/);
  expect(check('rest', { robot: robot({ sample: { duty: 0.2 } as RobotState['sample'] }) }).todo).toMatch(
    /End the duty/,
  );
  expect(check('rest', { robot: robot({ mode: 'emergency', emergency_id: '7' }) }).todo).toMatch(/clear the latch/);
});

test('control of this page is no obstacle, that of another one is', () => {
  const held = (holder: string) => robot({ control: { holder, taken_at_us: 0, wished_by: null } });
  expect(check('control', { robot: held('user:anna/session:3') }).state).toBe('ok');
  expect(check('control', { robot: held('user:anna/session:4') }).state).toBe('waits');
  expect(check('control', { robot: held('token:ci') }).text).toBe('token ci controls the robot.');
});

const slot = (holder: string, from_s: number, until_s: number): Reservation => ({
  reservation_id: 1,
  robot_id: 'sim-1',
  holder,
  from_us: kNow_us + from_s * 1e6,
  until_us: kNow_us + until_s * 1e6,
  purpose: '',
  made_by: '',
  made_at_us: 0,
  cancelled_at_us: null,
  cancelled_by: null,
});

test('a reservation of somebody else counts if it runs, or begins before the robot is at rest again', () => {
  const state = (...reservations: Reservation[]) => check('reservation', { reservations }).state;
  expect(state(slot('user:bert', -10, 10))).toBe('waits');
  expect(state(slot('user:bert', 24, 100))).toBe('waits');
  expect(state(slot('user:bert', 26, 100))).toBe('ok');
  expect(state(slot('user:anna', -10, 10))).toBe('ok');
  expect(check('reservation', { reservations: [slot('user:anna', -10, 10)] }).text).toMatch(/reserved for you/);
  expect(state({ ...slot('user:bert', -10, 10), cancelled_at_us: 1 })).toBe('ok');
});

test('what is before it in the queue counts by priority, and what is held does not', () => {
  const waits = (change: object) => experiment(1, change);
  expect(check('queue', { queue: [waits({})] }).text).toBe('One experiment is before it.');
  expect(check('queue', { queue: [waits({}), waits({ held: true })], at_work: waits({}) }).text).toMatch(/^2 /);
  expect(check('queue', { queue: [waits({})], priority: 1 }).state).toBe('ok');
});

test('fluid and pump are compared with what the robot is known to be in', () => {
  const water = profile('[conditions]\nfluid = "water"');
  expect(check('fluid', { profile: water }).state).toBe('unknown');
  expect(check('fluid', { profile: water, robot: robot({ fluid: 'water' }) }).state).toBe('ok');
  expect(check('fluid', { profile: water, robot: robot({ fluid: 'non_newtonian' }) }).text).toBe(
    'The robot is in non-Newtonian, the first run is in water.',
  );
  const flow = profile('[conditions]\npump = "constant"\nmean_flow_m_s = 0.04');
  const run = { pump_profile: 'constant', mean_flow_m_s: 0.04 } as RunRecord;
  expect(check('pump', { profile: flow }).state).toBe('waits');
  expect(check('pump', { profile: flow, newest_run: run }).state).toBe('ok');
  expect(check('pump', { newest_run: run }).todo).toMatch(/switch the pump off/);
});

test('an account is a user with all pages and tokens, or a page or token of its own', () => {
  expect(['user:anna/session:3', 'user:anna/token:x', 'session:3', 'token:ci'].map(account_of)).toEqual([
    'user:anna',
    'user:anna',
    'session:3',
    'token:ci',
  ]);
  expect([who('user:anna/session:3'), who('session:3'), who('session:3', 'session:3'), who('token:ci')]).toEqual([
    'anna',
    'page 3',
    'this page',
    'token ci',
  ]);
});

test('a refusal of the station points to its line, and one of a JSON document to none', () => {
  expect(place_of_refusal('profile:5:6: step[0].duty: is 2, allowed is -1 to 1')).toEqual({
    line: 5,
    text: 'step[0].duty: is 2, allowed is -1 to 1',
  });
  expect(place_of_refusal('profile: step[0].duty: is 2')).toEqual({ line: null, text: 'step[0].duty: is 2' });
});

test('progress and situation in words', () => {
  const progress = { run: 2, runs: 6, step: 1, steps: 2, elapsed_s: 12.9, duration_s: 40, goes_on_in_s: null };
  expect(progress_text({ progress })).toBe('Run 2 of 6, step 1 of 2, 12 of 40 s');
  expect(progress_text({ progress: null })).toBe('');
  expect(situation(experiment(1, { waits_for: 'emergency' })).todo).toMatch(/clear the latch/);
  expect(situation(experiment(1, { held: true, reason: 'previous_aborted' })).what).toBe(
    'It is held. The one before it was aborted.',
  );
  expect(situation(experiment(1, { state: 'aborted', reason: 'something_new' })).what).toBe('something new.');
  expect(situation(experiment(1, { state: 'done', run_counts: { done: 3 }, runs_planned: 3 })).what).toBe(
    '3 of 3 runs made.',
  );
  expect([how_long(8), how_long(68.9), how_long(193), how_long(4000)]).toEqual([
    '8 s',
    '69 s',
    '3:13 min',
    '1:06:40 h',
  ]);
});
