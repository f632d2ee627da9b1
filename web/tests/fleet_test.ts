// Which robots the view of the fleet lists, in which order, and what it counts.
import { expect, test } from 'vitest';
import type { RobotState } from '../src/api';
import { fleet_state_of, listed, natural_order } from '../src/fleet';
import { Robot } from '../src/robot';
import { Store } from '../src/store';
import { batch } from './fakes';

function robot(robot_id: string, change: Partial<RobotState> = {}, is_silent = false): Robot {
  const state = { link: 'connected', mode: 'manual', emergency_id: null, pending_stop: null, ...change };
  const made = new Robot({ robot_id, ...state } as RobotState, 0);
  if (!is_silent) made.receive(batch(0, 1, { robot_id }), 0);
  made.refresh(0, true);
  return made;
}

const names = (robots: Robot[]) => robots.map((each) => each.robot_id);
const all = { state: '', search: '', hidden: () => false };

test('sim-2 stands before sim-10, in every list', () => {
  expect(['sim-10', 'sim-2', 'b', 'sim-1', 'a'].sort(natural_order)).toEqual(['a', 'b', 'sim-1', 'sim-2', 'sim-10']);
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  const robots = ['sim-10', 'sim-2', 'sim-1'].map((robot_id) => robot(robot_id).state.peek());
  store.receive({ type: 'welcome', actor: '', version: '', utc_us: 0, stamp_us: 0, robots });
  expect(names(store.robots.value)).toEqual(['sim-1', 'sim-2', 'sim-10']);
});

test('each robot is in one state, the worst', () => {
  expect(fleet_state_of(robot('a'))).toBe('manual');
  expect(fleet_state_of(robot('a', { mode: 'auto' }))).toBe('auto');
  expect(fleet_state_of(robot('a', { mode: 'auto' }, true))).toBe('silent');
  expect(fleet_state_of(robot('a', { link: 'disconnected', mode: 'auto' }))).toBe('away');
  expect(fleet_state_of(robot('a', { link: 'disconnected', pending_stop: '5' }))).toBe('away');
  expect(fleet_state_of(robot('a', { mode: 'emergency', emergency_id: '1' }, true))).toBe('emergency');
  expect(fleet_state_of(robot('a', { link: 'disconnected', mode: 'emergency', emergency_id: '1' }))).toBe('emergency');
});

test('a name is found by its parts in any order, whatever their case', () => {
  const robots = [robot('Tank-A-1'), robot('tank-b-1'), robot('sim-1')];
  expect(names(listed(robots, { ...all, search: '1 TANK' }))).toEqual(['Tank-A-1', 'tank-b-1']);
  expect(names(listed(robots, { ...all, search: ' ' }))).toHaveLength(3);
});

test('the state filters, and hidden ones are listed only where they are asked for', () => {
  const robots = [robot('a'), robot('b', { link: 'disconnected' }), robot('c', { mode: 'auto' })];
  const hidden = (each: Robot) => each.robot_id === 'a';
  expect(names(listed(robots, { ...all, hidden }))).toEqual(['b', 'c']);
  expect(names(listed(robots, { ...all, state: 'hidden', hidden }))).toEqual(['a']);
  expect(names(listed(robots, { ...all, state: 'away', hidden }))).toEqual(['b']);
  expect(names(listed(robots, { ...all, state: 'connected', hidden }))).toEqual(['c']);
  expect(listed(robots, { ...all, state: 'of no kind', hidden })).toEqual([]);
});
