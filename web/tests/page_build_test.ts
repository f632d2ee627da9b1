// A page that stays open while the station gets another version of it.
import { signal } from '@preact/signals';
import { beforeEach, expect, test } from 'vitest';
import type { LinkPhase } from '../src/live';
import { files_of, follow_build, is_outdated, kLookAgain_ms } from '../src/page_build';
import { FakeTime, settle } from './fakes';

const page_of = (digest: string) =>
  `<html><head><link rel="icon" href="/favicon.svg"><script type="module" crossorigin="" src="/assets/index-${digest}.js"></script>` +
  `<link rel="stylesheet" href="/assets/index-${digest}.css"></head></html>`;

beforeEach(() => {
  is_outdated.value = false;
});

function followed(own_html = page_of('one')) {
  const time = new FakeTime();
  const phase = signal<LinkPhase>('connecting');
  const world = { time, phase, served: page_of('one') as string | null, looks: 0 };
  follow_build({
    own_html,
    phase,
    served_html: () => {
      world.looks += 1;
      return world.served === null ? Promise.reject(new Error('away')) : Promise.resolve(world.served);
    },
    set_timer: (callback, delay_ms) => time.set(callback, delay_ms),
  });
  return world;
}

test('the built files of a page are found, in whatever way it is written down', () => {
  expect(files_of(page_of('one'))).toBe('/assets/index-one.css /assets/index-one.js');
  expect(files_of('<script src="/src/main.tsx"></script>')).toBe('');
});

test('it is judged with each connection, and not before the first', async () => {
  const world = followed();
  await settle();
  expect(world.looks).toBe(0);
  world.phase.value = 'live';
  await settle();
  expect([world.looks, is_outdated.value]).toEqual([1, false]);
  world.phase.value = 'waiting';
  world.served = page_of('two');
  world.phase.value = 'live';
  await settle();
  expect([world.looks, is_outdated.value]).toEqual([2, true]);
});

test('a station that is put back to the version before has the same page again', async () => {
  const world = followed();
  for (const [digest, outdated] of [
    ['two', true],
    ['one', false],
  ] as const) {
    world.phase.value = 'waiting';
    world.served = page_of(digest);
    world.phase.value = 'live';
    await settle();
    expect(is_outdated.value).toBe(outdated);
  }
});

test('a look that fails is made again, while there is a connection', async () => {
  const world = followed();
  world.served = null;
  world.phase.value = 'live';
  await settle();
  expect(is_outdated.value).toBe(false);
  world.served = page_of('two');
  await world.time.advance(kLookAgain_ms);
  expect(is_outdated.value).toBe(true);
  world.served = null;
  world.phase.value = 'waiting';
  world.phase.value = 'live';
  await settle();
  world.phase.value = 'waiting';
  const { looks } = world;
  await world.time.advance(3 * kLookAgain_ms);
  expect(world.looks).toBe(looks);
});

test('a page that was not built, and an answer that is no page, say nothing', async () => {
  const world = followed('<html></html>');
  world.served = '<html>Sign in first</html>';
  world.phase.value = 'live';
  await settle();
  expect(is_outdated.value).toBe(false);
});
