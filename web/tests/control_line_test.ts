// Control that is taken by force: with a reason, by a deliberate gesture, and where the role allows it.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { ControlBody, RobotState } from '../src/api';
import { ControlLine } from '../src/parts/control_line';
import { kGuard_ms } from '../src/parts/hold_button';
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

const held_by = (holder: string | null) =>
  ({
    robot_id: 'a',
    link: 'connected',
    mode: 'manual',
    emergency_id: null,
    pending_stop: null,
    control: holder && { holder, wished_by: null },
  }) as unknown as RobotState;

function drawn_for(role: string, holder: string | null = 'user:ben/session:2') {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  store.receive({
    type: 'welcome',
    actor: 'user:anna/session:1',
    version: '',
    utc_us: 0,
    stamp_us: 0,
    robots: [held_by(holder)],
  });
  store.is_current.value = true;
  store.refresh();
  const asked: ControlBody[] = [];
  const session = {
    store,
    me: signal({ role }),
    api: { change_control: (_: string, body: ControlBody) => Promise.resolve(void asked.push(body)) },
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  render(h(ControlLine, { session, robot: store.selected.value! }), page as unknown as Element);
  return { page, asked, store };
}

async function with_reason(page: FakeNode, reason: string) {
  page.find('force-control')!.fire('Click');
  await vi.advanceTimersByTimeAsync(100);
  page.find('force-reason')!.fire('Input', { currentTarget: { value: reason } });
  await vi.advanceTimersByTimeAsync(100);
}

test('an admin takes control from its holder by a hold of a second, with a reason', async () => {
  const { page, asked } = drawn_for('admin');
  await with_reason(page, ' ben has left ');
  page.find('force-now')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(kGuard_ms - 100);
  expect(asked).toEqual([]);
  await vi.advanceTimersByTimeAsync(200);
  expect(asked).toEqual([{ action: 'force', reason: 'ben has left' }]);
});

test('without a reason it cannot be held', async () => {
  const { page, asked } = drawn_for('admin');
  await with_reason(page, '  ');
  page.find('force-now')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(2 * kGuard_ms);
  expect(asked).toEqual([]);
});

test('a hold that began before control changed hands takes nothing from the next holder', async () => {
  const { page, asked, store } = drawn_for('admin');
  await with_reason(page, 'ben has left');
  page.find('force-now')!.fire('PointerDown');
  await vi.advanceTimersByTimeAsync(kGuard_ms - 500);
  store.receive({ type: 'robot', robot: held_by('user:carla/session:3') });
  await vi.advanceTimersByTimeAsync(2 * kGuard_ms);
  expect(asked).toEqual([]);
});

test('the focus stays in the line when the button that had it is disabled and goes away, and goes to no other button', async () => {
  const { page, asked, store } = drawn_for('operator', null);
  const line = page.find('control-line')!;
  page.find('take-control')!.focus();
  page.find('take-control')!.fire('Click');
  await vi.advanceTimersByTimeAsync(100);
  expect(asked).toEqual([{ action: 'take' }]);
  expect(fake_document.activeElement).toBe(line);
  store.receive({ type: 'robot', robot: held_by('user:anna/session:1') });
  await vi.advanceTimersByTimeAsync(100);
  expect(page.find('take-control')).toBeNull();
  expect(page.find('release-control')).not.toBeNull();
  expect(fake_document.activeElement).toBe(line);
  expect(line.tabIndex).toBe(-1);
});

test('the line takes the focus from nothing else', async () => {
  const { page, store } = drawn_for('operator', null);
  const elsewhere = page.insertBefore(new FakeNode(1, 'input'), null);
  elsewhere.focus();
  store.receive({ type: 'robot', robot: held_by('user:anna/session:1') });
  await vi.advanceTimersByTimeAsync(100);
  expect(page.find('release-control')).not.toBeNull();
  expect(fake_document.activeElement).toBe(elsewhere);
});

test('nobody else is offered it, and not the holder either', () => {
  for (const role of ['operator', 'viewer']) expect(drawn_for(role).page.find('force-control')).toBeNull();
  expect(drawn_for('admin', 'user:anna/session:1').page.find('force-control')).toBeNull();
});
