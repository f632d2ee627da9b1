// What the station's numbers mean, in words: states of a step, how well a parameter is known, what a fit is worth.

import { fluid_text } from '../../format';
import type { Design } from './address';
import type { Fit, Identified, MapPoint, Parameter, Predicted } from './design_api';
import { kParameters } from './design_api';
import { is_at_work, type Answer } from './jobs';

export const kMinus = '\u2212';

// A number with this number of significant digits: "0.0998", "30.1", "−1.2e-15".
export function number_text(value: number | null | undefined, digits = 4): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e6))
    return value
      .toExponential(Math.min(2, digits - 1))
      .replaceAll('-', kMinus)
      .replace('e+', 'e');
  return String(Number(value.toPrecision(digits))).replace('-', kMinus);
}
export const fixed_text = (value: number | null | undefined, decimals: number) =>
  value === null || value === undefined || !Number.isFinite(value)
    ? '–'
    : value
        .toFixed(decimals)
        .replace(/^-(?=[0.]*$)/, '')
        .replace('-', kMinus);

// A value and its sigma, both to the place that the sigma has two digits in: "0.0998 ± 0.0016".
export function with_sigma(value: number, sigma: number | null): string {
  if (sigma === null || !(sigma > 0)) return number_text(value, 5);
  const decimals = Math.max(0, Math.min(8, 1 - Math.floor(Math.log10(sigma))));
  return `${fixed_text(value, decimals)} ± ${fixed_text(sigma, decimals)}`;
}

export const kStructureNames = {
  first_order: 'first order',
  second_order: 'second order',
  fractional: 'fractional',
} as const;

export const kSymbols: Record<Parameter, { symbol: string; unit: string; power: string }> = {
  kp: { symbol: 'kp', unit: 'm/s per duty', power: '' },
  b1: { symbol: 'b1', unit: '', power: 'α' },
  b2: { symbol: 'b2', unit: '', power: 'β' },
  alpha: { symbol: 'α', unit: '', power: '' },
  beta: { symbol: 'β', unit: '', power: '' },
};

const kWell = 0.02;
const kRoughly = 0.1;

export const kAtBound = 'at its bound, where its ± means little';

// How well a parameter is known; '' where it was not fitted. The sigma of one at its bound means little.
export function knowledge_text(value: number, sigma: number | null, is_at_bound = false): string {
  if (is_at_bound) return kAtBound;
  if (sigma === null || !(sigma > 0)) return 'fixed by the structure';
  const relative = sigma / Math.abs(value);
  const size = `${number_text(relative * 100, 2)} %`;
  if (relative < kWell) return `well known, to ${size}`;
  if (relative < kRoughly) return `roughly known, to ${size}`;
  return `hardly known, to ${size}`;
}

// What the fit is worth, sentence by sentence.
export function sentences_of(fit: Identified): string[] {
  const said: string[] = [];
  const others = (fit.compared ?? []).filter(({ structure }) => structure !== fit.structure);
  const next = others.reduce<Fit | null>((best, each) => (best === null || each.aic < best.aic ? each : best), null);
  if (next && fit.aic < next.aic) {
    const gap = next.aic - fit.aic;
    const by = gap > 10 ? 'clearly better than' : 'hardly better than';
    said.push(
      `${capital(kStructureNames[fit.structure])} is ${by} ${kStructureNames[next.structure]}: its AIC is lower by ${number_text(gap, 3)}.`,
    );
  }
  const drift = fit.drift_factor ?? 1;
  if (fit.residuals_are_white && drift > 1)
    said.push(
      `What is left over drifts slowly: the true errors may be up to ${number_text(drift, 2)} times the ± of the parameters.`,
    );
  else if (fit.residuals_are_white !== undefined && fit.residuals_are_white !== null)
    said.push(
      fit.residuals_are_white
        ? 'What is left over looks like noise alone, so the ± can be believed.'
        : 'What is left over is not noise alone: the true errors are larger than the ± of the parameters.',
    );
  const unknown = kParameters.filter((name) => (fit.one_sigma[name] ?? 0) > kRoughly * Math.abs(fit.parameters[name]));
  if (unknown.length > 0)
    said.push(
      `${unknown.map((name) => kSymbols[name].symbol).join(' and ')} ${unknown.length > 1 ? 'are' : 'is'} hardly known: a duty that changes faster, or another run, tells more.`,
    );
  if (fit.end !== 'converged') said.push(`The search did not come to its end (${fit.end.replaceAll('_', ' ')}).`);
  return said;
}

export const capital = (text: string) => `${text[0]?.toUpperCase() ?? ''}${text.slice(1)}`;

export type StepKind = 'needs' | 'ready' | 'running' | 'done' | 'failed';
export interface StepState {
  kind: StepKind;
  text: string;
}

export const seconds_text = (time_s: number) => `${time_s < 10 ? time_s.toFixed(1) : Math.round(time_s)} s`;

export function state_of<Result>(answer: Answer<Result>, otherwise: StepState): StepState {
  const { phase, share, took_s, error } = answer;
  if (phase === 'idle') return otherwise;
  if (phase === 'running') return { kind: 'running', text: `running, ${Math.round(share * 100)} %` };
  if (is_at_work(phase)) return { kind: 'running', text: phase === 'waiting' ? 'waits for other jobs' : 'asking' };
  if (phase === 'cancelled') return { kind: 'failed', text: 'cancelled' };
  if (phase === 'failed') return { kind: 'failed', text: `failed: ${error}` };
  return { kind: 'done', text: took_s === null ? 'done' : `done in ${seconds_text(took_s)}` };
}

// The plant that is tuned for, as people call it; `name` of a model that is kept.
export function plant_text(design: Pick<Design, 'model' | 'fluid' | 'paper'>, name = ''): string {
  if (design.model !== null) return name === '' ? `model ${design.model}` : `${name} (model ${design.model})`;
  if (design.fluid !== '') return `the model of ${fluid_text(design.fluid)}`;
  if (design.paper === '29') return 'the paper’s (29), fabric softener';
  if (design.paper === '28') return 'the paper’s (28), water';
  return '';
}

export const predicted_text = ({ fluid }: Predicted) => (fluid === null ? 'tuned for' : fluid_text(fluid));

const kMapReasons: Record<string, string> = {
  phase_falls_too_fast: 'the phase of the model falls too fast to be made flat',
  margin_below_0: 'only unstable loops',
  margin_above_180: 'the phase margin would be above 180°',
  not_sound: 'unstable, or another crossover has a smaller margin',
};

// Where no crossover is feasible, range by range, and why.
export function infeasible_text(points: readonly MapPoint[]): string[] {
  const said: string[] = [];
  let from = 0;
  while (from < points.length) {
    const reason = points[from]!.reason;
    let to = from;
    while (points[to + 1]?.reason === reason) to += 1;
    if (points[from]!.ranges_deg.length === 0) {
      const ends = `${number_text(points[from]!.crossover_rad_s, 2)} to ${number_text(points[to]!.crossover_rad_s, 2)} rad/s`;
      said.push(`${ends}: ${kMapReasons[reason] ?? reason.replaceAll('_', ' ')}.`);
    }
    from = to + 1;
  }
  return said;
}
