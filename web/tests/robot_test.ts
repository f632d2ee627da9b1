// What the page says of the model behind a position's "±", and of limits that were changed.
import { expect, test } from 'vitest';
import type { RobotModel } from '../src/api';
import { model_notice } from '../src/parts/model_line';
import { changed_limits_of, model_of } from '../src/robot';

test('an estimate says whether its model is assumed, confirmed or does not fit; a known position has none', () => {
  expect(model_of(0, 0.004)).toBe('model assumed');
  expect(model_of(64, 0.004)).toBe('model confirmed');
  expect(model_of(64 | 128, 0.004)).toBe('model does not fit');
  expect(model_of(2 | 128, null)).toBe('model does not fit');
  expect(model_of(0, 0)).toBe('');
});

test('limits that are not at their default stand in one line, and nothing where there are none', () => {
  expect(changed_limits_of({ changed_limits: [] })).toBe('');
  const far = { name: 'position_limit_max_m', unit: 'm', value: 0.2, default: 100 };
  expect(changed_limits_of({ changed_limits: [far] })).toBe(
    'Changed limits: position_limit_max_m 0.2 m (default 100 m)',
  );
  const action = { name: 'link_loss_action', unit: '', value: 2, default: 0 };
  expect(changed_limits_of({ changed_limits: [far, action] })).toBe(
    'Changed limits: position_limit_max_m 0.2 m (default 100 m), link_loss_action 2 (default 0)',
  );
});

const model_state = (state: RobotModel['state'], fluid: string | null = null, reason = ''): RobotModel => ({
  state,
  fluid,
  reason,
  fit_error: fluid === null ? null : 0.0021,
  set_at_us: fluid === null ? null : 1,
});

test('it names the fluid whose model the station has sent, and whether that holds', () => {
  expect(model_of(64, 0.004, model_state('confirmed', 'water'))).toBe('model of water, confirmed');
  expect(model_of(64 | 128, 0.004, model_state('confirmed', 'water'))).toBe('model of water does not fit');
  expect(model_of(64, 0.004, model_state('confirmed'))).toBe('model confirmed');
  expect(model_of(0, 0.004, model_state('sending', 'non_newtonian'))).toBe('model of non-Newtonian being sent');
  expect(model_of(0, 0.004, model_state('failed', 'water', 'the motor is on'))).toBe(
    'model of water could not be sent',
  );
  // A former model of water, or the one that is being confirmed.
  expect(model_of(64, 0.004, model_state('sending', 'water'))).toBe('model of water being sent');
  expect(model_of(64, 0.004, model_state('sending', null))).toBe('model confirmed for another fluid');
  expect(model_of(64, 0.004, model_state('failed', null, 'x'))).toBe('model confirmed for another fluid');
  expect(model_of(0, 0.004, model_state('confirmed', 'water'))).toBe('model assumed'); // telemetry has the last word
});

test('beside the fluid stands what became of its model, and nothing where there is none', () => {
  expect(model_notice(model_state('assumed'), 'water', false)).toBe('');
  expect(model_notice(model_state('assumed'), 'water', true)).toBe('The model of water is not in force.');
  expect(model_notice(model_state('assumed', null, 'the robot has booted: name its fluid again'), 'water', true)).toBe(
    'The model of water is not in force: the robot has booted: name its fluid again.',
  );
  expect(model_notice(model_state('failed', 'water', 'the motor is on'), 'water', true)).toBe(
    'The model of water could not be sent: the motor is on.',
  );
  expect(model_notice(model_state('confirmed', 'water'), 'water', true)).toBe(
    'The model of water is in force, fit error 0.21 %.',
  );
  expect(model_notice(model_state('confirmed', 'water', 'sent to this robot alone'), 'water', false)).toBe(
    'The model of water is in force, fit error 0.21 %: sent to this robot alone.',
  );
  expect(model_notice({ ...model_state('assumed', 'water', 'in doubt') }, 'water', false)).toBe(
    'The model of water is not in force: in doubt.',
  );
  expect(model_notice(model_state('sending'), null, false)).toBe(
    'The confirmation of the model before is being taken back.',
  );
});
