// What the robot measured during a step, as it is drawn beside the prediction.
import { expect, test } from 'vitest';
import { measured_parts, spans_of } from '../../src/views/design/verify_plot';

const sample = (seq: number, span = 0) => ({
  span,
  seq,
  robot_time_us: seq * 10_000,
  position_m: seq / 1000,
  position_sd_m: 0.001,
});
const row = ({ seq, position_m, position_sd_m }: ReturnType<typeof sample>) => ({
  t_s: expect.closeTo((seq - 100) / 100, 9) as number,
  position_m,
  sd_m: position_sd_m,
});
const step = { span: 0, first_seq: 100, last_seq: 199 };

test('a step begins at its first sample, and has nothing of others', () => {
  const samples = [sample(99), ...Array.from({ length: 120 }, (_, at) => sample(100 + at)), sample(150, 1)];
  const [part, ...more] = measured_parts(samples, step, 60);
  expect(more).toEqual([]);
  expect(part).toHaveLength(100);
  expect(part![0]).toEqual({ t_s: 0, position_m: 0.1, sd_m: 0.001 });
  expect(part!.at(-1)!.t_s).toBeCloseTo(0.99);
  expect(measured_parts(samples, step, 0.5)[0]!.at(-1)!.t_s).toBeCloseTo(0.5);
});

test('a step after the robot has restarted is drawn from the samples of its own boot', () => {
  const steps = [
    { ...step, span: 1 },
    { ...step, span: 1 },
    { ...step, span: 3 },
  ];
  expect(spans_of(steps.map((each) => ({ step: each })))).toEqual([1, 3]);
  const samples = [...Array.from({ length: 3 }, (_, at) => sample(100 + at)), sample(100, 1), sample(101, 1)];
  expect(measured_parts(samples, steps[0]!, 60)).toEqual([[sample(100, 1), sample(101, 1)].map(row)]);
});

test('no line is drawn over samples that are missing, nor where the ± is not known', () => {
  const samples = [100, 101, 104, 105, 106].map((seq) => sample(seq));
  const with_hole = samples.map((each) => (each.seq === 105 ? { ...each, position_sd_m: null } : each));
  const seqs = measured_parts(with_hole, step, 60).map((part) => part.map(({ t_s }) => Math.round(t_s * 100)));
  expect(seqs).toEqual([[0, 1], [4], [6]]);
});

test('a long step has few rows, and its gaps', () => {
  const samples = Array.from({ length: 4000 }, (_, at) => sample(at < 2000 ? at : at + 7));
  const parts = measured_parts(samples, { span: 0, first_seq: 0, last_seq: 9999 }, 60);
  expect(parts).toHaveLength(2);
  expect(parts.flat().length).toBeLessThanOrEqual(602);
});
