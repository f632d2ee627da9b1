// What of a kept model goes to a robot's estimator, and what is said of what the robot holds.
import { expect, test } from 'vitest';
import type { RobotModel } from '../../src/api';
import { estimator_of } from '../../src/views/design/design_api';
import { held_text, other_origin } from '../../src/views/design/send_model';

const kEstimator = { model_gain_m_s: [1, 2, 3, 4], model_time_constant_s: [1, 2, 3, 4], fit_error: 0.001 };
const kPlant = { kp: 0.1, b1: 0.005, b2: 0.1, b3: 1, alpha: 1.7, beta: 0.9, dead_time_s: 0 };

test('a kept model is sent with its plant and its doubts; one that was typed has none, one that cannot be taken says why', () => {
  const document = { estimator: kEstimator, parameters: kPlant, doubts: [{ code: 'residuals_not_white' }] };
  expect(estimator_of({ name: 'bed', document })).toEqual({
    ...kEstimator,
    plant: kPlant,
    name: 'bed',
    doubts: [{ code: 'residuals_not_white' }],
  });
  expect(estimator_of({ name: 'bed', document: { estimator: { refused: 'it overshoots', fit_error: 0.2 } } })).toEqual({
    refused: 'it overshoots',
    fit_error: 0.2,
  });
  expect(estimator_of({ name: 'bed', document: { estimator: kEstimator, parameters: kPlant } })).toHaveProperty(
    'refused',
  );
  for (const document of [kPlant, { estimator: null }, null])
    expect(estimator_of({ name: 'bed', document })).toBe(null);
});

test('only a model that was found from runs of this robot in the fluid that it is in is sent', () => {
  const run = (run_id: number, fluid: string, robot_id = 'r1') => ({ run_id, fluid, robot_id });
  expect(other_origin([run(1, 'water'), run(2, 'water')], 'water', 'r1')).toBe(null);
  expect(other_origin([run(1, 'water')], null, 'r1')).toMatch(/^Say first which fluid/);
  expect(other_origin(null, 'water', 'r1')).toMatch(/being read/);
  expect(other_origin([], 'water', 'r1')).toMatch(/nobody can say of which fluid/);
  expect(other_origin([run(1, 'water'), run(2, '')], 'water', 'r1')).toBe(
    'It was found from run 2, of r1 in a fluid that nobody has named; r1 is in water.',
  );
  expect(other_origin([run(2, 'non_newtonian')], 'water', 'r1')).toMatch(/of r1 in non-Newtonian; r1 is in water/);
  expect(other_origin([run(2, 'water', 'r2')], 'water', 'r1')).toMatch(/of r2 in water/);
});

test('what the robot holds stands beside it, and what the station has not sent is not said to be of its fluid', () => {
  const model = (state: RobotModel['state'], reason: string, fluid: string | null = 'water'): RobotModel => ({
    state,
    fluid,
    reason,
    fit_error: fluid === null ? null : 0.0021,
    set_at_us: fluid === null ? null : 1,
  });
  expect(held_text('r1', model('confirmed', 'sent to this robot alone'))).toBe(
    'r1 holds the model of water (fit error 0.21 %), read back bit for bit: sent to this robot alone.',
  );
  expect(held_text('r1', model('confirmed', 'by a command, and of no fluid', null))).toBe(
    'The model of r1 is confirmed: by a command, and of no fluid.',
  );
  expect(held_text('r1', model('assumed', '', null))).toBe('The model of r1 is assumed.');
  expect(held_text('r1', model('assumed', 'in doubt'))).toBe(
    'r1 assumes the model of water (fit error 0.21 %): in doubt.',
  );
  expect(held_text('r1', model('failed', 'the motor is on'))).toBe(
    'r1 could not be sent the model of water (fit error 0.21 %): the motor is on.',
  );
  expect(held_text('r1', model('sending', ''))).toBe('A model is on its way to r1.');
});
