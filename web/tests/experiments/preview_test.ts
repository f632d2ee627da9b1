// The page's prediction of a profile beside what `rheonaut profile` prints of it, and what is said of a wrong document.
import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import {
  different_runs,
  kPaperModels,
  limit_problem,
  preview_run,
  track_of,
} from '../../src/views/experiments/preview';
import { read_profile, variants_of } from '../../src/views/experiments/profile';
import { sent_form } from '../../src/views/design/control_law';
import { time_line_of } from '../../src/views/experiments/time_line';
import { parse_toml, TextError } from '../../src/views/experiments/toml';

const shipped = (name: string) =>
  read_profile(readFileSync(new URL(`../../../server/experiments/profiles/${name}.toml`, import.meta.url), 'utf8'));

// That of the paper, (30), as `rheonaut discretise --json` prints it: pole and residue of each section. The robot reports
// its sections in another form, which sent_form makes.
const kPrintedSections: [number, number][] = [
  [0.9820792216378375, -0.03590502460702921],
  [0.8874037787971211, -0.5380308532140305],
  [0.6179691844250514, -4.714218933121437],
  [-0.21026782878561448, 115.72756424136892],
  [0.16273769235461144, -61.26262787436915],
];
const controller = {
  ...sent_form({
    period_s: 0.01,
    dc_gain: 65.0028,
    sections: {
      direct: 61.673366227290465,
      first_order: kPrintedSections.map(([pole, residue]) => ({ pole, residue })),
      second_order: [],
    },
  }),
  duty_min: -1,
  duty_max: 1,
};

// What `rheonaut profile NAME --json` prints of each run: duration, actions, least and largest position, travel.
const kPrinted: Record<string, number[][]> = {
  figure_5: [[8, 4, 0, 0.14929, 0.14929]],
  figure_7: [[40, 2, 0, 0.15072, 0.15292]],
  figure_9: [[40, 2, 0, 0.16, 0.23264]],
  figure_8: [
    [20, 1, 0, 0.10038, 0.1013],
    [20, 1, 0, 0.10976, 0.14178],
  ],
  figure_a2: [[12.5, 181, 0, 0.45065, 0.45126]],
  junction: [[130.5, 2401, -0.0004, 1.8004, 3.60157]],
  identification_set: [[193, 1416, -0.30348, 0.00873, 5.41014]],
  three_tones: [[68.9, 1369, -0.03219, 0.04193, 4.34222]],
  orders: [
    [30, 74, -0.13944, 0.00873, 1.32252],
    [30, 74, -0.06972, 0.00437, 0.66126],
    [30, 17, -0.23443, 0.05538, 1.65346],
    [30, 17, -0.11722, 0.02769, 0.82673],
    [30, 601, 0, 0.14835, 1.00127],
    [30, 601, 0, 0.07418, 0.50064],
    [30, 601, -0.01869, 0.0466, 0.45538],
    [30, 601, -0.00934, 0.0233, 0.22769],
  ],
};

test.each(Object.entries(kPrinted))('%s is predicted as the command line does it', (name, printed) => {
  const profile = shipped(name);
  const runs = different_runs(profile);
  expect(runs).toHaveLength(printed.length);
  runs.forEach((variant, index) => {
    const model = kPaperModels[variant.fluid === 'water' ? '(28)' : '(29)'];
    const found = preview_run(profile, variant, model, controller);
    const [duration_s, actions, low_m, high_m, travel_m] = printed[index] as [number, number, number, number, number];
    expect(found.duration_s).toBeCloseTo(duration_s, 6);
    expect(found.line.actions).toHaveLength(actions);
    expect(Math.abs(found.position_min_m - low_m)).toBeLessThan(0.0005);
    expect(Math.abs(found.position_max_m - high_m)).toBeLessThan(0.0005);
    expect(Math.abs(found.travel_m / travel_m - 1)).toBeLessThan(0.01);
    expect(found.problems).toEqual([]);
  });
});

test('the position follows that of the command line through step and disturbance', () => {
  const profile = shipped('figure_7');
  const track = track_of(time_line_of(profile, variants_of(profile)[0]!), kPaperModels['(29)'], controller);
  const at = (time_s: number) => {
    const next = track.t_s.findIndex((each) => each > time_s);
    const [from_s, to_s] = [track.t_s[next - 1]!, track.t_s[next]!];
    const share = (time_s - from_s) / (to_s - from_s);
    return track.position_m[next - 1]! * (1 - share) + track.position_m[next]! * share;
  };
  const printed = [0.0032, 0.0396, 0.0883, 0.0999, 0.1, 0.1112, 0.1502, 0.15];
  [0.1, 0.5, 1, 2, 10, 20.2, 21, 30].forEach((time_s, index) =>
    expect(Math.abs(at(time_s) - printed[index]!)).toBeLessThan(0.001),
  );
  expect(track.setpoint_m[0]).toBe(0.1);
});

const kTooFar = `name = "Too far"
purpose = "It leaves its limits."
[limits]
position_max_m = 0.1
position_min_m = -0.02
[abort]
power_s = 0.5
[sweep]
duty_factor = [1, -1]
repeats = 3
[[step]]
kind = "staircase"
from_duty = 0.5
to_duty = 1
levels = 4
for_s = 4
[[step]]
kind = "ramp"
from_duty = 1
to_duty = -1
for_s = 3
[[step]]
kind = "rest"
for_s = 1
`;

