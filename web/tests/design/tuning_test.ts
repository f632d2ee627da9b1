// What is asked of a controller, the map of what can be asked, its plots, and a measured step beside its prediction.
import { expect, test } from 'vitest';
import { kNothing } from '../../src/views/design/address';
import { rounded, with_specification } from '../../src/views/design/ask';
import type { MapPoint, Predicted } from '../../src/views/design/design_api';
import { log_splits, path_of, place_of } from '../../src/views/design/graph';
import { identify_body } from '../../src/views/design/identify_step';
import { float_text, push_state } from '../../src/views/design/push_step';
import { is_in_region, regions_of } from '../../src/views/design/region_map';
import { line_of } from '../../src/views/design/step_plots';
import { inside, summary_of } from '../../src/views/design/tune_result';
import { tune_body } from '../../src/views/design/tune_step';
import { controller_note, predicted_for, verify_state } from '../../src/views/design/verify_step';
import { fixed_text, infeasible_text, number_text, state_of } from '../../src/views/design/words';

test('what a hand asks is rounded and stays within the sliders', () => {
  expect(rounded({ crossover_rad_s: 3.0159, phase_margin_deg: 90.04 })).toEqual({
    crossover_rad_s: 3.02,
    phase_margin_deg: 90,
  });
  expect(rounded({ crossover_rad_s: 0.1, phase_margin_deg: 175 })).toEqual({
    crossover_rad_s: 0.5,
    phase_margin_deg: 170,
  });
  expect(inside({ crossover_rad_s: 65, phase_margin_deg: 28.661 })).toEqual({
    crossover_rad_s: 65,
    phase_margin_deg: 28.6,
  });
});

test('another question takes the controller out that was kept for the old one', () => {
  const design = { ...kNothing, model: 1, controller: 8, verified: 9 };
  expect(with_specification(design, { crossover_rad_s: 3, phase_margin_deg: 90 })).toBe(design);
  expect(with_specification(design, { crossover_rad_s: 2, phase_margin_deg: 90 })).toMatchObject({
    crossover_rad_s: 2,
    controller: null,
    verified: null,
    model: 1,
  });
});

test('the jobs are asked as the design says, with the duty range of the robot', () => {
  expect(tune_body(kNothing, null)).toBeNull();
  expect(tune_body({ ...kNothing, model: 5 }, null)).toEqual({
    kind: 'tune',
    model_id: 5,
    crossover_rad_s: 3,
    phase_margin_deg: 90,
  });
  const in_force = { period_us: 10_000, kp: 65, direct: 117, duty_min: 0, duty_max: 1 };
  expect(tune_body({ ...kNothing, fluid: 'water' }, in_force)).toMatchObject({
    fluid: 'water',
    duty_min: 0,
    duty_max: 1,
    period_s: 0.01,
  });
  expect(tune_body({ ...kNothing, paper: '28' }, null)).toMatchObject({ plant: { kp: 232, alpha: 2 } });
  expect(identify_body({ ...kNothing, runs: [3], to_s: 60, validation: 3 })).toEqual({
    kind: 'identify',
    run_id: 3,
    from_s: 0,
    to_s: 60,
    cut_at_gaps: true,
    residuals: true,
    validation_run_id: 3,
    validation_from_s: 60,
  });
  expect(
    identify_body({ ...kNothing, runs: [3, 4], structure: 'fractional', limit_s: 90, validation: 5 }),
  ).toMatchObject({
    runs: [
      { run_id: 3, from_s: 0 },
      { run_id: 4, from_s: 0 },
    ],
    structure: 'fractional',
    time_limit_s: 90,
    validation_run_id: 5,
  });
});

const point = (crossover_rad_s: number, ranges_deg: [number, number][], reason = 'feasible'): MapPoint => ({
  crossover_rad_s,
  ranges_deg,
  reason,
  phase_fall: 0.2,
});
const map = [
  point(1, [[89, 170]]),
  point(2, [[88, 158]]),
  point(7, [], 'phase_falls_too_fast'),
  point(50, [], 'phase_falls_too_fast'),
  point(60, [[5, 19]]),
];

test('neighbours whose ranges overlap are one region of the map', () => {
  expect(regions_of(map).map((region) => region.map(({ crossover_rad_s }) => crossover_rad_s))).toEqual([[1, 2], [60]]);
  const split = regions_of([
    point(1, [[10, 90]]),
    point(2, [
      [10, 30],
      [60, 90],
    ]),
  ]);
  expect(split.map((region) => region.length)).toEqual([2, 1]);
});

test('what is asked lies in the region or not, and the gaps are told with their reason', () => {
  expect(is_in_region(map, { crossover_rad_s: 1.2, phase_margin_deg: 90 })).toBe(true);
  expect(is_in_region(map, { crossover_rad_s: 1.2, phase_margin_deg: 60 })).toBe(false);
  expect(is_in_region(map, { crossover_rad_s: 20, phase_margin_deg: 60 })).toBe(false);
  expect(is_in_region([], { crossover_rad_s: 20, phase_margin_deg: 60 })).toBeNull();
  expect(infeasible_text(map)).toEqual(['7 to 50 rad/s: the phase of the model falls too fast to be made flat.']);
});

