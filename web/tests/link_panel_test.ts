// The column of figures of a robot: what stands above them of limits that were changed.
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { RobotState } from '../src/api';
import { LinkPanel } from '../src/parts/link_panel';
import { Store } from '../src/store';
import { fake_document, FakeNode } from './fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const robot_with = (changed_limits: RobotState['changed_limits'], status: RobotState['status'] = null) =>
  ({
    robot_id: 'a',
    link: 'connected',
    mode: 'manual',
    changed_limits,
    status,
    next_seq: 0,
    durable_next_seq: 0,
    control: null,
    reservation: null,
  }) as RobotState;

function panel_of(state: RobotState) {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots: [state] });
  store.refresh();
  const page = new FakeNode(1, 'body');
  render(h(LinkPanel, { robot: store.robots.value[0]! }), page as unknown as Element);
  return { store, page };
}

test('what a robot does not measure is not reported, rather than 0', () => {
  const text = (supply_mv: number | null, rssi_dbm: number) =>
    panel_of(robot_with([], { supply_mv, rssi_dbm, ring_fill: 0, missed_ticks: 0 } as RobotState['status'])).page.text;
  expect(text(7400, -61)).toContain('Supply7.40VSignal−61dBm');
  expect(text(null, 0)).toContain('Supplynot reportedSignalnot reported');
  expect(panel_of(robot_with([])).page.text).toContain('Supply–VSignal–dBm'); // no status has come
});

test('a limit that differs from its default is shown until it is restored', async () => {
  const { store, page } = panel_of(robot_with([]));
  const receive = async (limits: RobotState['changed_limits']) => {
    store.receive({ type: 'robot', robot: robot_with(limits) });
    store.refresh();
    await vi.advanceTimersByTimeAsync(100);
  };
  expect(page.find('changed-limits')).toBeNull();
  await receive([{ name: 'position_limit_max_m', unit: 'm', value: 0.2, default: 100 }]);
  expect(page.find('changed-limits')!.text).toBe('Changed limits: position_limit_max_m 0.2 m (default 100 m)');
  await receive([]);
  expect(page.find('changed-limits')).toBeNull();
});
