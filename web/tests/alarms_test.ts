// The list of what is wrong: what is in it, what is worst, and what is left out.
import { computed, signal } from '@preact/signals';
import { expect, test } from 'vitest';
import { alarms_of } from '../src/alarms';
import type { RobotState } from '../src/api';
import type { Session } from '../src/session';
import { Store } from '../src/store';
import { batch } from './fakes';

const state = (robot_id: string, change: Partial<RobotState> = {}) =>
  ({
    robot_id,
    link: 'connected',
    mode: 'manual',
    emergency_id: null,
    emergency_cause: 'none',
    pending_stop: null,
    retired: false,
    ...change,
  }) as RobotState;

function page_with(...robots: RobotState[]) {
  const world = { now_ms: 0 };
  const store = new Store({ page_ms: () => world.now_ms, utc_ms: () => 0 });
  store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots });
  store.is_current.value = true;
  const session = {
    store,
    settings: { hidden_robots: { names: signal(new Set<string>()) } },
    vitals: { now: signal({ page_ms: null, robot_ms: null, seen_ms: null as number | null }) },
    cut_off: signal<{ since_ms: number } | null>(null),
    recording: signal<{ state: string; problem: string | null } | null>(null),
  };
  const alarms = alarms_of(session as unknown as Session);
  const keys = computed(() => alarms.value.map((alarm) => alarm.key.trim()));
  for (const { robot_id } of robots) store.receive(batch(0, 5, { robot_id }));
  store.refresh();
  return { session, store, alarms, keys, world };
}

test('nothing is wrong with robots that send samples', () => {
  expect(page_with(state('a'), state('b')).keys.value).toEqual([]);
});

test('an emergency is said with its cause, and stands first', () => {
  const { alarms, store, world } = page_with(
    state('a'),
    state('b', { mode: 'emergency', emergency_id: '1', emergency_cause: 'operator' }),
  );
  world.now_ms = 600;
  store.receive(batch(5, 5, { robot_id: 'b' }));
  store.refresh();
  expect(alarms.value.map(({ level, robot_id, text }) => [level, robot_id, text])).toEqual([
    ['alarm', 'b', 'emergency, operator'],
    ['caution', 'a', 'connected, and sends no samples'],
  ]);
});

test('a robot whose own way for a stop is shut is an alarm; one that is not measured is none', () => {
  const shut = { is_open: false, round_trip_us: 1800, answered_at_us: 1 };
  const not_yet = { is_open: false, round_trip_us: null, answered_at_us: null };
  const { keys } = page_with(
    state('a', { stop_path: shut }),
    state('b', { stop_path: null }),
    state('c', { stop_path: not_yet }),
  );
  expect(keys.value).toEqual(['stop_path a']);
});

test('a page that is cut off says that, and of robots only what does not pass', () => {
  const { session, keys, world, store } = page_with(state('a'), state('b', { mode: 'emergency', emergency_id: '1' }));
  session.cut_off.value = { since_ms: 0 };
  world.now_ms = 60_000;
  store.refresh();
  expect(keys.value).toEqual(['cut_off', 'emergency b']);
});

test('one that is hidden calls while it is there, and no longer when it is away', () => {
  const latched = state('a', { mode: 'emergency', emergency_id: '1' });
  const { session, keys, store } = page_with(latched);
  session.settings.hidden_robots.names.value = new Set(['a']);
  expect(keys.value).toEqual(['emergency a']);
  store.receive({ type: 'robot', robot: { ...latched, link: 'disconnected' } });
  expect(keys.value).toEqual([]);
});

test('a stop that waits for a robot that is away is an alarm until it is acknowledged, and none of one out of use', () => {
  const away = state('a', { link: 'disconnected', pending_stop: '5' });
  const { session, alarms, keys, store } = page_with(
    away,
    state('b', { link: 'disconnected', retired: true, pending_stop: '6' }),
  );
  expect(alarms.value.map(({ level, robot_id, text }) => [level, robot_id, text])).toEqual([
    ['alarm', 'a', 'stop not acknowledged yet: kept for its return'],
  ]);
  store.receive({ type: 'robot', robot: { ...away, link: 'connected' } });
  expect(keys.value).toEqual(['emergency a']);
  store.receive({ type: 'robot', robot: away });
  session.settings.hidden_robots.names.value = new Set(['a']);
  expect(keys.value).toEqual([]);
});

test('a link that broke while the robot was driven is an alarm until it is back, retired or hidden; one at rest may go', () => {
  const driven = { ...state('a'), sample: { duty: -0.2 } } as RobotState;
  const { session, alarms, keys, store } = page_with(driven, state('b', { mode: 'auto' }), {
    ...state('c'),
    sample: { duty: 0 },
  } as RobotState);
  expect(keys.value).toEqual([]);
  const change = (robot: RobotState) => store.receive({ type: 'robot', robot });
  change({ ...driven, link: 'disconnected' });
  change(state('b', { mode: 'auto', link: 'disconnected' }));
  change({ ...state('c', { link: 'disconnected' }), sample: { duty: 0 } } as RobotState);
  expect(alarms.value.map(({ level, robot_id, text }) => [level, robot_id, text])).toEqual([
    ['alarm', 'a', 'the link broke while it was driven'],
    ['alarm', 'b', 'the link broke while it was driven'],
  ]);
  change(state('b', { mode: 'auto', link: 'disconnected', retired: true }));
  expect(keys.value).toEqual(['lost a']);
  session.settings.hidden_robots.names.value = new Set(['a']);
  expect(keys.value).toEqual([]);
  session.settings.hidden_robots.names.value = new Set();
  change(state('b', { mode: 'auto', link: 'disconnected' }));
  change(driven);
  expect(keys.value).toEqual(['lost b']);
  change(state('b', { mode: 'emergency', emergency_id: '1', link: 'disconnected' })); // its motor is off
  expect(keys.value).toEqual(['emergency b']);
});

test('that nothing is recorded is an alarm, in the station’s words', () => {
  const { session, alarms } = page_with(state('a'));
  session.recording.value = { state: 'low_space', problem: 'The disk is full: delete something.' };
  expect(alarms.value).toMatchObject([{ level: 'alarm', text: 'The disk is full: delete something.' }]);
});
