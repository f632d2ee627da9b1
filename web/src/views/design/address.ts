// What is designed now, as the address says it: every choice is a step that "back" undoes and a link repeats.
//
//   #/design?runs=3,4&structure=fractional&to=60&fit=7&model=5&crossover=3&margin=90&controller=8&robot=sim-1&verified=9

import { signal } from '@preact/signals';
import { format, go_to, type Route } from '../../route';
import type { StoredDesign } from './design_api';
import { kPaperPlants, type Plant } from './frequency';

export const kStructures = ['', 'first_order', 'second_order', 'fractional'] as const;
export type Structure = (typeof kStructures)[number]; // '': all three, the best

export interface Design {
  runs: number[]; // that a model is identified from
  structure: Structure;
  from_s: number; // of each run
  to_s: number | null; // null: to its end
  validation: number | null; // run on which the model is tried
  limit_s: number; // of the search
  fit: number | null; // job that identified
  model: number | null; // that is tuned for: a model that is kept,
  fluid: string; // or that of a fluid,
  paper: '' | '28' | '29'; // or one of the paper's
  crossover_rad_s: number;
  margin_deg: number;
  controller: number | null; // that is kept, and can be sent
  robot: string;
  verified: number | null; // run that is compared with the prediction
}

export const kCrossover = { from: 0.5, to: 100, usual: 3 };
export const kMargin = { from: 1, to: 170, usual: 90 };
export const kLimit = { from: 1, to: 600, usual: 300 };
export const kMostRuns = 8;

export const kNothing: Design = {
  runs: [],
  structure: '',
  from_s: 0,
  to_s: null,
  validation: null,
  limit_s: kLimit.usual,
  fit: null,
  model: null,
  fluid: '',
  paper: '',
  crossover_rad_s: kCrossover.usual,
  margin_deg: kMargin.usual,
  controller: null,
  robot: '',
  verified: null,
};

const id_of = (text: string | undefined): number | null => (/^[1-9]\d{0,14}$/.test(text ?? '') ? Number(text) : null);
const number_of = (text: string | undefined, from: number, to: number): number | null => {
  const value = text === undefined || text === '' ? NaN : Number(text);
  return value >= from && value <= to ? value : null;
};
const kLongest_s = 1e6;

export function parse_design(query: Route['query']): Design {
  const runs = (query['runs'] ?? '').split(',').map(id_of);
  const from_s = number_of(query['from'], 0, kLongest_s) ?? 0;
  const to_s = number_of(query['to'], 0, kLongest_s);
  return {
    runs: [...new Set(runs.filter((id) => id !== null))].slice(0, kMostRuns),
    structure: kStructures.find((each) => each === query['structure']) ?? '',
    from_s,
    to_s: to_s !== null && to_s > from_s ? to_s : null,
    validation: id_of(query['validation']),
    limit_s: number_of(query['limit'], kLimit.from, kLimit.to) ?? kLimit.usual,
    fit: id_of(query['fit']),
    model: id_of(query['model']),
    fluid: query['fluid'] ?? '',
    paper: query['paper'] === '28' || query['paper'] === '29' ? query['paper'] : '',
    crossover_rad_s: number_of(query['crossover'], kCrossover.from, kCrossover.to) ?? kCrossover.usual,
    margin_deg: number_of(query['margin'], kMargin.from, kMargin.to) ?? kMargin.usual,
    controller: id_of(query['controller']),
    robot: query['robot'] ?? '',
    verified: id_of(query['verified']),
  };
}

// What is as usual is left out.
export function design_query(design: Design): Route['query'] {
  const unusual = (value: number, usual: number) => (value === usual ? '' : String(value));
  return {
    runs: design.runs.join(','),
    structure: design.structure,
    from: unusual(design.from_s, 0),
    to: String(design.to_s ?? ''),
    validation: String(design.validation ?? ''),
    limit: unusual(design.limit_s, kLimit.usual),
    fit: String(design.fit ?? ''),
    model: String(design.model ?? ''),
    fluid: design.fluid,
    paper: design.paper,
    crossover: unusual(design.crossover_rad_s, kCrossover.usual),
    margin: unusual(design.margin_deg, kMargin.usual),
    controller: String(design.controller ?? ''),
    robot: design.robot,
    verified: String(design.verified ?? ''),
  };
}

