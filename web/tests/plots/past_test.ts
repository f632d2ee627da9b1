// What the station has recorded, in tiles: which are asked for, when again, and what they say.
import { expect, test } from 'vitest';
import type { Overview, StoredSample } from '../../src/api';
import {
  kTilePoints,
  level_of,
  Past,
  tile_of_overview,
  tile_of_samples,
  tile_span_s,
  type Tile,
} from '../../src/plots/past';
import { settle } from '../fakes';

const overview = (change: Partial<Overview> = {}): Overview => ({
  source: 'rows',
  first_utc_us: [],
  last_utc_us: [],
  samples: [],
  gaps: [],
  gaps_next: null,
  ...change,
});

function station() {
  const world = { now_s: 10_000, asked: [] as string[], answers: [] as (() => void)[], fails: false, changes: 0 };
  const answer = <T>(value: T) =>
    new Promise<T>((done, fail) => world.answers.push(() => (world.fails ? fail(new Error('gone')) : done(value))));
  const past = new Past(
    {
      samples: (from_us, to_us) => {
        world.asked.push(`samples ${from_us / 1e6} ${to_us / 1e6}`);
        return answer<StoredSample[]>([]);
      },
      overview: (from_us, to_us) => {
        world.asked.push(`overview ${from_us / 1e6} ${to_us / 1e6}`);
        return answer(overview({ first_utc_us: [from_us], last_utc_us: [from_us + 1000] }));
      },
      now_s: () => world.now_s,
    },
    () => (world.changes += 1),
  );
  const look = (from_s: number, to_s: number, bin_s: number) => {
    const points: [Tile, number][] = [];
    past.begin();
    past.visit(from_s, to_s, bin_s, (tile, at) => points.push([tile, at]));
    past.end();
    return points;
  };
  const answer_all = async () => {
    for (const each of world.answers.splice(0)) each();
    await settle();
  };
  return { world, past, look, answer_all };
}

test('the level is the coarsest that has a point for each bin', () => {
  expect(level_of(0.06)).toBe(0);
  for (const bin_s of [0.1, 0.6, 3.6, 86.4]) {
    const level = level_of(bin_s);
    expect(tile_span_s(level) / kTilePoints).toBeLessThanOrEqual(bin_s);
    expect(tile_span_s(level + 1) / kTilePoints).toBeGreaterThan(bin_s);
  }
});

test('two tiles at a time are asked for, the newest first, each once', async () => {
  const { world, look, answer_all } = station();
  look(9000, 9300, 0.3);
  expect(world.asked).toEqual(['overview 9240 9300', 'overview 9180 9240']);
  look(9000, 9300, 0.3);
  expect(world.asked).toHaveLength(2);
  await answer_all();
  expect(world.changes).toBe(2);
  look(9000, 9300, 0.3);
  expect(world.asked).toHaveLength(4);
});

test('a tile that was asked for in the middle of its time is asked for again, and not at once', async () => {
  const { world, look, answer_all } = station();
  world.now_s = 9290;
  look(9240, 9289, 0.1);
  await answer_all();
  look(9240, 9280, 0.1);
  expect(world.asked).toHaveLength(1);
  look(9240, 9289, 0.1);
  expect(world.asked).toHaveLength(1);
  world.now_s = 9296;
  look(9240, 9289, 0.1);
  expect(world.asked).toHaveLength(2);
  await answer_all();
  world.now_s = 9999;
  look(9240, 9289, 0.1);
  expect(world.asked).toHaveLength(2);
});

test('until the finer tile has come, the coarser one is drawn', async () => {
  const { look, answer_all } = station();
  look(9240, 9300, 0.1);
  await answer_all();
  const points = look(9240, 9250, 0.01);
  expect(points.map(([tile]) => tile.to_s - tile.from_s)).toEqual([60]);
});

test('a failure is told, tried again later, and forgotten when it works', async () => {
  const { world, past, look, answer_all } = station();
  world.fails = true;
  look(9240, 9300, 0.1);
  await answer_all();
  expect(past.problem).toBe('gone');
  look(9240, 9300, 0.1);
  expect(world.asked).toHaveLength(1);
  world.now_s += 10;
  world.fails = false;
  look(9240, 9300, 0.1);
  await answer_all();
  expect(past.problem).toBeNull();
});

test('of samples the estimate and its spread are made; an overview has them', () => {
  const sample = {
    utc_us: 5_000_000,
    position_m: 0.1,
    disturbance_m: -0.05,
    position_sd_m: 0.003,
    setpoint_m: null,
    reference_m: 0,
  } as StoredSample;
  const { columns } = tile_of_samples([sample]);
  const of = (name: keyof typeof columns) => Number((columns[name]?.min[0] ?? NaN).toFixed(9));
  expect([of('estimate_m'), of('estimate_low_m'), of('estimate_high_m')]).toEqual([0.15, 0.144, 0.156]);
  expect(columns.reference_m?.min[0]).toBeNaN(); // it follows nothing
  const far = tile_of_overview(
    overview({
      first_utc_us: [0, 1e6],
      last_utc_us: [0.5e6, 1.5e6],
      position_m: { min: [0.1, null], max: [0.12, null] },
      reference_m: { min: [0, 0.1], max: [0, 0.1] },
      estimated_position_m: { min: [0.15, null], max: [0.17, null] },
      position_sd_m: { min: [0.001, 0.001], max: [0.003, 0.003] },
      setpoint_m: { min: [0.1, null], max: [0.12, null] },
    }),
  ).columns;
  const first = (values?: Float64Array) => Number(values![0]!.toFixed(9));
  expect([first(far.estimate_m?.min), first(far.estimate_m?.max)]).toEqual([0.15, 0.17]);
  expect([first(far.estimate_low_m?.min), first(far.estimate_high_m?.max)]).toEqual([0.144, 0.176]);
  expect(far.estimate_low_m?.min[1]).toBeNaN();
  expect([...far.setpoint_m!.max]).toEqual([0.12, NaN]);
  expect(far.disturbance_m).toBeUndefined();
  expect([...far.position_m!.max]).toEqual([0.12, NaN]);
  expect([...far.reference_m!.max]).toEqual([NaN, 0.1]);
});
