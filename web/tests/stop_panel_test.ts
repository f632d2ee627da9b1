// The guarded way out of a latch.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { RobotState } from '../src/api';
import { kIdleStop } from '../src/emergency';
import { kGuard_ms } from '../src/parts/hold_button';
import { StopPanel } from '../src/parts/stop_panel';
import type { Session } from '../src/session';
import { Store } from '../src/store';
import { fake_document, FakeNode } from './fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
  vi.stubGlobal('window', globalThis);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const latched = (emergency_id: string) =>
  ({
    robot_id: 'a',
    link: 'connected',
    mode: 'emergency',
    emergency_id,
    emergency_cause: 'operator',
    control: null,
    reservation: null,
    pending_stop: null,
  }) as RobotState;

// The page of an operator who may clear; `cleared`: the emergencies that it has asked to clear.
function drawn_with(state: RobotState) {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots: [state] });
  store.is_current.value = true;
  store.refresh();
  const cleared: string[] = [];
  const session = {
    store,
    me: signal({ role: 'operator' }),
    stop_state: signal(kIdleStop),
    emergency: { forget: () => undefined },
    api: { clear_emergency: (_: string, id: string) => Promise.resolve(void cleared.push(id)) },
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  render(h(StopPanel, { session }), page as unknown as Element);
  const receive = (next: RobotState) => {
    store.receive({ type: 'robot', robot: next });
    store.refresh();
  };
  return { page, receive, cleared };
}

test('the latch is cleared by a hold of a whole second', async () => {
  const { page, cleared } = drawn_with(latched('A'));
  await vi.advanceTimersByTimeAsync(100);
  page.find('clear-emergency')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(kGuard_ms - 1);
  expect(cleared).toEqual([]);
  await vi.advanceTimersByTimeAsync(1);
  expect(cleared).toEqual(['A']);
});

// SAFETY: whoever holds has seen the emergency before, not the one that has come since.
test('a hold that began before another emergency clears neither', async () => {
  const { page, receive, cleared } = drawn_with(latched('A'));
  await vi.advanceTimersByTimeAsync(100);
  page.find('clear-emergency')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(900);
  receive(latched('B'));
  await vi.advanceTimersByTimeAsync(5 * kGuard_ms);
  expect(page.find('clear-emergency')!.text).toContain('B');
  expect(cleared).toEqual([]);
});
