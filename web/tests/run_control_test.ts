// What was typed for a run that is not begun yet.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { RobotState, RunRecord } from '../src/api';
import { RunControl } from '../src/parts/run_control';
import type { Session } from '../src/session';
import { Store } from '../src/store';
import { fake_document, FakeNode } from './fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
  vi.stubGlobal('window', globalThis);
  for (const name of ['addEventListener', 'removeEventListener']) vi.stubGlobal(name, () => undefined);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

async function drawn(are_runs_known = true) {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  const state = {
    robot_id: 'a',
    link: 'connected',
    mode: 'manual',
    emergency_id: null,
    pending_stop: null,
    fluid: 'water',
    control: null,
    model: { state: 'assumed', fluid: null, reason: '' },
  };
  store.receive({
    type: 'welcome',
    actor: 'session:1',
    version: '',
    utc_us: 0,
    stamp_us: 0,
    robots: [state as unknown as RobotState],
  });
  store.is_current.value = true;
  if (are_runs_known) store.set_runs([]);
  store.refresh();
  const session = {
    store,
    utc_us: () => 0,
    phase: signal('live'),
    fluids: signal(null),
    me: signal({ role: 'operator' }),
    settings: { dismissed: { names: signal(new Set<string>()) } },
    api: {
      start_run: (robot_id: string, name: string) =>
        Promise.resolve({ run_id: 1, robot_id, name, started_at_us: 0, ended_at_us: null } as unknown as RunRecord),
    },
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  render(h(RunControl, { session, robot: store.selected.value! }), page as unknown as Element);
  const settle = () => vi.advanceTimersByTimeAsync(100);
  page.find('run-name')?.fire('Input', { currentTarget: { value: 'half a name' } });
  await settle();
  const typed = () => page.find('run-name')?.attributes['value'] ?? null;
  const again = () => {
    render(null, page as unknown as Element);
    render(h(RunControl, { session, robot: store.selected.value! }), page as unknown as Element);
  };
  return { page, store, settle, typed, again };
}

test('it is there again after the connection was lost', async () => {
  const { store, settle, typed } = await drawn();
  expect(typed()).toBe('half a name');
  store.is_current.value = false;
  await settle();
  expect(typed()).toBeNull();
  store.is_current.value = true;
  await settle();
  expect(typed()).toBe('half a name');
});

test('it is there again after another view was looked at', async () => {
  const { settle, typed, again } = await drawn();
  again();
  await settle();
  expect(typed()).toBe('half a name');
});

test('until the station has listed its runs the page does not say that none is open', async () => {
  const { page, store, settle, typed } = await drawn(false);
  expect(typed()).toBeNull();
  expect(page.find('run-unknown')).not.toBeNull();
  store.set_runs([]);
  await settle();
  expect(page.find('run-unknown')).toBeNull();
  expect(typed()).not.toBeNull();
  store.forget_runs();
  await settle();
  expect(page.find('run-unknown')).not.toBeNull();
});

test('it is gone once a run has that name', async () => {
  const { page, store, settle, typed } = await drawn();
  let node = page.find('run-name');
  while (node && node.localName !== 'form') node = node.parentNode;
  node!.fire('Submit');
  await settle();
  expect(page.find('end-run')).not.toBeNull();
  store.runs.value = [];
  await settle();
  expect(typed() ?? '').toBe('');
});
