// A profile as the preview needs it, read from its document. The station's reader decides what is valid; this one refuses
// what it cannot predict, with the line.

import { parse_toml, TextError, type Document, type Table, type Value } from './toml';

export const kTick_s = 0.01; // of the robot
export const kMostRuns = 1000;

export interface Step {
  kind: string;
  numbers: Record<string, number>;
}

export interface Profile {
  name: string;
  purpose: string;
  fluid: string; // '': the one that the robot is in
  pump: string;
  mean_flow_m_s: number;
  limits: { position_min_m: number; position_max_m: number };
  abort: { position_min_m: number; position_max_m: number; power_s: number };
  duty_factors: number[];
  setpoint_factors: number[];
  fluids: string[];
  controllers: string[];
  repeats: number;
  is_unattended: boolean;
  until: string; // '': it has none
  most_runs: number;
  steps: Step[];
}

export interface Variant {
  fluid: string;
  controller: string;
  duty_factor: number;
  setpoint_factor: number;
  repeat: number;
  step: number; // from 1, the only one that it performs; 0: all of them
}

// The numbers of each kind of step: what must be given, and what has a default.
const kStepNumbers: Record<string, { needed: string[]; defaults?: Record<string, number> }> = {
  rest: { needed: ['for_s'] },
  duty: { needed: ['duty', 'for_s'] },
  staircase: { needed: ['from_duty', 'to_duty', 'for_s'], defaults: { levels: 5 } },
  ramp: { needed: ['from_duty', 'to_duty', 'for_s'], defaults: { every_s: 0.05 } },
  chirp: { needed: ['for_s', 'amplitude', 'from_hz', 'to_hz'], defaults: { mean_duty: 0, every_s: 0.05 } },
  prbs: { needed: ['for_s', 'amplitude', 'bit_s'], defaults: { mean_duty: 0 } },
  multisine: {
    needed: ['for_s', 'amplitude', 'from_hz', 'to_hz'],
    defaults: { mean_duty: 0, tones: 8, every_s: 0.05 },
  },
  setpoint: { needed: ['setpoint_m', 'for_s'] },
  disturbance: { needed: ['disturbance_m', 'for_s'] },
  scan: { needed: ['setpoint_m', 'velocity_m_s'], defaults: { for_s: 0, every_s: 0.05 } },
  tones: { needed: ['setpoint_m', 'amplitude_m', 'crossover_rad_s', 'for_s'], defaults: { every_s: 0.05 } },
};
const kAboveZero = ['levels', 'every_s', 'from_hz', 'to_hz', 'bit_s', 'tones', 'velocity_m_s', 'crossover_rad_s'];
const kLongest_s = 7200;

export const is_closed_loop = (kind: string) => ['setpoint', 'disturbance', 'scan', 'tones'].includes(kind);

export function read_profile(text: string): Profile {
  const reader = new ProfileReader(text.trimStart().startsWith('{') ? from_json(text) : parse_toml(text));
  return reader.read();
}

function from_json(text: string): Document {
  try {
    const table = JSON.parse(text) as Value;
    if (typeof table === 'object' && !Array.isArray(table)) return { table, lines: new Map() };
  } catch (error) {
    const at = /position (\d+)/.exec(error instanceof Error ? error.message : '')?.[1];
    throw new TextError(at ? text.slice(0, Number(at)).split('\n').length : 1, 'this is no JSON');
  }
  throw new TextError(1, 'this is no JSON object');
}

class ProfileReader {
  constructor(private readonly document: Document) {}

  read(): Profile {
    const { table } = this.document;
    const inside = (name: string) => {
      const value = table[name] ?? {};
      return typeof value === 'object' && !Array.isArray(value) ? value : this.refuse(name, 'is no table');
    };
    const [conditions, limits, abort, sweep] = ['conditions', 'limits', 'abort', 'sweep'].map(inside) as [
      Table,
      Table,
      Table,
      Table,
    ];
    const fluid = this.text(conditions, 'conditions.fluid', 'any');
    const steps = table['step'] ?? [];
    if (!Array.isArray(steps) || steps.length === 0) this.refuse('step', 'is missing: there is no [[step]]');
    const profile: Profile = {
      name: this.text(table, 'name', ''),
      purpose: this.text(table, 'purpose', ''),
      fluid: fluid === 'any' ? '' : fluid,
      pump: this.text(conditions, 'conditions.pump', 'off'),
      mean_flow_m_s: this.number(conditions, 'conditions.mean_flow_m_s', 0),
      limits: {
        position_min_m: this.number(limits, 'limits.position_min_m', -1),
        position_max_m: this.number(limits, 'limits.position_max_m', 1),
      },
      abort: {
        position_min_m: this.number(abort, 'abort.position_min_m', -100),
        position_max_m: this.number(abort, 'abort.position_max_m', 100),
        power_s: this.number(abort, 'abort.power_s', 60),
      },
      duty_factors: this.list(sweep, 'sweep.duty_factor', 'number'),
      setpoint_factors: this.list(sweep, 'sweep.setpoint_factor', 'number'),
      fluids: this.list(sweep, 'sweep.fluids', 'string'),
      controllers: this.list(sweep, 'sweep.controllers', 'string'),
      repeats: this.number(sweep, 'sweep.repeats', 1),
      is_unattended: table['unattended'] === true,
      until: this.text(table, 'until', 'none').replace(/^none$/, ''),
      most_runs: this.number(table, 'most_runs', 8),
      steps: steps.map((step, index) => this.step(step, `step[${index}]`)),
    };
    const runs = variants_of(profile, kMostRuns + 1).length;
    if (!(runs <= kMostRuns)) this.refuse('sweep', `has more than ${kMostRuns} runs`);
    return profile;
  }