test('where a run leaves the limits is said with step and time, of each different run', () => {
  const profile = read_profile(kTooFar);
  expect(variants_of(profile)).toHaveLength(6);
  const [there, back] = different_runs(profile).map((run) =>
    preview_run(profile, run, kPaperModels['(29)'], controller),
  );
  expect(there!.problems[0]).toMatch(/limits.position_max_m \(100 mm\) after 1\.9 s, in step 1 \(staircase\)/);
  expect(there!.problems[1]).toMatch(/beyond 90 % for 1\.2 s; abort\.power_s ends the run after 0\.5 s/);
  expect(back!.problems[0]).toMatch(/limits.position_min_m \(−20 mm\) after 0\.5 s/);
});

const limits = {
  setpoint_min_m: -0.05,
  setpoint_max_m: 0.2,
  setpoint_step_m: 0.08,
  duty_min: -0.4,
  duty_max: 0.4,
  power_duty: 0.9,
  power_s: 60,
  disturbance_max_m: 0.01,
};
const problem_of = (steps: string, change: Partial<typeof limits> = {}) => {
  const profile = read_profile(`name = "a"\npurpose = "b"\n${steps}`);
  return limit_problem(time_line_of(profile, variants_of(profile)[0]!), { ...limits, ...change }, 'water');
};

test('what the limits of the station forbid is said before it is asked for', () => {
  const to = (setpoint_m: number) => `[[step]]\nkind = "setpoint"\nsetpoint_m = ${setpoint_m}\nfor_s = 1\n`;
  expect(problem_of(to(0.05))).toBeNull();
  expect(problem_of(to(0.3))).toBe(
    'Step 1: a setpoint of 300 mm is refused; −50 to 200 mm is allowed by the station’s limits in water.',
  );
  expect(problem_of(to(0.05) + to(0.15))).toMatch(/^Step 2: the setpoint jumps by 100 mm; 80 mm at once/);
  expect(problem_of('[[step]]\nkind = "duty"\nduty = -0.5\nfor_s = 1\n')).toMatch(/a duty of −50 % is refused/);
  expect(problem_of(`${to(0.05)}[[step]]\nkind = "disturbance"\ndisturbance_m = -0.05\nfor_s = 1\n`)).toMatch(
    /^Step 2: a disturbance of −50 mm/,
  );
});

const refusal = (text: string): string => {
  try {
    read_profile(text);
  } catch (error) {
    if (error instanceof TextError) return `${error.line}: ${error.message}`;
    throw error;
  }
  return '';
};

test('a document that cannot be read is refused with its line', () => {
  const kHead = 'name = "a"\npurpose = "b" # why\n';
  expect(refusal(`${kHead}`)).toBe('1: step is missing: there is no [[step]]');
  expect(refusal(`${kHead}[[step]]\nfor_s = 1\n`)).toMatch(/^3: step\[0\]\.kind is missing; one of rest, duty/);
  expect(refusal(`${kHead}[[step]]\nkind = "duty"\nfor_s = 1\n`)).toBe('3: step[0].duty is missing');
  expect(refusal(`${kHead}[[step]]\nkind = "rest"\nfor_s = "1"\n`)).toBe('5: step[0].for_s is no number');
  expect(refusal(`${kHead}[[step]]\nkind = "rest"\nfor_s = 1\nduty = 0.3\n`)).toMatch(/^6: step\[0\]\.duty is no key/);
  expect(refusal(`name = a\n`)).toMatch(/^1: a is no number, text in quotes/);
  expect(refusal(`name = "a\npurpose`)).toMatch(/^1: the quote at the end/);
  expect(refusal(`${kHead}[limits]\n[limits]\n`)).toBe('4: [limits] is there twice');
  expect(refusal(`${kHead}[[step]]\nkind = "prbs"\namplitude = 0.1\nfor_s = 1\nbit_s = 0\n`)).toMatch(/^7: .*above 0/);
  expect(refusal(`{"name": "a",\n "step": [{]}`)).toBe('2: this is no JSON');
});

test('the parts of TOML in which profiles are written are read', () => {
  const { table, lines } = parse_toml(
    'limits.duty_max = 3e-1\r\nsweep = { repeats = 2, fluids = ["water", \'oil\',\n] }\n[[step]]\nfor_s = -1.5 # s\n[[step]]\nfor_s=2\n',
  );
  expect(table).toEqual({
    limits: { duty_max: 0.3 },
    sweep: { repeats: 2, fluids: ['water', 'oil'] },
    step: [{ for_s: -1.5 }, { for_s: 2 }],
  });
  expect(lines.get('limits.duty_max')).toBe(1);
  expect(lines.get('step[0].for_s')).toBe(5);
  expect(lines.get('step[1]')).toBe(6);
});

test('the same profile as JSON is the same profile', () => {
  const json = '{"name": "a", "purpose": "b", "step": [{"kind": "rest", "for_s": 3}]}';
  expect(read_profile(json)).toEqual(read_profile('name = "a"\npurpose = "b"\n[[step]]\nkind = "rest"\nfor_s = 3\n'));
});
