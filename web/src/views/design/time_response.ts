// The closed loop in time, drawn while the station's figures of it stand beside: a model as a sum of exponentials that is
// advanced exactly while the duty is held.
//
//   h(t) = Σ Re[w_i e^(s_i t)],   s_i = x_i e^(iθ),  ln x_i evenly spaced,  w_i = (Δ/(πi)) H(s_i) s_i      (1)
//   z_i → e^(s_i T) z_i + (e^(s_i T) - 1)/s_i · u,   v = Σ Re[w_i z_i],   x = ∫v dt, exact over a tick    (2)
//
// The ray lies in the middle between the imaginary axis and the pole pair of the model, so that nothing is between.
// Accuracy: 1e-6 m of the reference of tests/data/closed_loop_cases.json over 40 s (time_response_test.ts). A dead time is
// rounded to whole ticks.

import type { Plant } from './frequency';

export interface Modes {
  re: Float64Array; // s_i
  im: Float64Array;
  weight_re: Float64Array; // w_i
  weight_im: Float64Array;
  dead_time_s: number;
}

// What turns an error into a duty, at each tick.
export interface ControlLawStep {
  step(error_m: number): number;
}

export interface Experiment {
  setpoint_m: number;
  disturbance_m: number;
  disturbance_at_s: number;
  duration_s: number;
  period_s: number;
}

export interface Response {
  t_s: number[];
  position_m: number[]; // as the controller sees it, with the disturbance
  duty: number[];
}

const kModes = 220;
const kLowest_rad_s = 1e-7;
const kHighest_rad_s = 1e7;

// The smallest angle of a pole, beyond the imaginary axis; π without one on this sheet.
export function pole_angle({ b1, b2, b3, alpha, beta }: Plant): number {
  if (b1 === 0) return Math.PI;
  // A pole s = x e^(iφ) has b1 x^α sin αφ + b2 x^β sin βφ = 0 in its imaginary part; x follows, φ is where the real part is 0.
  const real_part = (phi: number): number => {
    const [sa, sb] = [Math.sin(alpha * phi), Math.sin(beta * phi)];
    const x = ((-b2 * sb) / (b1 * sa)) ** (1 / (alpha - beta));
    return b1 * x ** alpha * Math.cos(alpha * phi) + b2 * x ** beta * Math.cos(beta * phi) + b3;
  };
  const first = Math.PI / alpha; // before it both terms point up
  if (first >= Math.PI) return Math.PI;
  const steps = 400;
  let [before, value_before] = [NaN, NaN];
  for (let at = 1; at < steps; ++at) {
    const phi = first + ((Math.PI - first) * at) / steps;
    const value = real_part(phi);
    if (Number.isFinite(value) && value_before * value <= 0) return (before + phi) / 2;
    [before, value_before] = [phi, value];
  }
  return Math.PI;
}

export function modes_of(plant: Plant): Modes {
  const { kp, b1, b2, b3, alpha, beta, dead_time_s } = plant;
  const theta = (Math.PI / 2 + pole_angle(plant)) / 2;
  const delta = Math.log(kHighest_rad_s / kLowest_rad_s) / (kModes - 1);
  const modes: Modes = {
    re: new Float64Array(kModes),
    im: new Float64Array(kModes),
    weight_re: new Float64Array(kModes),
    weight_im: new Float64Array(kModes),
    dead_time_s,
  };
  for (let at = 0; at < kModes; ++at) {
    const x = kLowest_rad_s * Math.exp(at * delta);
    const [re, im] = [x * Math.cos(theta), x * Math.sin(theta)];
    const d_re = b1 * x ** alpha * Math.cos(alpha * theta) + b2 * x ** beta * Math.cos(beta * theta) + b3;
    const d_im = b1 * x ** alpha * Math.sin(alpha * theta) + b2 * x ** beta * Math.sin(beta * theta);
    const size = d_re * d_re + d_im * d_im;
    // w = (Δ kp/π) s/(i D): the real part of w e^(st) is the imaginary part of s H e^(st) (Δ/π).
    const [h_re, h_im] = [(re * d_re + im * d_im) / size, (im * d_re - re * d_im) / size];
    const share = (delta * kp) / Math.PI;
    modes.re[at] = re;
    modes.im[at] = im;
    modes.weight_re[at] = share * h_im;
    modes.weight_im[at] = -share * h_re;
  }
  return modes;
}

