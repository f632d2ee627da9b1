// Which pages are asked for around a moment, how many at once, and what becomes of a request that fails.
import { expect, test } from 'vitest';
import type { StoredSample } from '../../src/api';
import { kMostSamples, Pages, wanted_pages } from '../../src/views/runs/replay/pages';
import { Reel } from '../../src/views/runs/replay/reel';
import { settle } from '../fakes';
import { at, kOrigin_us, kPeriod_us, samples } from './made';

function pages_of(size: number) {
  const reel = new Reel(kOrigin_us, kPeriod_us);
  const asked: { from: number; limit: number; answer(list: StoredSample[] | Error): void }[] = [];
  const timers: (() => void)[] = [];
  const told: number[] = [];
  const pages = new Pages(
    reel,
    {
      samples: (from_us, _, limit) =>
        new Promise((resolve, reject) =>
          asked.push({
            from: (from_us - kOrigin_us) / kPeriod_us,
            limit,
            answer: (list) => (list instanceof Error ? reject(list) : resolve(list)),
          }),
        ),
      set_timer: (callback) => timers.push(callback),
    },
    () => told.push(1),
  );
  const look = (seq: number, speed = 1, shown_s = 60) => pages.look(at(seq), speed, shown_s, at(size));
  const answer = async (list: StoredSample[] | Error) => {
    asked.shift()?.answer(list);
    await settle();
  };
  return { reel, pages, asked, timers, told, look, answer };
}

test('the page of the moment comes first, then the one after and before it', () => {
  expect(wanted_pages(5, 2, 2, 100)).toEqual([5, 6, 4, 7, 3]);
  expect(wanted_pages(0, 2, 3, 1)).toEqual([0, 1]);
});

test('a few pages of bounded size are on their way at once', async () => {
  const { asked, look, answer } = pages_of(20_000);
  look(5500);
  expect(asked.map(({ from }) => from)).toEqual([5000, 6000, 4000]);
  expect(asked.every(({ limit }) => limit === kMostSamples)).toBe(true);
  await answer(samples(5000, 6000));
  expect(asked).toHaveLength(3);
  look(5500);
  expect(asked).toHaveLength(3);
});

test('the faster it plays, the further ahead it reads, within bounds', async () => {
  const { asked, look, answer, reel } = pages_of(1_000_000);
  look(0, 100, 10);
  for (let at_page = 0; asked.length > 0 && at_page < 100; ++at_page) {
    const from = asked[0]?.from ?? 0;
    await answer(samples(from, from + 1000));
  }
  expect(reel.page(24)).not.toBeNull();
  expect(reel.page(25)).toBeNull();
});

test('it is ready until the first page that is missing, and beyond a page without samples', async () => {
  const { pages, look, answer } = pages_of(20_000);
  look(0);
  expect(pages.ready_to_us(at(3))).toBe(at(3));
  await answer(samples(0, 1000));
  expect(pages.ready_to_us(at(3))).toBe(at(1000));
  await answer([]);
  expect(pages.ready_to_us(at(3))).toBe(at(2000));
});

test('what a run has gained since is asked for again', async () => {
  const { pages, asked, look, answer } = pages_of(500);
  look(0);
  expect(asked).toHaveLength(1);
  await answer(samples(0, 500));
  expect(asked).toHaveLength(0);
  pages.look(at(0), 1, 60, at(700));
  expect(asked).toHaveLength(1);
});

test('a request that fails is said, and made again after a second', async () => {
  const { pages, asked, look, answer, timers } = pages_of(500);
  look(0);
  await answer(new Error('The station did not answer.'));
  expect(pages.problem.value).toBe('The station did not answer.');
  expect(asked).toHaveLength(0);
  look(0);
  expect(asked).toHaveLength(0);
  timers.shift()?.();
  expect(asked).toHaveLength(1);
  await answer(samples(0, 500));
  expect(pages.problem.value).toBe('');
});

test('an answer that is not wanted any more takes no place', async () => {
  const { reel, look, answer } = pages_of(1_000_000);
  look(0);
  look(500_000);
  await answer(samples(0, 1000));
  expect(reel.page(0)).toBeNull();
});