  private step(value: Value, path: string): Step {
    if (typeof value !== 'object' || Array.isArray(value)) return this.refuse(path, 'is no table');
    const kind = this.text(value, `${path}.kind`, '');
    const known = kStepNumbers[kind];
    if (!known) {
      const kinds = Object.keys(kStepNumbers).join(', ');
      return this.refuse(
        `${path}.kind`,
        kind === '' ? `is missing; one of ${kinds}` : `is ${kind}, allowed are ${kinds}`,
      );
    }
    const numbers: Record<string, number> = {};
    for (const name of known.needed) numbers[name] = this.number(value, `${path}.${name}`);
    for (const [name, usual] of Object.entries(known.defaults ?? {})) {
      numbers[name] = this.number(value, `${path}.${name}`, usual);
    }
    for (const [name, number] of Object.entries(numbers)) {
      if (kAboveZero.includes(name) && !(number > 0))
        this.refuse(`${path}.${name}`, `is ${number}, it must be above 0`);
    }
    const { for_s = 0 } = numbers;
    if (!(for_s >= 0 && for_s <= kLongest_s)) {
      this.refuse(`${path}.for_s`, `is ${for_s}, allowed is 0 to ${kLongest_s}`);
    }
    for (const name of Object.keys(value)) {
      if (name !== 'kind' && numbers[name] === undefined) this.refuse(`${path}.${name}`, `is no key of a step ${kind}`);
    }
    return { kind, numbers };
  }

  private number(table: Table, path: string, otherwise?: number): number {
    const value = table[path.split('.').pop()!];
    if (typeof value === 'number') return value;
    if (value !== undefined) return this.refuse(path, 'is no number');
    return otherwise ?? this.refuse(path, 'is missing');
  }

  private text(table: Table, path: string, otherwise: string): string {
    const value = table[path.split('.').pop()!] ?? otherwise;
    return typeof value === 'string' ? value : this.refuse(path, 'is no text in quotes');
  }

  private list<Name extends 'number' | 'string'>(table: Table, path: string, type: Name) {
    const value = table[path.split('.').pop()!] ?? [];
    const is_right = Array.isArray(value) && value.every((each) => typeof each === type);
    return (is_right ? value : this.refuse(path, `is no list of ${type}s`)) as Name extends 'number'
      ? number[]
      : string[];
  }

  // At the line of the key; one that is missing at that of its table.
  private refuse(path: string, why: string): never {
    const { lines } = this.document;
    const line = lines.get(path) ?? lines.get(path.replace(/\.[^.]*$/, '')) ?? 1;
    throw new TextError(line, `${path} ${why}`);
  }
}

const axis = <T>(values: T[], otherwise: T) => (values.length === 0 ? [otherwise] : values);

// The runs of the grid in their order; repeats of one combination follow each other. With `until`: what a run may be.
export function variants_of(profile: Profile, most = Infinity): Variant[] {
  const { fluid, fluids, controllers, duty_factors, setpoint_factors, repeats } = profile;
  const base = { fluid, controller: '', duty_factor: 1, setpoint_factor: 1, repeat: 1, step: 0 };
  if (profile.until !== '') {
    return profile.steps.flatMap((_, index) =>
      axis(duty_factors, 1).map((duty_factor) => ({ ...base, duty_factor, step: index + 1 })),
    );
  }
  const variants: Variant[] = [];
  for (const each of axis(fluids, fluid))
    for (const controller of axis(controllers, ''))
      for (const setpoint_factor of axis(setpoint_factors, 1))
        for (const duty_factor of axis(duty_factors, 1))
          for (let repeat = 1; repeat <= repeats && variants.length < most; ++repeat)
            variants.push({ fluid: each, controller, setpoint_factor, duty_factor, repeat, step: 0 });
  return variants;
}
