// One tick of the control law as the robot runs it, for what the page computes of a closed loop.
//
//   u = direct · e + Σ residue_i · x_i + Σ biquads,   x_i[k+1] = pole_i · x_i[k] + e[k]      (1)  docs/protocol.md
//
// Each section is strictly proper: what the error is in a tick reaches the duty of this tick by `direct` alone.

import type { Controller } from './experiments_api';

// (1), with the gain at rest exactly kp, the duty clamped and never written back.
export class RunningLaw {
  private readonly first: { pole: number; residue: number; x: number }[];
  private readonly second: { b0: number; b1: number; a1: number; a2: number; w0: number; w1: number }[];
  private readonly direct: number;

  constructor(
    controller: Controller,
    private readonly duty_min: number,
    private readonly duty_max: number,
  ) {
    const of = (list: (number | null)[] | undefined, at: number) => list?.[at] ?? 0;
    this.first = (controller.pole ?? []).map((pole, at) => ({
      pole: pole ?? 0,
      residue: of(controller.residue, at),
      x: 0,
    }));
    this.second = (controller.biquad_b0 ?? []).map((b0, at) => ({
      b0: b0 ?? 0,
      b1: of(controller.biquad_b1, at),
      a1: of(controller.biquad_a1, at),
      a2: of(controller.biquad_a2, at),
      w0: 0,
      w1: 0,
    }));
    const at_rest =
      this.first.reduce((sum, { pole, residue }) => sum + residue / (1 - pole), 0) +
      this.second.reduce((sum, { b0, b1, a1, a2 }) => sum + (b0 + b1) / (1 + a1 + a2), 0);
    this.direct = (controller.kp ?? 0) - at_rest;
  }

  reset(): void {
    for (const each of this.first) each.x = 0;
    for (const each of this.second) each.w0 = each.w1 = 0;
  }

  step(error_m: number): number {
    let duty = this.direct * error_m;
    for (const each of this.first) {
      duty += each.residue * each.x;
      each.x = each.pole * each.x + error_m;
    }
    for (const each of this.second) {
      duty += each.b0 * each.w0 + each.b1 * each.w1;
      const next = error_m - each.a1 * each.w0 - each.a2 * each.w1;
      [each.w1, each.w0] = [each.w0, next];
    }
    return Math.min(this.duty_max, Math.max(this.duty_min, duty));
  }
}