test('a point of a graph is where its axes say, and a press on it says the same values', () => {
  const x = { from: 0.1, to: 100, is_log: true, text: String };
  const y = { from: -60, to: 60, text: String };
  const place = place_of(x, y, 456, 228);
  expect(place.x(0.1)).toBe(place.left);
  expect(place.x(100)).toBeCloseTo(place.right, 9);
  expect(place.x(Math.sqrt(10))).toBeCloseTo((place.left + place.right) / 2, 9);
  expect(place.y(60)).toBe(place.top);
  expect(place.at_x(place.x(3))).toBeCloseTo(3, 9);
  expect(place.at_y(place.y(-12))).toBeCloseTo(-12, 9);
  expect(place.at_x(-50)).toBeCloseTo(0.1, 12);
  expect(log_splits(0.1, 100, false)).toEqual([0.1, 1, 10, 100]);
  expect(log_splits(0.5, 10, true)).toEqual([0.5, 1, 2, 5, 10]);
  expect(
    path_of(place, [
      [0.1, 60],
      [1, NaN],
      [100, -60],
    ]),
  ).toBe('M46.0 8.0M446.0 208.0');
});

test('a curve begins at its step, and has few points', () => {
  const t_s = Array.from({ length: 4001 }, (_, at) => at / 100);
  const line = line_of({ t_s, position_m: t_s.map((time) => time * 2), duty: t_s }, 20, 5);
  expect(line[0]).toEqual([0, 40]);
  expect(line.at(-1)![0]).toBeCloseTo(5, 1);
  expect(line.length).toBeLessThanOrEqual(400);
});

test('a step is compared with the prediction of its cause and size only', () => {
  const measures = { settling_s: 1, overshoot_percent: 0, rise_10_90_s: 1, steady_state_error_m: 0 };
  const predicted = {
    step: measures,
    disturbance: { ...measures, settling_s: 2 },
    experiment: { setpoint_m: 0.1, disturbance_m: -0.05 },
  } as Predicted;
  expect(predicted_for({ cause: 'setpoint', start_m: 0, target_m: 0.1 }, predicted)?.settling_s).toBe(1);
  expect(predicted_for({ cause: 'disturbance', start_m: 0.051, target_m: 0.1 }, predicted)?.settling_s).toBe(2);
  expect(predicted_for({ cause: 'setpoint', start_m: 0.05, target_m: 0.1 }, predicted)).toBeNull();
  expect(predicted_for({ cause: 'setpoint', start_m: 0, target_m: 0.1 }, undefined)).toBeNull();
});

test('a step is called done only when the robot reports it now', () => {
  const situation = {
    design: { ...kNothing, controller: 8 },
    robot_id: 'sim-1',
    runs_it: true,
    is_current: true,
    pending: '',
    problem: '',
  };
  expect(push_state(situation).kind).toBe('done');
  expect(push_state({ ...situation, is_current: false })).toMatchObject({ kind: 'ready', text: /not known/ as never });
  expect(push_state({ ...situation, runs_it: false }).kind).toBe('ready');
  const problem = 'somebody else is in control';
  expect(push_state({ ...situation, runs_it: false, problem }).kind).toBe('failed');
  expect(push_state({ ...situation, problem }).kind).toBe('done'); // it runs, whatever failed before
  expect(push_state({ ...situation, design: kNothing }).kind).toBe('needs');
});

test('a float32 is written with as few digits as tell it from the next', () => {
  expect(float_text(Math.fround(30.0669496))).toBe('30.06695');
  expect(float_text(Math.fround(30.06694960048445))).toBe('30.06695');
  expect(float_text(Math.fround(-0.1))).toBe('−0.1');
  expect(float_text(Math.fround(448.58384))).not.toBe(float_text(Math.fround(448.58387)));
  expect(float_text(null)).toBe('–');
});

test('states, numbers and robustness in words', () => {
  const idle = {
    phase: 'idle',
    key: '',
    job_id: null,
    share: 0,
    stage: '',
    took_s: null,
    result: null,
    error: '',
  } as const;
  expect(state_of(idle, { kind: 'ready', text: 'ready' }).text).toBe('ready');
  expect(state_of({ ...idle, phase: 'running', share: 0.4 }, { kind: 'ready', text: '' }).text).toBe('running, 40 %');
  expect(state_of({ ...idle, phase: 'done', took_s: 2.14 }, { kind: 'ready', text: '' })).toEqual({
    kind: 'done',
    text: 'done in 2.1 s',
  });
  expect(state_of({ ...idle, phase: 'failed', error: 'no run 9' }, { kind: 'ready', text: '' }).text).toBe(
    'failed: no run 9',
  );
  expect(number_text(-0.00000123)).toBe('−1.23e−6');
  expect(number_text(null)).toBe('–');
  expect(fixed_text(-0.0001, 2)).toBe('0.00');
  expect(summary_of([{ is_stable: true, is_diverging: false }])).toBe('Stable in all 1 cases.');
  expect(
    summary_of([
      { is_stable: true, is_diverging: false },
      { is_stable: false, is_diverging: false },
    ]),
  ).toBe('Not stable in 1 of 2 cases.');
});

test('a run is compared with the controller that it was made with, whoever sent it, also after a reload', () => {
  expect(controller_note(12, [14, 12, 9, 7])).toBe('');
  expect(controller_note(11, [14, 12, 9, 7])).toMatch(/not known to be made with this controller; .* run 14, 12, 9\.$/);
  expect(controller_note(11, [])).toMatch(/^No run is known/);
});

test('a run whose position is less exact than the band is not said to have verified anything', () => {
  const design = { ...kNothing, verified: 12 };
  const position_doubt = '± 60 mm is 30 times the band';
  const said = (...steps: Parameters<typeof verify_state>[3]) => verify_state(design, 'sim-1', '', steps).text;
  expect(said({ position_source: 'estimate', position_doubt: '' }, { position_source: 'known' })).toBe('run 12');
  expect(said({ position_source: 'outside', position_doubt })).toBe('run 12'); // which says where, less exactly
  expect(said({ position_source: 'known' }, { position_source: 'estimate', position_doubt })).toBe(
    'run 12, which does not tell where the robot was',
  );
});
