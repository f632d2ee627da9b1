// Model against data: residuals beside samples, what is drawn of them, and what a fit is worth in words.
import { expect, test } from 'vitest';
import type { Identified } from '../../src/views/design/design_api';
import { residuals_of, samples_of, thinned, traces_of_fit, window_of } from '../../src/views/design/fit_data';
import { knowledge_text, sentences_of, with_sigma } from '../../src/views/design/words';

const sample = (at: number, acceleration_m_s2: number | null = at / 10) => ({
  robot_time_us: 2_000_000 + at * 10_000,
  acceleration_m_s2,
  position_m: 0,
  velocity_m_s: 0,
});
const of = (acceleration_m_s2: (number | null)[]) => ({ position_m: [], velocity_m_s: [], acceleration_m_s2 });

test('the model is what was measured less what is left over, from the beginning of the window on', () => {
  const samples = Array.from({ length: 10 }, (_, at) => sample(at));
  const found = traces_of_fit(of([0.01, null, -0.02]), samples, 0.03)!;
  expect(found.channel).toBe('acceleration_m_s2');
  expect(found.time_s).toEqual([0.03, 0.04, 0.05]);
  expect(found.measured).toEqual([0.3, 0.4, 0.5]);
  expect(found.model?.[0]).toBeCloseTo(0.29, 12);
  expect(found.model?.[1]).toBeNull();
  expect(found.model?.[2]).toBeCloseTo(0.52, 12);
});

test('where ticks are missing, nothing is laid beside what is left over', () => {
  const gap = [sample(0), sample(1), sample(3), sample(4)];
  expect(traces_of_fit(of([0, 0, 0, 0]), gap, 0)).toMatchObject({
    measured: null,
    model: null,
    residual: [0, 0, 0, 0],
  });
  expect(traces_of_fit(of([0, 0, 0]), [sample(0), sample(1)], 0)?.measured).toBeNull();
  expect(traces_of_fit(of([]), [sample(0)], 0)).toBeNull();
});

test('the window is the one that the station had to cut out', () => {
  const warning =
    'the recording has gaps: fitted is its longest part without one that begins at rest, from 3.210 to 18.700 s';
  expect(window_of(['b1 and alpha have a correlation', warning], 1)).toBe(3.21);
  expect(window_of([], 1)).toBe(1);
});

test('of a joint fit each run has residuals of its own', () => {
  const joint = {
    runs: [
      { run_id: 3, residuals: of([1]) },
      { run_id: 4, residuals: of([2]) },
    ],
  } as unknown as Identified;
  expect(residuals_of(joint, 1)).toEqual({ run_id: 4, residuals: of([2]) });
  expect(residuals_of({ run_id: 3, residuals: of([1]) } as unknown as Identified, 0).run_id).toBe(3);
});

test('samples come page by page, and those of another boot are left out', async () => {
  const pages: Record<string, { samples: { span: number; seq: number }[]; next: string | null }> = {
    start: { samples: [{ span: 0, seq: 1 }], next: '0-1' },
    '0-1': {
      samples: [
        { span: 0, seq: 2 },
        { span: 1, seq: 3 },
      ],
      next: null,
    },
  };
  const found = await samples_of({ samples: (_, after) => Promise.resolve(pages[after ?? 'start'] as never) }, 3);
  expect(found.map(({ seq }) => seq)).toEqual([1, 2]);
});

test('samples of a later boot are read when they are asked for, and nothing after them', async () => {
  const asked: (string | null)[] = [];
  const spans = [0, 1, 1, 2, 3];
  const api = {
    samples: (_: number, after: string | null) => {
      asked.push(after);
      const page = after === null ? 0 : Number(after);
      const samples = [{ span: spans[page], seq: page }];
      return Promise.resolve({ samples, next: page + 1 < spans.length ? String(page + 1) : null } as never);
    },
  };
  expect((await samples_of(api, 3, [1])).map(({ seq }) => seq)).toEqual([1, 2]);
  expect(asked).toEqual([null, '1', '2', '3']);
  expect((await samples_of(api, 3, [0, 2])).map(({ seq }) => seq)).toEqual([0, 3]);
});

test('a long stretch is thinned, and no peak is lost', () => {
  const residual = Array.from({ length: 1000 }, (_, at) => (at === 501 ? 5 : at === 777 ? -5 : Math.sin(at)));
  const traces = {
    channel: 'acceleration_m_s2',
    time_s: residual.map((_, at) => at / 100),
    measured: null,
    model: null,
    residual,
  } as const;
  const shown = thinned({ ...traces, time_s: [...traces.time_s] }, 0, 10, 100);
  expect(shown.time_s.length).toBeLessThanOrEqual(100);
  expect(Math.max(...(shown.residual as number[]))).toBe(5);
  expect(Math.min(...(shown.residual as number[]))).toBe(-5);
  expect(thinned({ ...traces, time_s: [...traces.time_s] }, 5, 5.2, 100).time_s).toHaveLength(21);
});

test('a value has as many digits as its sigma allows', () => {
  expect(with_sigma(0.09981236, 0.0015888)).toBe('0.0998 ± 0.0016');
  expect(with_sigma(1.6784, 0.0714)).toBe('1.678 ± 0.071');
  expect(with_sigma(2, null)).toBe('2');
});

test('how well a parameter is known is said in words', () => {
  expect(knowledge_text(0.1, 0.001)).toBe('well known, to 1 %');
  expect(knowledge_text(0.1, 0.005)).toBe('roughly known, to 5 %');
  expect(knowledge_text(0.0068, 0.0022)).toBe('hardly known, to 32 %');
  expect(knowledge_text(2, null)).toBe('fixed by the structure');
  expect(knowledge_text(2, 0.003, true)).toBe('at its bound, where its ± means little');
});

test('what a fit is worth is said in sentences', () => {
  const fit = {
    structure: 'fractional',
    parameters: { kp: 0.1, b1: 0.0068, b2: 0.11, b3: 1, alpha: 1.68, beta: 0.85, dead_time_s: 0 },
    one_sigma: { kp: 0.0016, b1: 0.0022, b2: 0.0073, alpha: 0.07, beta: 0.05 },
    aic: -13066,
    end: 'converged',
    residuals_are_white: false,
    compared: [
      { structure: 'fractional', aic: -13066 },
      { structure: 'second_order', aic: -13012 },
      { structure: 'first_order', aic: -10454 },
    ],
  } as unknown as Identified;
  expect(sentences_of(fit)).toEqual([
    'Fractional is clearly better than second order: its AIC is lower by 54.',
    'What is left over is not noise alone: the true errors are larger than the ± of the parameters.',
    'b1 is hardly known: a duty that changes faster, or another run, tells more.',
  ]);
  expect(sentences_of({ ...fit, residuals_are_white: true, aic: -13015, end: 'time_limit' })).toEqual([
    'Fractional is hardly better than second order: its AIC is lower by 3.',
    'What is left over looks like noise alone, so the ± can be believed.',
    'b1 is hardly known: a duty that changes faster, or another run, tells more.',
    'The search did not come to its end (time limit).',
  ]);
  expect(sentences_of({ ...fit, residuals_are_white: true, drift_factor: 2.68 })).toContain(
    'What is left over drifts slowly: the true errors may be up to 2.7 times the ± of the parameters.',
  );
});
