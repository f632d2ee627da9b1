// What one run of a profile commands, tick by tick, as the station makes it (server/experiments/time_line.hpp).

import { is_closed_loop, kTick_s, type Profile, type Step, type Variant } from './profile';

const kModeChangeTicks = 50; // without another command after a change between manual and auto
const kTonesPerCrossover = [0.7, 1, 1.4];

export interface Action {
  tick: number; // of the run
  kind: 'duty' | 'setpoint' | 'disturbance'; // a duty: manual; a setpoint: auto
  value: number; // duty, or m; with the factors of the run
  step: number; // from 0
}

export interface TimeLine {
  actions: Action[];
  step_begins: number[]; // ticks
  ticks: number; // of the run
  first_step: number; // its number in the profile
}

const ticks_in = (time_s: number) => Math.round(time_s / kTick_s);
const n = (step: Step, name: string) => step.numbers[name] ?? 0;
const lerp = (from: number, to: number, share: number) => from + (to - from) * share;

// Pairs of tick and duty of a step in manual.
function duty_changes(step: Step): [number, number][] {
  const changes: [number, number][] = [];
  const change = (tick: number, duty: number) => {
    if (changes.at(-1)?.[1] !== duty) changes.push([tick, duty]);
  };
  const total = ticks_in(n(step, 'for_s'));
  const held = (value_at: (time_s: number) => number) => {
    const hold = Math.max(1, ticks_in(n(step, 'every_s')));
    for (let tick = 0; tick < total; tick += hold) change(tick, value_at(tick * kTick_s));
  };
  const [from_hz, to_hz, for_s] = [n(step, 'from_hz'), n(step, 'to_hz'), n(step, 'for_s')];
  switch (step.kind) {
    case 'rest':
    case 'duty':
      change(0, n(step, 'duty'));
      break;
    case 'staircase': {
      const levels = n(step, 'levels');
      for (let level = 0; level < levels; ++level) {
        const duty = lerp(n(step, 'from_duty'), n(step, 'to_duty'), level / Math.max(1, levels - 1));
        change(Math.floor((level * total) / levels), duty);
      }
      break;
    }
    case 'ramp':
      held((time_s) => lerp(n(step, 'from_duty'), n(step, 'to_duty'), time_s / for_s));
      break;
    case 'chirp': {
      const growth_s = for_s / Math.log(to_hz / from_hz);
      held((time_s) => {
        const phase = 2 * Math.PI * from_hz * growth_s * Math.expm1(time_s / growth_s);
        return n(step, 'mean_duty') + n(step, 'amplitude') * Math.sin(phase);
      });
      break;
    }
    case 'multisine': {
      const tones_hz = tone_frequencies_hz(step);
      held((time_s) =>
        tones_hz.reduce((sum, tone_hz, index) => {
          const phase = (Math.PI * (index + 1) * index) / tones_hz.length; // Schroeder's
          return sum + Math.cos(2 * Math.PI * tone_hz * time_s - phase);
        }, 0),
      );
      const peak = Math.max(...changes.map(([, value]) => Math.abs(value)), 1e-300);
      for (const each of changes) each[1] = n(step, 'mean_duty') + (n(step, 'amplitude') * each[1]) / peak;
      break;
    }
    case 'prbs': {
      let bits = 0xace1;
      let bit_end_s = n(step, 'bit_s');
      for (let tick = 0; tick < total; ++tick) {
        if (tick * kTick_s > bit_end_s - 1e-6 * kTick_s) {
          bits = (bits >> 1) | (((bits ^ (bits >> 2) ^ (bits >> 3) ^ (bits >> 5)) & 1) << 15);
          bit_end_s += n(step, 'bit_s');
        }
        change(tick, n(step, 'mean_duty') + (bits & 1 ? 1 : -1) * n(step, 'amplitude'));
      }
      break;
    }
  }
  return changes;
}

