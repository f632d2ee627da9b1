// What is sent to a robot, beside what the station made of the same discretisation, and one step of it.
import { expect, test } from 'vitest';
import { RunningLaw } from '../../src/running_law';
import { compared, sent_form, type Discretised } from '../../src/views/design/control_law';

// `discretised` of a job `tune` (3 rad/s, 90°), and what the robot then reported.
const discretised: Discretised = {
  period_s: 0.01,
  dc_gain: 30.06694960048445,
  sections: {
    direct: -540.7185172954745,
    first_order: [
      { pole: -0.7976132244224208, residue: 779.928744046087 },
      { pole: 0.8612354420477, residue: -0.7057142433077175 },
      { pole: -0.6275331535482789, residue: 92.2003770610818 },
      { pole: 0.4260179261093685, residue: -15.543442244625206 },
      { pole: -0.18669686743126856, residue: 133.42239477921126 },
    ],
    second_order: [],
  },
};
const numerator = [
  448.5838421029726, -566.4736137899673, -119.61325857722892, 287.0548265460046, -22.698340272902882, -18.5390323580625,
];
const denominator = [
  1, 0.32458987724489974, -0.9413498032400964, -0.30197204721395066, 0.16097638740455558, 0.03428592098304612,
];

test('the sections become the strictly proper ones of the robot', () => {
  const sent = sent_form(discretised);
  expect(sent.period_us).toBe(10_000);
  expect(sent.direct).toBe(Math.fround(448.5838421029726));
  expect(sent.residue?.[0]).toBe(Math.fround(779.928744046087 * -0.7976132244224208));
});

test('a second order section as well', () => {
  const { sections } = discretised;
  const sent = sent_form({
    ...discretised,
    sections: { ...sections, direct: 1, first_order: [], second_order: [{ b0: 2, b1: 0.5, a1: -0.4, a2: 0.1 }] },
  });
  expect(sent.direct).toBe(3);
  expect([sent.biquad_b0, sent.biquad_b1]).toEqual([[Math.fround(0.5 + 0.8)], [Math.fround(-0.2)]]);
  const law = new RunningLaw({ ...sent, kp: 1 + 2.5 / 0.7 }, -1e9, 1e9);
  const response = [1, 0, 0, 0].map((error) => law.step(error));
  // 1 + (2 + 0.5 w)/(1 - 0.4 w + 0.1 w²), by long division
  [3, 1.3, 0.32, -0.002].forEach((value, at) => expect(response[at]).toBeCloseTo(value, 5));
});

test('it does what the quotient of the discretisation does', () => {
  const law = new RunningLaw(sent_form(discretised), -1e9, 1e9);
  const errors = [0.1, 0.1, 0.08, 0.05, -0.02, 0.01, 0, 0, 0.03, 0.03];
  const outputs: number[] = [];
  errors.forEach((error, k) => {
    let output = 0;
    numerator.forEach((b, at) => (output += b * (errors[k - at] ?? 0)));
    denominator.slice(1).forEach((a, at) => (output -= a * (outputs[k - at - 1] ?? 0)));
    outputs.push(output);
    expect(law.step(error)).toBeCloseTo(output, 3); // float32 beside double
  });
});

test('the duty is clamped, and what is clamped is not remembered', () => {
  const free = new RunningLaw(sent_form(discretised), -1e9, 1e9);
  const clamped = new RunningLaw(sent_form(discretised), 0, 1);
  for (const error of [0.1, 0.1, -0.05, 0.0002]) {
    expect(clamped.step(error)).toBe(Math.min(1, Math.max(0, free.step(error))));
  }
});

test('coefficients are the same bit for bit, or not', () => {
  const sent = sent_form(discretised);
  expect(compared(sent, sent).every(({ is_same }) => is_same)).toBe(true);
  expect(compared(sent, sent)).toHaveLength(12);
  const next_float = { ...sent, pole: sent.pole!.map((pole, at) => (at === 1 ? pole! + 1e-7 : pole)) };
  expect(
    compared(sent, next_float)
      .filter(({ is_same }) => !is_same)
      .map(({ name }) => name),
  ).toEqual(['pole 2']);
  expect(compared(sent, { ...sent, pole: sent.pole!.slice(0, 4) }).filter(({ is_same }) => !is_same)).toHaveLength(1);
  expect(compared(sent, null).some(({ is_same }) => is_same)).toBe(false);
});
