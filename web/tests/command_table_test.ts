// The commands of a robot as they are listed, and what is in force: each as the newest, and no longer as the present than it is.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { CommandRecord, ControllerInForce, LiveMessage, ParametersInForce, RobotState } from '../src/api';
import { controller_text, known_text } from '../src/parts/in_force';
import { renewals_text } from '../src/parts/log_strip';
import { LogPanel } from '../src/parts/log_panel';
import { NewestCommands } from '../src/parts/newest_commands';
import type { Session } from '../src/session';
import { kLogLines, Store } from '../src/store';
import { fake_document, FakeNode } from './fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const command = (command_id: string, more: Partial<CommandRecord> = {}) =>
  ({
    command_id,
    robot_id: 'nemo',
    kind: 'set_setpoint',
    arguments: {},
    actor: 'token:local',
    state: 'sent',
    reason: '',
    submitted_at_us: Number(command_id),
    sent_after_us: null,
    acknowledged_after_us: null,
    verified_after_us: null,
    ...more,
  }) as CommandRecord;
const states_of = (known: NewestCommands) => known.list.value?.map(({ command_id, state }) => `${command_id} ${state}`);

test('what the live link says of a command replaces what was loaded, and new ones come on top', () => {
  const known = new NewestCommands('nemo');
  known.take_answer([command('2', { state: 'verified' }), command('1')]);
  for (const said of [command('3'), command('1', { state: 'verified' }), command('3', { state: 'acknowledged' })])
    known.report(said);
  expect(states_of(known)).toEqual(['3 acknowledged', '2 verified', '1 verified']);
});

test('an answer replaces what it is newer than, and nothing that was said since it was asked for', () => {
  const known = new NewestCommands('nemo');
  known.report(command('1'));
  known.ask();
  known.report(command('2', { state: 'verified' }));
  expect(known.list.value).toBeNull();
  known.take_answer([command('2'), command('1', { state: 'verified' })]);
  expect(states_of(known)).toEqual(['2 verified', '1 verified']);
});

test('renewals in a row say how many they were, or that nobody knows', () => {
  const renewal = (more: Partial<CommandRecord>) => renewals_text(command('1', { kind: 'renew_lease', ...more }));
  expect(renewals_text(command('1'))).toBe('');
  expect(renewal({ further_renewals: 0, last_renewed_at_us: null })).toBe('');
  const last_renewed_at_us = new Date(2026, 10, 27, 12, 3, 4).getTime() * 1000;
  expect(renewal({ further_renewals: 1412, last_renewed_at_us })).toMatch(/^ and 1.412 more until 12:03:04/);
  expect(renewal({ further_renewals: null, last_renewed_at_us: null })).toBe(' and more, not counted yet');
  expect(renewal({ further_renewals: null, last_renewed_at_us: null, reason: 'station_restarted' })).toBe(
    ' and an unknown number more',
  );
});

test('renewals of a lease and commands of other robots are left out', () => {
  const known = new NewestCommands('nemo');
  known.take_answer([command('1')]);
  known.report(command('4', { kind: 'renew_lease', state: 'failed' }));
  known.report(command('5', { robot_id: 'dory' }));
  expect(states_of(known)).toEqual(['1 sent']);
});

const robot = { robot_id: 'nemo', link: 'connected', mode: 'auto', fluid: null, model: { state: 'none' } };
const is_current = { is_current: true };

function drawn(tab: 'commands' | 'in-force', state: object = robot) {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  const robots = [{ emergency_id: null, pending_stop: null, ...state } as unknown as RobotState];
  store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots });
  store.is_current.value = true;
  store.refresh();
  const answers = {
    commands: [command('1')],
    parameters: { ...is_current, told_at_us: 0, parameters: null } as unknown as ParametersInForce,
    controller: { ...is_current, controller: { kp: 20, period_us: 10_000 } } as unknown as ControllerInForce,
  };
  const api = {
    robot_commands: vi.fn(() => Promise.resolve(answers.commands)),
    robot_parameters: vi.fn(() => Promise.resolve(answers.parameters)),
    robot_controller: vi.fn(() => Promise.resolve(answers.controller)),
  };
  const phase = signal('live');
  const session = { store, api, phase } as unknown as Session;
  const page = new FakeNode(1, 'body');
  render(h(LogPanel, { session, robot: store.selected.value }), page as unknown as Element);
  page.find(`log-tab-${tab}`)!.fire('Click');
  const receive = async (message: LiveMessage) => {
    store.receive(message);
    store.refresh();
    await vi.advanceTimersByTimeAsync(100);
  };
  return { page, store, api, answers, phase, receive, text: () => page.find('log-page')!.text };
}