function tone_frequencies_hz(step: Step): number[] {
  const found: number[] = [];
  const [tones, from_hz, to_hz, for_s] = [n(step, 'tones'), n(step, 'from_hz'), n(step, 'to_hz'), n(step, 'for_s')];
  for (let i = 0; i < tones; ++i) {
    const share = tones <= 1 ? 0 : i / (tones - 1);
    const tone_hz = Math.max(1, Math.round(for_s * from_hz * (to_hz / from_hz) ** share)) / for_s;
    if (tone_hz > (found.at(-1) ?? 0)) found.push(tone_hz);
  }
  return found;
}

// Ticks and setpoints of a scan, and the ticks of its way.
function scan(step: Step, from_m: number, to_m: number): { changes: [number, number][]; way: number } {
  const way = Math.ceil(Math.abs(to_m - from_m) / n(step, 'velocity_m_s') / kTick_s - 1e-6);
  const hold = Math.max(1, ticks_in(n(step, 'every_s')));
  const changes: [number, number][] = [];
  for (let tick = 0; tick < way; tick += hold) {
    changes.push([tick, lerp(from_m, to_m, Math.min(1, (tick + hold) / way))]);
  }
  return { changes, way };
}

function tones(step: Step, factor: number): [number, number][] {
  const hold = Math.max(1, ticks_in(n(step, 'every_s')));
  const total = ticks_in(n(step, 'for_s'));
  const changes: [number, number][] = [];
  for (let tick = 0; tick < total; tick += hold) {
    const sum = kTonesPerCrossover.reduce(
      (so_far, share, i) => so_far + Math.sin(share * n(step, 'crossover_rad_s') * tick * kTick_s + 2 * i),
      0,
    );
    const is_last = tick + hold >= total;
    changes.push([tick, factor * (n(step, 'setpoint_m') + (is_last ? 0 : n(step, 'amplitude_m') * sum))]);
  }
  return changes;
}

export function time_line_of(profile: Profile, variant: Variant): TimeLine {
  const steps = variant.step > 0 ? profile.steps.slice(variant.step - 1, variant.step) : profile.steps;
  const line: TimeLine = { actions: [], step_begins: [], ticks: 0, first_step: Math.max(1, variant.step) };
  let setpoint_m = 0;
  let was_auto = false;
  steps.forEach((step, index) => {
    const act = (kind: Action['kind'], [tick, value]: [number, number]) =>
      line.actions.push({ tick: line.ticks + tick, kind, value, step: line.first_step - 1 + index });
    line.step_begins.push(line.ticks);
    const is_auto = is_closed_loop(step.kind);
    const is_change = is_auto !== was_auto;
    was_auto = is_auto;
    const waits = is_change && step.kind !== 'setpoint';
    if (waits) {
      act(is_auto ? 'setpoint' : 'duty', [0, is_auto ? setpoint_m : 0]);
      line.ticks += kModeChangeTicks;
    }
    const target_m = n(step, 'setpoint_m') * variant.setpoint_factor;
    for (const [tick, duty] of is_auto ? [] : duty_changes(step)) act('duty', [tick, duty * variant.duty_factor]);
    if (step.kind === 'setpoint') act('setpoint', [0, target_m]);
    if (step.kind === 'disturbance') act('disturbance', [0, n(step, 'disturbance_m') * variant.setpoint_factor]);
    if (step.kind === 'scan') {
      const { changes, way } = scan(step, setpoint_m, target_m);
      for (const change of changes) act('setpoint', change);
      line.ticks += way;
    }
    if (step.kind === 'tones') for (const change of tones(step, variant.setpoint_factor)) act('setpoint', change);
    if (is_auto && step.kind !== 'disturbance') setpoint_m = target_m;
    line.ticks += Math.max(ticks_in(n(step, 'for_s')), is_change && !waits ? kModeChangeTicks : 0);
  });
  if (!was_auto) line.actions.push({ tick: line.ticks, kind: 'duty', value: 0, step: steps.length - 1 });
  return line;
}
