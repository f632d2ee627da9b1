// What a run of a profile is expected to do, computed on the page while somebody types: the commands on a model of the
// robot, at its tick. The station computes its own prediction before the run, on the model in use; that one is stored.
//
//   v = Σ_i y_i,  y_i → p_i y_i + g_i (1 - p_i) u,  p_i = e^(-dt/T_i),  x = ∫v dt          (1)  exact for u held over dt
//   manual: u = duty;  auto: u = clamp(G(z)(setpoint - (x + disturbance)))                 (2)  running_law.ts
//
// Accuracy: the model of (1) has four sections in place of a fractional order; those of the paper's models follow its
// velocity to 0.15 % of the final one. preview_test.ts compares it with what `rheonaut profile` prints.

import type { CommandLimits, Controller } from '../../experiments_api';
import { fluid_text, millimetres, percent } from '../../format';
import { RunningLaw } from '../../running_law';
import { kTick_s, variants_of, type Profile, type Variant } from './profile';
import { time_line_of, type TimeLine } from './time_line';

export interface Sections {
  model_gain_m_s: readonly number[];
  model_time_constant_s: readonly number[];
}

// `rheonaut estimator --plant` of the paper's models (28), in water, and (29), elsewhere.
export const kPaperModels: Record<'(28)' | '(29)', Sections> = {
  '(28)': { model_gain_m_s: [-0.16584274, 0.5136167], model_time_constant_s: [0.021999212, 0.068135835] },
  '(29)': {
    model_gain_m_s: [0.17528348, 0.005708003, -0.08149438, 0.0007592046],
    model_time_constant_s: [0.060164522, 0.66945624, 0.02949439, 41.488876],
  },
};

export interface Track {
  t_s: number[];
  position_m: (number | null)[];
  duty: (number | null)[];
  setpoint_m: (number | null)[]; // null in manual
  position_sd_m?: (number | null)[] | null;
}

export interface RunPreview {
  variant: Variant;
  line: TimeLine;
  duration_s: number;
  position_min_m: number;
  position_max_m: number;
  travel_m: number;
  problems: string[]; // in words; each names the step
}

const kPowerDuty = 0.9;
const kDiverged_m = 1e3;
export const kMostPoints = 2000; // of a track

// Calls on_tick after each tick with what holds at its beginning; false ends it.
type OnTick = (tick: number, position_m: number, duty: number, setpoint_m: number | null) => boolean;

function simulate(line: TimeLine, model: Sections, controller: Controller | null, on_tick: OnTick): void {
  const law = controller && new RunningLaw(controller, controller.duty_min ?? -1, controller.duty_max ?? 1);
  const used = model.model_gain_m_s
    .map((gain, i) => ({ gain, time_s: model.model_time_constant_s[i] ?? 1 }))
    .filter(({ gain }) => gain !== 0);
  const poles = used.map(({ time_s }) => Math.exp(-kTick_s / time_s));
  const y = new Float64Array(used.length);
  let [position_m, is_auto, manual_duty, setpoint_m, disturbance_m, next] = [0, false, 0, 0, 0, 0];
  const limit = (duty: number) => Math.min(controller?.duty_max ?? 1, Math.max(controller?.duty_min ?? -1, duty));
  for (let tick = 0; tick <= line.ticks; ++tick) {
    for (; next < line.actions.length && line.actions[next]!.tick <= tick; ++next) {
      const { kind, value } = line.actions[next]!;
      if (kind === 'duty') [is_auto, manual_duty] = [false, value];
      else if (kind === 'disturbance') disturbance_m = value;
      else {
        if (!is_auto) law?.reset();
        [is_auto, setpoint_m] = [true, value];
      }
    }
    const duty = is_auto && law ? law.step(setpoint_m - position_m - disturbance_m) : limit(is_auto ? 0 : manual_duty);
    if (!on_tick(tick, position_m, duty, is_auto ? setpoint_m : null)) return;
    for (let i = 0; i < used.length; ++i) {
      const { gain, time_s } = used[i]!;
      const rest = y[i]! - gain * duty; // decays; the integral of the section over the tick is exact
      position_m += gain * duty * kTick_s + rest * time_s * (1 - poles[i]!);
      y[i] = gain * duty + rest * poles[i]!;
    }
  }
}

export function track_of(line: TimeLine, model: Sections, controller: Controller | null): Track {
  const every = Math.ceil((line.ticks + 1) / kMostPoints);
  const track: Track = { t_s: [], position_m: [], duty: [], setpoint_m: [] };
  simulate(line, model, controller, (tick, position_m, duty, setpoint_m) => {
    if (tick % every === 0) {
      track.t_s.push(tick * kTick_s);
      track.position_m.push(position_m);
      track.duty.push(duty);
      track.setpoint_m.push(setpoint_m);
    }
    return Math.abs(position_m) < kDiverged_m;
  });
  return track;
}

