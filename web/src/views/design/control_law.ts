// The controller as the robot holds it: what a discretisation becomes on its way there, in float32.
//
//   r/(1 - p z⁻¹) = r + r p/(z - p);   biquads the same way                                  (1)
//
// The station does (1) when it sends; control_law_test.ts compares it with what the robot reports.

import type { Controller } from '../../experiments_api';

export interface Sections {
  direct: number;
  first_order: { pole: number; residue: number }[];
  second_order: { b0: number; b1: number; a1: number; a2: number }[];
}

export interface Discretised {
  period_s: number;
  dc_gain: number;
  sections: Sections;
  duty_min?: number;
  duty_max?: number;
  reason?: string;
  method?: string;
  noise_gain?: number;
  errors?: { bandwidth_rad_s: number; max_relative_in_bandwidth: number; max_deg_in_bandwidth: number };
}

// (1), each number as a float32 holds it.
export function sent_form({ period_s, dc_gain, sections }: Discretised): Controller {
  const { direct, first_order, second_order } = sections;
  const sum =
    first_order.reduce((total, { residue }) => total + residue, direct) +
    second_order.reduce((total, { b0 }) => total + b0, 0);
  return {
    period_us: Math.round(period_s * 1e6),
    kp: Math.fround(dc_gain),
    direct: Math.fround(sum),
    pole: first_order.map(({ pole }) => Math.fround(pole)),
    residue: first_order.map(({ pole, residue }) => Math.fround(residue * pole)),
    biquad_b0: second_order.map(({ b0, b1, a1 }) => Math.fround(b1 - b0 * a1)),
    biquad_b1: second_order.map(({ b0, a2 }) => Math.fround(-b0 * a2)),
    biquad_a1: second_order.map(({ a1 }) => Math.fround(a1)),
    biquad_a2: second_order.map(({ a2 }) => Math.fround(a2)),
  };
}

const kLists = ['pole', 'residue', 'biquad_b0', 'biquad_b1', 'biquad_a1', 'biquad_a2'] as const;

export interface Coefficient {
  name: string;
  sent: number | null;
  reported: number | null;
  is_same: boolean; // bit for bit
}

// Coefficient by coefficient; one that only one of them has differs.
export function compared(sent: Controller, reported: Controller | null): Coefficient[] {
  const pair = (name: string, a: number | null | undefined, b: number | null | undefined): Coefficient => ({
    name,
    sent: a ?? null,
    reported: b ?? null,
    is_same: typeof a === 'number' && typeof b === 'number' && Object.is(Math.fround(a), Math.fround(b)),
  });
  const rows = [pair('kp', sent.kp, reported?.kp), pair('direct', sent.direct, reported?.direct)];
  for (const list of kLists) {
    const size = Math.max(sent[list]?.length ?? 0, reported?.[list]?.length ?? 0);
    for (let at = 0; at < size; ++at) rows.push(pair(`${list} ${at + 1}`, sent[list]?.[at], reported?.[list]?.[at]));
  }
  return rows;
}