// The robot in closed loop from rest at 0: to the setpoint, then a disturbance of what it measures.
export function closed_loop(modes: Modes, law: ControlLawStep, experiment: Experiment): Response {
  const { setpoint_m, disturbance_m, disturbance_at_s, duration_s, period_s } = experiment;
  const ticks = Math.round(duration_s / period_s);
  const disturbed_from = Math.round(disturbance_at_s / period_s);
  const delay = Math.round(modes.dead_time_s / period_s);
  const waiting = new Float64Array(delay + 1);
  const plant = new SteppedPlant(modes, period_s);
  const response: Response = { t_s: [], position_m: [], duty: [] };
  for (let tick = 0; tick <= ticks; ++tick) {
    const seen_m = plant.position_m + (tick >= disturbed_from ? disturbance_m : 0);
    const duty = law.step(setpoint_m - seen_m);
    response.t_s.push(tick * period_s);
    response.position_m.push(seen_m);
    response.duty.push(duty);
    waiting[tick % (delay + 1)] = duty;
    plant.step(waiting[(tick + 1) % (delay + 1)]!);
    if (Math.abs(plant.position_m) > kDiverged_m) break;
  }
  return response;
}

const kDiverged_m = 1e3;

class SteppedPlant {
  position_m = 0;
  private readonly size: number;
  private readonly pole_re: Float64Array;
  private readonly pole_im: Float64Array;
  private readonly drive_re: Float64Array;
  private readonly drive_im: Float64Array;
  private readonly way_re: Float64Array; // of z over a tick, times the weight
  private readonly way_im: Float64Array;
  private readonly z_re: Float64Array;
  private readonly z_im: Float64Array;
  private way_of_duty = 0;

  constructor({ re, im, weight_re, weight_im }: Modes, period_s: number) {
    this.size = re.length;
    const column = () => new Float64Array(this.size);
    this.pole_re = column();
    this.pole_im = column();
    this.drive_re = column();
    this.drive_im = column();
    this.way_re = column();
    this.way_im = column();
    this.z_re = column();
    this.z_im = column();
    for (let at = 0; at < this.size; ++at) {
      const s: Complex = [re[at]!, im[at]!];
      const w: Complex = [weight_re[at]!, weight_im[at]!];
      const grown = expm1([s[0] * period_s, s[1] * period_s]);
      const [drive_re, drive_im] = over(grown, s); // (e^(sT) - 1)/s
      const [way_re, way_im] = times(w, [drive_re, drive_im]);
      this.pole_re[at] = grown[0] + 1;
      this.pole_im[at] = grown[1];
      this.drive_re[at] = drive_re;
      this.drive_im[at] = drive_im;
      this.way_re[at] = way_re;
      this.way_im[at] = way_im;
      this.way_of_duty += times(w, held_way(s, [drive_re, drive_im], period_s))[0];
    }
  }

  step(duty: number): void {
    const { pole_re, pole_im, drive_re, drive_im, way_re, way_im, z_re, z_im } = this;
    let way_m = this.way_of_duty * duty;
    for (let at = 0; at < this.size; ++at) {
      const [a, b] = [z_re[at]!, z_im[at]!];
      way_m += way_re[at]! * a - way_im[at]! * b;
      z_re[at] = pole_re[at]! * a - pole_im[at]! * b + drive_re[at]! * duty;
      z_im[at] = pole_re[at]! * b + pole_im[at]! * a + drive_im[at]! * duty;
    }
    this.position_m += way_m;
  }
}

type Complex = [re: number, im: number];
const times = ([a, b]: Complex, [c, d]: Complex): Complex => [a * c - b * d, a * d + b * c];
const over = ([a, b]: Complex, [c, d]: Complex): Complex => {
  const size = c * c + d * d;
  return [(a * c + b * d) / size, (b * c - a * d) / size];
};
// e^z - 1 without the loss of digits near 0.
const expm1 = ([re, im]: Complex): Complex => [
  Math.expm1(re) * Math.cos(im) - 2 * Math.sin(im / 2) ** 2,
  Math.exp(re) * Math.sin(im),
];
// ∫∫ of a unit duty over the tick: ((e^(sT) - 1)/s - T)/s; near 0 by its series.
function held_way(s: Complex, drive: Complex, period_s: number): Complex {
  const size = Math.hypot(...s) * period_s;
  if (size > 1e-4) return over([drive[0] - period_s, drive[1]], s);
  const half = (period_s * period_s) / 2;
  return [half * (1 + (s[0] * period_s) / 3), (half * s[1] * period_s) / 3];
}