export function preview_run(
  profile: Profile,
  variant: Variant,
  model: Sections,
  controller: Controller | null,
): RunPreview {
  const line = time_line_of(profile, variant);
  const found: RunPreview = {
    variant,
    line,
    duration_s: line.ticks * kTick_s,
    position_min_m: 0,
    position_max_m: 0,
    travel_m: 0,
    problems: [],
  };
  const bounds = bounds_of(profile);
  let [before_m, at_power, longest_at_power] = [0, 0, 0];
  simulate(line, model, controller, (tick, position_m, duty) => {
    found.position_min_m = Math.min(found.position_min_m, position_m);
    found.position_max_m = Math.max(found.position_max_m, position_m);
    found.travel_m += Math.abs(position_m - before_m);
    before_m = position_m;
    at_power = Math.abs(duty) > kPowerDuty ? at_power + 1 : 0;
    longest_at_power = Math.max(longest_at_power, at_power);
    for (const bound of bounds) {
      if (bound.is_passed || !bound.is_outside(position_m)) continue;
      bound.is_passed = true;
      found.problems.push(
        `It is predicted to pass ${bound.name} (${millimetres(bound.at_m, 0)} mm) ${place(profile, line, tick)}.`,
      );
    }
    return Math.abs(position_m) < kDiverged_m;
  });
  const at_power_s = longest_at_power * kTick_s;
  if (at_power_s > profile.abort.power_s) {
    found.problems.push(
      `The duty is predicted beyond ${percent(kPowerDuty, 0)} % for ${at_power_s.toFixed(1)} s; abort.power_s ends the run after ${profile.abort.power_s} s.`,
    );
  }
  return found;
}

function bounds_of({ limits, abort }: Profile) {
  const bound = (name: string, at_m: number, is_low: boolean) => ({
    name,
    at_m,
    is_passed: false,
    is_outside: (position_m: number) => (is_low ? position_m < at_m : !(position_m <= at_m)),
  });
  return [
    bound('limits.position_min_m', limits.position_min_m, true),
    bound('limits.position_max_m', limits.position_max_m, false),
    bound('abort.position_min_m', abort.position_min_m, true),
    bound('abort.position_max_m', abort.position_max_m, false),
  ];
}

function place(profile: Profile, line: TimeLine, tick: number): string {
  const index = Math.max(0, line.step_begins.filter((begins) => begins <= tick).length - 1);
  const number = line.first_step + index;
  return `after ${(tick * kTick_s).toFixed(1)} s, in step ${number} (${profile.steps[number - 1]?.kind ?? ''})`;
}

// What the station's limits in a fluid forbid, the first of each run.
export function limit_problem(line: TimeLine, limits: CommandLimits, fluid: string): string | null {
  const where = fluid === '' ? 'where the fluid is not known' : `in ${fluid_text(fluid)}`;
  let setpoint_m = 0;
  for (const { kind, value, step } of line.actions) {
    const refuse = (what: string) => `Step ${step + 1}: ${what} by the station’s limits ${where}.`;
    if (kind === 'duty' && !(value >= limits.duty_min && value <= limits.duty_max)) {
      const allowed = `${percent(limits.duty_min, 0)} to ${percent(limits.duty_max, 0)} % is allowed`;
      return refuse(`a duty of ${percent(value, 0)} % is refused; ${allowed}`);
    }
    if (kind === 'disturbance' && Math.abs(value) > limits.disturbance_max_m) {
      return refuse(
        `a disturbance of ${millimetres(value, 0)} mm is refused; up to ±${millimetres(limits.disturbance_max_m, 0)} mm is allowed`,
      );
    }
    if (kind !== 'setpoint') continue;
    if (!(value >= limits.setpoint_min_m && value <= limits.setpoint_max_m)) {
      const allowed = `${millimetres(limits.setpoint_min_m, 0)} to ${millimetres(limits.setpoint_max_m, 0)} mm is allowed`;
      return refuse(`a setpoint of ${millimetres(value, 0)} mm is refused; ${allowed}`);
    }
    if (Math.abs(value - setpoint_m) > limits.setpoint_step_m + 1e-6) {
      return refuse(
        `the setpoint jumps by ${millimetres(value - setpoint_m, 0)} mm; ${millimetres(limits.setpoint_step_m, 0)} mm at once is allowed`,
      );
    }
    setpoint_m = value;
  }
  return null;
}

export const kMostPreviewed = 60; // runs of a grid; repeats count once

// One of each combination, the first kMostPreviewed of them.
export const different_runs = (profile: Profile): Variant[] =>
  variants_of(profile).filter(({ repeat }) => repeat === 1);
