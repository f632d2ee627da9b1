// What was predicted of experiments: which of it is in the time shown, where it begins, and that nothing is made up.
import { expect, test } from 'vitest';
import type { Experiment } from '../../src/experiments_api';
import type { ExperimentSummary } from '../../src/experiments_store';
import { PredictionLoader, RunningZero } from '../../src/plots/prediction_loader';
import { predicted_at, PredictedBackdrop, type Predicted } from '../../src/plots/predictions';

const kT0_s = 1_000_000_000;
const one: Predicted = {
  key: '1/1',
  zero_s: kT0_s,
  t_s: [0, 1, 2],
  position_m: [0, 0.1, 0.2],
  position_sd_m: [0, 0.01, null],
};

test('the value at a time is that of the point before it', () => {
  expect(predicted_at([one], kT0_s + 1.9)).toEqual({ m: 0.1, sd_m: 0.01 });
  expect(predicted_at([one], kT0_s + 2)).toEqual({ m: 0.2, sd_m: null });
  expect(predicted_at([one], kT0_s - 0.1)).toBeNull();
  expect(predicted_at([one], kT0_s + 2.1)).toBeNull();
});

test('the range of a strip follows what of it is shown', () => {
  const backdrop = new PredictedBackdrop();
  backdrop.predictions = [one];
  expect(backdrop.range({ from_s: kT0_s + 0.5, to_s: kT0_s + 9 })).toEqual([0.1, 0.2]);
  expect(backdrop.range({ from_s: kT0_s + 5, to_s: kT0_s + 9 })).toBeNull();
  expect(backdrop.within({ from_s: kT0_s + 5, to_s: kT0_s + 9 })).toEqual([]);
});

const summary = (change: Partial<ExperimentSummary>) =>
  ({
    experiment_id: 1,
    state: 'done',
    run_counts: { done: 1 },
    started_at_us: kT0_s * 1e6,
    ended_at_us: (kT0_s + 60) * 1e6,
    ...change,
  }) as ExperimentSummary;

function ways_of(list: ExperimentSummary[], run: object = {}, wait_us: number | null = null) {
  const asked: string[] = [];
  const runs = [
    {
      number: 1,
      run_id: 7,
      has_prediction: true,
      started_at_us: (kT0_s + 1) * 1e6,
      ended_at_us: (kT0_s + 50) * 1e6,
      steps: [{ step: 1, kind: 'hold', robot_time_us: 5_000_000 }],
      ...run,
    },
  ];
  const ways = {
    experiments: () => (asked.push('list'), Promise.resolve(list)),
    one: (id: number) => (
      asked.push(`one ${id}`),
      Promise.resolve({ experiment_id: id, runs } as unknown as Experiment)
    ),
    prediction: (id: number, number: number) => {
      asked.push(`prediction ${id}/${number}`);
      return Promise.resolve({ t_s: [0, 1], position_m: [0, 0.1], position_sd_m: null } as never);
    },
    // The run's first sample was made at 2 s of the robot's clock.
    first_sample: () => Promise.resolve({ utc_us: (kT0_s + 2) * 1e6, robot_time_us: 2_000_000 } as never),
    first_wait_us: () => Promise.resolve(wait_us),
  };
  let now_ms = 0;
  const loader = new PredictionLoader(
    ways,
    () => undefined,
    () => now_ms,
  );
  return { loader, asked, pass: (by_ms: number) => (now_ms += by_ms) };
}
const kShown = { from_s: kT0_s, to_s: kT0_s + 60 };

test('it begins where the robot began its first step', async () => {
  const { loader } = ways_of([summary({})]);
  await loader.look(kShown, null);
  expect(loader.found).toHaveLength(1);
  expect(loader.found[0]?.zero_s).toBe(kT0_s + 5);
});

test('it ends where its run was interrupted', async () => {
  const { loader } = ways_of([summary({})], {}, 5_500_000);
  await loader.look(kShown, null);
  expect(loader.found[0]?.t_s).toEqual([0]);
});

test('of an experiment that ran at another time nothing is asked', async () => {
  const { loader, asked } = ways_of([summary({}), summary({ experiment_id: 2, started_at_us: null })]);
  await loader.look({ from_s: kT0_s + 100, to_s: kT0_s + 200 }, null);
  expect(loader.found).toEqual([]);
  expect(asked).toEqual(['list']);
});

test('of one that goes on it begins where the station says, and is not drawn while nobody knows', async () => {
  const going_on = [summary({ state: 'running', ended_at_us: null })];
  const { loader, pass } = ways_of(going_on, { ended_at_us: null, steps: [] });
  await loader.look(kShown, null);
  expect(loader.found).toEqual([]);
  pass(5000);
  await loader.look(kShown, kT0_s + 4);
  expect(loader.found[0]?.zero_s).toBe(kT0_s + 4);
});

test('what does not change is asked for once; the list again after a minute, or when something has changed', async () => {
  const { loader, asked, pass } = ways_of([summary({})]);
  for (let i = 0; i < 3; ++i) {
    await loader.look(kShown, null);
    pass(5000);
  }
  expect(asked).toEqual(['list', 'one 1', 'prediction 1/1']);
  await loader.look(kShown, null, 'another run');
  expect(asked.filter((each) => each === 'list')).toHaveLength(2);
  pass(60_000);
  await loader.look(kShown, null, 'another run');
  expect(asked.filter((each) => each === 'list')).toHaveLength(3);
  expect(asked.filter((each) => each !== 'list')).toEqual(['one 1', 'prediction 1/1']);
});

test('a run without a prediction has none', async () => {
  const { loader } = ways_of([summary({})], { has_prediction: false });
  await loader.look(kShown, null);
  expect(loader.found).toEqual([]);
});

test('the first run of another experiment begins when that one says, and the report that was the least late counts', () => {
  const zero = new RunningZero();
  expect(zero.of('1/1', 0, kT0_s)).toBeNull();
  expect(zero.of('1/1', 5, kT0_s + 5.4)).toBeCloseTo(kT0_s + 0.4, 6);
  expect(zero.of('1/1', 6, kT0_s + 6.1)).toBeCloseTo(kT0_s + 0.1, 6);
  expect(zero.of('1/1', 7, kT0_s + 7.9)).toBeCloseTo(kT0_s + 0.1, 6);
  expect(zero.of('2/1', 1, kT0_s + 901)).toBe(kT0_s + 900);
});
