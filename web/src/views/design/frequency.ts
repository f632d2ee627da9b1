// The open loop in frequency and the tuning equations, as the page calculates them while a slider is dragged.
//
//   P(jω) = kp / (b1 (jω)^α + b2 (jω)^β + b3) / (jω) · e^(-jωT_d)                    (1)  position per duty, (20) and (22)
//   C(jω) = kp (1 + kd (jω)^μ)                                                        (2)  (23)
//   θ = -π + φ_m - arg P(jω_gc),  R = -d arg P/d ln ω,  q = μπ/2                      (3)  (24) to (26)
//   μ sin θ sin(q - θ)/sin q = R,  kd ω_gc^μ = sin θ/sin(q - θ),  kp = 1/(|1 + kd (jω)^μ| |P|)
//
// Phases are unwrapped by construction: (jω)^α stays in one half plane for 0 < β < α ≤ 2, and so does 1 + kd (jω)^μ.
// Accuracy: |C P| and its phase to 1e-9 of tests/data/bode_open_loop.json, (3) to 1e-7 of tests/data/tuning_solutions.json
// (frequency_test.ts). What is kept and sent to robots is calculated by the station: `control/tuning`.

export interface Plant {
  kp: number;
  b1: number;
  b2: number;
  b3: number;
  alpha: number;
  beta: number;
  dead_time_s: number;
}

export interface Law {
  kp: number;
  kd: number;
  mu: number;
}

export interface Point {
  omega_rad_s: number;
  magnitude: number;
  phase_rad: number; // unwrapped
}

export interface Specification {
  crossover_rad_s: number;
  phase_margin_deg: number;
}

// The paper's (29), in fabric softener, and (28), in water.
export const kPaperPlants: Record<'28' | '29', Plant> = {
  '28': { kp: 232, b1: 1, b2: 60.13, b3: 667.1, alpha: 2, beta: 1, dead_time_s: 0 },
  '29': { kp: 0.1, b1: 0.005682, b2: 0.11031, b3: 1, alpha: 1.7263, beta: 0.8682, dead_time_s: 0 },
};

const kHalfTurn = Math.PI / 2;
export const degrees = (angle_rad: number) => (angle_rad * 180) / Math.PI;
export const radians = (angle_deg: number) => (angle_deg * Math.PI) / 180;
export const decibels = (magnitude: number) => 20 * Math.log10(magnitude);

export function plant_at(plant: Plant, omega_rad_s: number): Point {
  const { kp, b1, b2, b3, alpha, beta, dead_time_s } = plant;
  const [first, second] = [b1 * omega_rad_s ** alpha, b2 * omega_rad_s ** beta];
  const re = first * Math.cos(alpha * kHalfTurn) + second * Math.cos(beta * kHalfTurn) + b3;
  const im = first * Math.sin(alpha * kHalfTurn) + second * Math.sin(beta * kHalfTurn);
  return {
    omega_rad_s,
    magnitude: kp / (Math.hypot(re, im) * omega_rad_s),
    phase_rad: -Math.atan2(im, re) - kHalfTurn - omega_rad_s * dead_time_s,
  };
}

export function law_at({ kp, kd, mu }: Law, omega_rad_s: number): Point {
  const term = kd * omega_rad_s ** mu;
  const [re, im] = [1 + term * Math.cos(mu * kHalfTurn), term * Math.sin(mu * kHalfTurn)];
  return { omega_rad_s, magnitude: kp * Math.hypot(re, im), phase_rad: Math.atan2(im, re) };
}

export function loop_at(plant: Plant, law: Law, omega_rad_s: number): Point {
  const [p, c] = [plant_at(plant, omega_rad_s), law_at(law, omega_rad_s)];
  return { omega_rad_s, magnitude: p.magnitude * c.magnitude, phase_rad: p.phase_rad + c.phase_rad };
}

// `size` frequencies, evenly spaced in their logarithm.
export const spaced = (from: number, to: number, size: number): number[] =>
  Array.from({ length: size }, (_, at) => from * (to / from) ** (at / (size - 1)));

// How fast the phase of the plant falls, per ln ω: R of (3).
export function phase_fall(plant: Plant, omega_rad_s: number): number {
  const { b1, b2, b3, alpha, beta, dead_time_s } = plant;
  const [first, second] = [b1 * omega_rad_s ** alpha, b2 * omega_rad_s ** beta];
  const [ca, sa] = [Math.cos(alpha * kHalfTurn), Math.sin(alpha * kHalfTurn)];
  const [cb, sb] = [Math.cos(beta * kHalfTurn), Math.sin(beta * kHalfTurn)];
  const [re, im] = [first * ca + second * cb + b3, first * sa + second * sb];
  const [d_re, d_im] = [alpha * first * ca + beta * second * cb, alpha * first * sa + beta * second * sb];
  return (d_im * re - d_re * im) / (re * re + im * im) + omega_rad_s * dead_time_s;
}

export type Solution = { law: Law } | { law: null; why: 'theta' | 'fall' };

const kHalvings = 60; // of an interval below 1: to the last bit

// (3) in closed form. null: it has no solution with 0 < μ < 1, since the controller would have to add more than 90° or
// take away phase (theta), or the phase of the plant falls too fast to be made flat (fall).
export function solve(plant: Plant, { crossover_rad_s, phase_margin_deg }: Specification): Solution {
  const at = plant_at(plant, crossover_rad_s);
  const theta = -Math.PI + radians(phase_margin_deg) - at.phase_rad;
  if (!(theta > 0 && theta < kHalfTurn)) return { law: null, why: 'theta' };
  const fall = phase_fall(plant, crossover_rad_s);
  if (!(fall < Math.sin(2 * theta) / 2)) return { law: null, why: 'fall' };
  const gained = (mu: number) => (mu * Math.sin(theta) * Math.sin(mu * kHalfTurn - theta)) / Math.sin(mu * kHalfTurn);
  let [low, high] = [theta / kHalfTurn, 1];
  for (let halving = 0; halving < kHalvings; ++halving) {
    const middle = (low + high) / 2;
    if (gained(middle) < fall) low = middle;
    else high = middle;
  }
  const mu = (low + high) / 2;
  const kd = Math.sin(theta) / Math.sin(mu * kHalfTurn - theta) / crossover_rad_s ** mu;
  const kp = 1 / (law_at({ kp: 1, kd, mu }, crossover_rad_s).magnitude * at.magnitude);
  return { law: { kp, kd, mu } };
}
