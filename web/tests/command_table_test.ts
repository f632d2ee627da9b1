// The commands of a robot as they are listed, and what is in force in words.
import { expect, test } from 'vitest';
import type { CommandRecord, ControllerInForce } from '../src/api';
import { newest_of } from '../src/parts/command_table';
import { controller_text } from '../src/parts/in_force';
import type { LogLine } from '../src/store';

const command = (command_id: string, more: Partial<CommandRecord> = {}) =>
  ({
    command_id,
    robot_id: 'nemo',
    kind: 'set_setpoint',
    state: 'sent',
    submitted_at_us: Number(command_id),
    ...more,
  }) as CommandRecord;
const line = (record: CommandRecord) => ({ command: record }) as LogLine;

test('what the live link says of a command replaces what was loaded, and new ones come on top', () => {
  const loaded = [command('2', { state: 'verified' }), command('1')];
  // The log has the newest line first.
  const log = [
    line(command('3', { state: 'acknowledged' })),
    line(command('3')),
    line(command('1', { state: 'verified' })),
  ];
  expect(newest_of(loaded, log, 'nemo').map(({ command_id, state }) => [command_id, state])).toEqual([
    ['3', 'acknowledged'],
    ['2', 'verified'],
    ['1', 'verified'],
  ]);
});

test('renewals of a lease and commands of other robots are left out', () => {
  const log = [line(command('5', { robot_id: 'dory' })), { command: null } as LogLine];
  expect(newest_of([command('4', { kind: 'renew_lease' }), command('1')], log, 'nemo')).toHaveLength(1);
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
  expect(controller_text({ ...said, is_current: false })).toContain('known last');
  expect(controller_text({ ...said, controller: null })).toBe('not reported since the station started');
});
