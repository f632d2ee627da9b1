// The page's frequency response and its solution of the tuning equations, beside the reference values of the project.
import { readFileSync } from 'node:fs';
import { describe, expect, test } from 'vitest';
import {
  decibels,
  degrees,
  kPaperPlants,
  law_at,
  loop_at,
  phase_fall,
  plant_at,
  solve,
} from '../../src/views/design/frequency';

const golden = (name: string): unknown =>
  JSON.parse(readFileSync(new URL(`../../../tests/data/${name}.json`, import.meta.url), 'utf8'));
const paper_law = { kp: 65.0028, kd: 0.0305, mu: 0.6524 };

interface Bode {
  w: number[];
  mag_db: number[];
  phase_deg: number[];
  key: Record<string, Record<string, number>>;
}
interface Tuned {
  w_gc: number;
  phi_m: number;
  kp: number;
  kd: number;
  mu: number;
}

describe('the open loop of the paper', () => {
  const bode = golden('bode_open_loop') as Bode;

  test('has the magnitude and the unwrapped phase of the reference to 1e-9', () => {
    bode.w.forEach((omega_rad_s, at) => {
      const loop = loop_at(kPaperPlants['29'], paper_law, omega_rad_s);
      expect(Math.abs(decibels(loop.magnitude) - bode.mag_db[at]!)).toBeLessThan(
        1e-9 * Math.max(1, Math.abs(bode.mag_db[at]!)),
      );
      expect(Math.abs(degrees(loop.phase_rad) - bode.phase_deg[at]!)).toBeLessThan(
        1e-9 * Math.abs(bode.phase_deg[at]!),
      );
    });
  });

  test('has the parts that the reference names', () => {
    const { H_mag, H_phase_deg, C_mag, C_phase_deg, dphase_rad_per_radps } = bode.key['at65'] as Record<string, number>;
    expect(plant_at(kPaperPlants['29'], 65).magnitude / H_mag!).toBeCloseTo(1, 12);
    expect(degrees(plant_at(kPaperPlants['29'], 65).phase_rad) / H_phase_deg!).toBeCloseTo(1, 12);
    expect(law_at(paper_law, 65).magnitude / C_mag!).toBeCloseTo(1, 12);
    expect(degrees(law_at(paper_law, 65).phase_rad) / C_phase_deg!).toBeCloseTo(1, 12);
    const step = 1e-3;
    const slope =
      (loop_at(kPaperPlants['29'], paper_law, 65 + step).phase_rad -
        loop_at(kPaperPlants['29'], paper_law, 65 - step).phase_rad) /
      (2 * step);
    expect(slope / dphase_rad_per_radps!).toBeCloseTo(1, 6);
  });

  test('a dead time turns the phase and nothing else', () => {
    const late = { ...kPaperPlants['29'], dead_time_s: 0.07 };
    expect(plant_at(late, 5).magnitude).toBe(plant_at(kPaperPlants['29'], 5).magnitude);
    expect(plant_at(kPaperPlants['29'], 5).phase_rad - plant_at(late, 5).phase_rad).toBeCloseTo(0.35, 12);
    expect(phase_fall(late, 5) - phase_fall(kPaperPlants['29'], 5)).toBeCloseTo(0.35, 12);
  });
});

describe('the tuning equations', () => {
  const solutions = golden('tuning_solutions') as { exact_isodamped: Tuned[]; R_half_crossings: number[] };

  test('give the controllers of the reference', () => {
    for (const { w_gc, phi_m, kp, kd, mu } of solutions.exact_isodamped) {
      const found = solve(kPaperPlants['29'], { crossover_rad_s: w_gc, phase_margin_deg: phi_m }).law;
      expect(found).not.toBeNull();
      expect(found!.kp / kp).toBeCloseTo(1, 7);
      expect(found!.kd / kd).toBeCloseTo(1, 7);
      expect(found!.mu / mu).toBeCloseTo(1, 7);
    }
  });

  test('meet what was asked, with a flat phase', () => {
    const { law } = solve(kPaperPlants['29'], { crossover_rad_s: 3, phase_margin_deg: 95 });
    const loop = loop_at(kPaperPlants['29'], law!, 3);
    expect(loop.magnitude).toBeCloseTo(1, 12);
    expect(degrees(loop.phase_rad) + 180).toBeCloseTo(95, 10);
    const step = 1e-4;
    const turned =
      loop_at(kPaperPlants['29'], law!, 3 + step).phase_rad - loop_at(kPaperPlants['29'], law!, 3 - step).phase_rad;
    expect(Math.abs(turned / (2 * step))).toBeLessThan(1e-9);
  });

  test('have no solution where the controller would have to add too much, and where the phase falls too fast', () => {
    expect(solve(kPaperPlants['29'], { crossover_rad_s: 65, phase_margin_deg: 72 })).toEqual({
      law: null,
      why: 'theta',
    });
    expect(solve(kPaperPlants['29'], { crossover_rad_s: 20, phase_margin_deg: 60 })).toEqual({
      law: null,
      why: 'fall',
    });
    for (const crossing of solutions.R_half_crossings)
      expect(phase_fall(kPaperPlants['29'], crossing)).toBeCloseTo(0.5, 6);
  });
});