test('a row stays, with its newest state, however much is logged after it', async () => {
  const { receive, text } = drawn('commands');
  await vi.advanceTimersByTimeAsync(200);
  await receive({ type: 'command', command: command('2', { arguments: { setpoint_m: 0.077 } }) });
  await receive({ type: 'command', command: command('1', { state: 'verified' }) });
  for (let at = 0; at <= kLogLines; ++at)
    await receive({ type: 'command', command: command(`${100 + at}`, { robot_id: 'dory' }) });
  expect(text()).toContain('77.0 mm');
  expect(text()).toMatch(/token:localverified/);
});

test('with another connection the commands are asked for again', async () => {
  const { api, answers, phase, text } = drawn('commands');
  await vi.advanceTimersByTimeAsync(200);
  phase.value = 'waiting';
  answers.commands = [command('1', { state: 'verified' })];
  await vi.advanceTimersByTimeAsync(200);
  expect(text()).toMatch(/token:localsent/);
  phase.value = 'live';
  await vi.advanceTimersByTimeAsync(200);
  expect(api.robot_commands).toHaveBeenCalledTimes(2);
  expect(text()).toMatch(/token:localverified/);
});

test.each(['commands', 'in-force'] as const)('cut off, %s is what was known last', async (tab) => {
  const { page, store, text } = drawn(tab);
  await vi.advanceTimersByTimeAsync(200);
  expect(text()).not.toContain('known last');
  store.is_current.value = false;
  await vi.advanceTimersByTimeAsync(200);
  expect(text()).toContain('Cut off from the station: this was known last.');
  expect(page.find('log-page')!.attributes['class']).toContain('stale');
});

test('of a robot that has just connected it is asked for again until the robot has reported it', async () => {
  const { api, answers, text } = drawn('in-force');
  answers.controller = { ...answers.controller, is_current: false };
  await vi.advanceTimersByTimeAsync(200);
  expect(text()).toContain('every 10 ms · duty – to – · known last: the robot has not reported it again yet');
  answers.controller = { ...answers.controller, is_current: true };
  await vi.advanceTimersByTimeAsync(1200);
  expect(text()).not.toContain('known last');
  await vi.advanceTimersByTimeAsync(5000);
  expect(api.robot_controller).toHaveBeenCalledTimes(2);
});

test('of a robot that is away it is said, and not asked for again', async () => {
  const { api, answers, text } = drawn('in-force', { ...robot, link: 'disconnected' });
  answers.controller = { ...answers.controller, is_current: false };
  await vi.advanceTimersByTimeAsync(5000);
  expect(text()).toContain('the robot is away');
  expect(api.robot_controller).toHaveBeenCalledTimes(1);
});

test('whatever was reported, while the page is cut off it is not the present', () => {
  expect(known_text('connected', { is_current: true }, true)).toBe('');
  expect(known_text('connected', { is_current: true }, false)).toContain('known last');
  expect(known_text('disconnected', { is_current: true }, true)).toContain('known last');
});

test('a controller in words', () => {
  const said = {
    is_current: true,
    controller: {
      controller_id: 7,
      period_us: 10_000,
      kp: 29.964,
      direct: 1,
      pole: [1, 2, 3],
      duty_min: -1,
      duty_max: 1,
    },
  } as ControllerInForce;
  expect(controller_text(said)).toBe('number 7 · kp 29.964, 3 first-order sections · every 10 ms · duty \u22121 to 1');
  expect(controller_text({ ...said, controller: null })).toBe('not reported since the station started');
});
