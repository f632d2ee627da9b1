// How a line of the log reads, and which ones stand out.
import { expect, test } from 'vitest';
import type { EventRecord } from '../src/api';
import { arguments_text, describe } from '../src/parts/log_strip';

const line = (event: Partial<EventRecord>, position_sd_m: number | null = null) =>
  describe({
    key: '',
    at_ms: 0,
    robot_id: 'rheo-1',
    event: { cause: 'none', emergency_cause: null, detail: '', position_m: null, value: null, ...event } as EventRecord,
    command: null,
    note: null,
    position_sd_m,
  });

test('a position that is not known well enough stands out, and names the way out as its button does', () => {
  const [tone, , text] = line({ kind: 'position_uncertain', cause: 'limit' });
  expect(tone).toBe('caution');
  expect(text).toContain('“Zero position”');
});

test('a model that does not fit stands out; its end does not', () => {
  expect(line({ kind: 'model_mismatch' })[0]).toBe('caution');
  expect(line({ kind: 'model_mismatch_ended' })[0]).toBe('');
});

test('a position has a ±, or the line says that it is not known', () => {
  expect(line({ kind: 'mode_changed', mode: 'manual', position_m: 0.1 }, 0.002)[2]).toContain(
    'controller at 100.0 ± 4.0 mm',
  );
  expect(line({ kind: 'time_step', position_m: 0.1 })[2]).toContain('controller at 100.0 mm, ± not known');
  expect(line({ kind: 'position_zeroed', position_m: 0 })[2]).toMatch(/controller at 0.0 mm$/);
});

test('a setpoint, a disturbance and a step of the time have their size', () => {
  expect(line({ kind: 'setpoint_changed', cause: 'command', value: 0.1 })[2]).toBe(
    'setpoint changed to 100.0 mm · command',
  );
  expect(line({ kind: 'disturbance', value: -0.05 })[2]).toBe('disturbance −50.0 mm');
  expect(line({ kind: 'time_step', cause: 'time', value: 0.154 })[2]).toBe('time step of 0.15 s');
  expect(line({ kind: 'setpoint_changed', value: null })[2]).toBe('setpoint changed');
});

test('the arguments of a command have their units, and a timed one says when, at the end', () => {
  expect(arguments_text({ execute_at_robot_us: 7_370_637, mode: 'auto', setpoint_m: 0.1 })).toBe(
    ' auto 100.0 mm at 7.371 s of the robot’s clock',
  );
  expect(arguments_text({ duty: 0.3 })).toBe(' 30.0 %');
});

test('of a schedule a line has how many duties and how long they last, and no nested value is written out', () => {
  const schedule = Array.from({ length: 64 }, (_, n) => ({ tick: 5 * n, duty: n < 63 ? 0.3 : 0 }));
  expect(arguments_text({ schedule })).toBe(' 64 duties over 3.15 s');
  expect(arguments_text({ schedule: [{ tick: 0, duty: 0 }] })).toBe(' 1 duty over 0.00 s');
  expect(arguments_text({ kp: 2, pole: [0.1, 0.2] })).toBe(' 2 pole: 2');
  expect(arguments_text({ setup: { a: [1] } })).toBe(' setup {"a":[1]}');
  expect(arguments_text({ setup: { text: 'x'.repeat(500) }, note: 'y'.repeat(500) }).length).toBeLessThan(140);
  expect(arguments_text({ boot_id: null })).toBe(' null');
});
