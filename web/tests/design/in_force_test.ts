// What a robot reports that it runs, also of one that has just connected.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { RobotState } from '../../src/api';
import type { Session } from '../../src/session';
import { Store } from '../../src/store';
import { useInForce } from '../../src/views/design/parts';
import type { DesignWork } from '../../src/views/design/work';
import { fake_document, FakeNode } from '../fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

// A page of one robot, whose controller the station reports as `answers` say, one after the other.
function page_of(link: RobotState['link'], answers: boolean[]) {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  const state = { robot_id: 'sim-1', link, mode: 'manual', emergency_id: null, pending_stop: null } as RobotState;
  store.receive({ type: 'welcome', actor: '', version: '', utc_us: 0, stamp_us: 0, robots: [state] });
  store.select('sim-1');
  let looks = 0;
  const in_force = () => Promise.resolve({ is_current: answers[looks++] ?? true });
  const session = { store, phase: signal('live') } as unknown as Session;
  const work = { pushed: signal(null), api: { in_force } } as unknown as DesignWork;
  const Shown = () => h('p', null, String(useInForce(session, work).found?.is_current));
  const page = new FakeNode(1, 'body');
  render(h(Shown, {}), page as unknown as Element);
  return { page, looks: () => looks };
}

test('a connected robot is asked about again until it has reported its controller', async () => {
  const { page, looks } = page_of('connected', [false, false]);
  await vi.advanceTimersByTimeAsync(100);
  expect(page.text).toBe('false');
  await vi.advanceTimersByTimeAsync(5000);
  expect(page.text).toBe('true');
  expect(looks()).toBe(3);
});

test('one that is away is not', async () => {
  const { page, looks } = page_of('disconnected', [false, false]);
  await vi.advanceTimersByTimeAsync(5000);
  expect(page.text).toBe('false');
  expect(looks()).toBe(1);
});
