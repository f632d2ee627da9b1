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
  fake_document.activeElement = null;
  vi.stubGlobal('document', fake_document);
  vi.stubGlobal('window', globalThis);
  for (const name of ['addEventListener', 'removeEventListener']) vi.stubGlobal(name, () => undefined);
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
  const pressed: string[] = [];
  const forgotten: [string, number][] = []; // robot and press that the latch hands on when it is cleared
  const emergency = { newest_press: 4, cleared: (...given: [string, number]) => void forgotten.push(given) };
  const session = {
    store,
    me: signal({ role: 'operator' }),
    stop_path: { hindrance: signal(null) },
    vitals: { now: signal({ page_ms: null, robot_ms: null, seen_ms: null }) },
    stop_state: signal(kIdleStop),
    stop_selected: () => void pressed.push('stop'),
    emergency,
    api: { clear_emergency: (_: string, id: string) => Promise.resolve(void cleared.push(id)) },
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  render(h(StopPanel, { session }), page as unknown as Element);
  const receive = (next: RobotState) => {
    store.receive({ type: 'robot', robot: next });
    store.refresh();
  };
  return { page, receive, cleared, pressed, session, emergency, forgotten };
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

// SAFETY: a press while the clear is on its way is another one.
test('a clear is for the robot and the press of when it was asked for', async () => {
  const { page, session, emergency, forgotten } = drawn_with(latched('A'));
  session.api.clear_emergency = () => {
    emergency.newest_press = 5; // Escape, before the answer
    return Promise.resolve({} as never);
  };
  await vi.advanceTimersByTimeAsync(100);
  page.find('clear-emergency')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(kGuard_ms + 100);
  expect(forgotten).toEqual([['a', 4]]);
});

// SAFETY: whoever holds has seen the emergency before, not the one that has come since.
test('a hold that began before another emergency clears neither', async () => {
  const { page, receive, cleared } = drawn_with(latched('A'));
  await vi.advanceTimersByTimeAsync(100);
  page.find('clear-emergency')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(900);
  receive(latched('B'));
  await vi.advanceTimersByTimeAsync(5 * kGuard_ms);
  expect(page.find('latch')!.attributes['data-emergency-id']).toBe('B');
  expect(cleared).toEqual([]);
});

test('a latch is named by its time and cause, never by its number', () => {
  const { page } = drawn_with(latched('9371204588120447103'));
  expect(page.find('latch')!.text).toMatch(/a operator, before \d\d:\d\d:\d\d/); // it was there before the page
  expect(page.find('clear-emergency')!.text).toMatch(/^Hold 1 s to clear: operator, before/);
  expect(page.text).not.toContain('447103');
});

test('a page that saw it begin knows when', async () => {
  const { page, receive } = drawn_with({ ...latched('A'), mode: 'manual', emergency_id: null });
  receive(latched('B'));
  await vi.advanceTimersByTimeAsync(100);
  expect(page.find('clear-emergency')!.text).toMatch(/^Hold 1 s to clear: operator, \d\d:\d\d:\d\d$/);
});

// SAFETY: what would not work now never looks as if it did, and is never out of use.
test('a stop that would not work now says so, and can be pressed all the same', async () => {
  const { page, session, pressed } = drawn_with(latched('A'));
  const button = page.find('emergency-stop')!;
  expect(button.attributes['data-works']).toBe('true');
  expect(page.text).not.toContain('will be sent');
  session.stop_path.hindrance.value = 'silent';
  await vi.advanceTimersByTimeAsync(50);
  expect(button.attributes['data-works']).toBe('false');
  expect(page.find('stop-path')!.text).toBe('will be sent when the station answers');
  expect(button.attributes['disabled']).toBeUndefined();
  button.fire('PointerDown');
  expect(pressed).toHaveLength(1);
});

test('it is called a stop function, not an emergency-stop device', () => {
  const { page } = drawn_with(latched('A'));
  expect(page.find('show-stop-note')!.text).toBe('A stop function, not an emergency-stop device');
});

test('a latch that is cleared by a key leaves the focus below the stop button, and on no button', async () => {
  const { page, cleared, receive } = drawn_with(latched('7'));
  const button = page.find('clear-emergency')!;
  button.focus();
  button.fire('KeyDown', { key: ' ', repeat: false });
  await vi.advanceTimersByTimeAsync(kGuard_ms + 100);
  expect(cleared).toEqual(['7']);
  expect(page.contains(fake_document.activeElement)).toBe(true);
  receive({ ...latched('7'), mode: 'manual', emergency_id: null });
  await vi.advanceTimersByTimeAsync(100);
  expect(page.find('latch')).toBeNull();
  expect(fake_document.activeElement?.attributes['class']).toBe('stop-below');
});