export const address_of = (design: Design) => format({ view: 'design', query: design_query(design) });

// The plant that is tuned for has changed: what was found for the other one is not what is shown.
export function with_plant(design: Design, plant: Partial<Pick<Design, 'model' | 'fluid' | 'paper'>>): Design {
  return { ...design, model: null, fluid: '', paper: '', controller: null, verified: null, ...plant };
}

// A controller that is kept, with the plant and the specification that it was tuned for. Where these are not known no plant
// is chosen: what would be predicted for another one is not what this controller does.
export function with_controller(design: Design, controller: StoredDesign): Design {
  const { fluid, plant, ...asked } = controller.options as Partial<Record<string, unknown>>;
  const paper = (['29', '28'] as const).find((name) => is_same_plant(plant, kPaperPlants[name]));
  const chosen =
    controller.model_id !== null
      ? { model: controller.model_id }
      : typeof fluid === 'string'
        ? { fluid }
        : paper && { paper };
  const crossover_rad_s = number_of(String(asked['crossover_rad_s']), kCrossover.from, kCrossover.to);
  const margin_deg = number_of(String(asked['phase_margin_deg']), kMargin.from, kMargin.to);
  const tuned_for =
    chosen && crossover_rad_s !== null && margin_deg !== null
      ? { ...with_plant(design, chosen), crossover_rad_s, margin_deg }
      : with_plant(design, {});
  return { ...tuned_for, controller: controller.design_id };
}

const is_same_plant = (given: unknown, plant: Plant) =>
  Object.entries(plant).every(([name, value]) => (given as Record<string, unknown> | undefined)?.[name] === value);

// Runs that a person adds or takes out; a fit of other runs is not theirs.
export function with_run(design: Design, run_id: number, is_in: boolean): Design {
  const rest = design.runs.filter((other) => other !== run_id);
  return { ...design, runs: is_in ? [...rest, run_id] : rest, fit: null };
}

interface Browser {
  back(): void;
  forward(): void;
}

// The steps of this design, for the buttons beside the browser's own "back", and for a view that is opened again.
export class Steps {
  readonly can_undo = signal(false);
  readonly can_redo = signal(false);
  private addresses: string[] = [];
  private at = -1;
  private first = 0; // further back the browser leads to another view

  constructor(private readonly browser: Browser) {}

  get last(): string | null {
    return this.addresses[this.at] ?? null;
  }

  // The view is opened: what lies before is no step back of the browser.
  open(address: string): void {
    if (address !== this.last) this.push(address);
    this.addresses = this.addresses.slice(0, this.at + 1);
    this.first = this.at;
    this.tell();
  }

  // The address has changed, by a choice, a link, or the browser's own buttons.
  follow(address: string): void {
    if (address === this.last) return;
    if (this.at > this.first && address === this.addresses[this.at - 1]) this.at -= 1;
    else if (address === this.addresses[this.at + 1]) this.at += 1;
    else this.push(address);
    this.tell();
  }

  // The address was changed without a step.
  replace(address: string): void {
    if (this.at >= 0) this.addresses[this.at] = address;
  }

  undo(): void {
    if (this.can_undo.peek()) this.browser.back();
  }
  redo(): void {
    if (this.can_redo.peek()) this.browser.forward();
  }

  private push(address: string): void {
    this.addresses = [...this.addresses.slice(0, this.at + 1), address];
    this.at = this.addresses.length - 1;
  }
  private tell(): void {
    this.can_undo.value = this.at > this.first;
    this.can_redo.value = this.at < this.addresses.length - 1;
  }
}

// A step that "back" undoes.
export const change_design = (design: Design) => go_to({ view: 'design', query: design_query(design) });
// For what a person has not done: the number of a job, a name that is filled in.
export const note_in_address = (design: Design) => go_to({ view: 'design', query: design_query(design) }, true);
