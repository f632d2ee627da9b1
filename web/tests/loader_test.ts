// The code of a view that comes later, or not at once.
import { expect, test } from 'vitest';
import { kTryAgain_ms, ViewLoader } from '../src/views/loader';
import type { View } from '../src/views/table';
import { FakeTime, settle } from './fakes';

function view_that_fails(times: number) {
  let loads = 0;
  const view: View = {
    name: 'x',
    title: 'X',
    key: 'x',
    load: () => (++loads > times ? Promise.resolve({ default: () => null }) : Promise.reject(new Error('away'))),
  };
  return { view, loads: () => loads };
}

test('a view is loaded once, when it is first asked for', async () => {
  const time = new FakeTime();
  const loader = new ViewLoader((callback, delay_ms) => time.set(callback, delay_ms));
  const { view, loads } = view_that_fails(0);
  expect(loads()).toBe(0);
  loader.of(view);
  await settle();
  expect(loader.of(view).value.module).not.toBeNull();
  expect(loads()).toBe(1);
});

test('one that could not be loaded says so, and comes by itself', async () => {
  const time = new FakeTime();
  const loader = new ViewLoader((callback, delay_ms) => time.set(callback, delay_ms));
  const { view, loads } = view_that_fails(3);
  const loading = loader.of(view);
  await settle();
  expect(loading.value).toEqual({ module: null, failures: 1 });
  await time.advance(2 * kTryAgain_ms);
  expect(loading.value.failures).toBe(3);
  await time.advance(kTryAgain_ms);
  expect(loading.value.module).not.toBeNull();
  await time.advance(10 * kTryAgain_ms);
  expect(loads()).toBe(4);
});
