// What is confirmed for a robot and a controller is sent with these alone, and a failure is shown for them alone.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { ApiError, type RobotState } from '../../src/api';
import type { Session } from '../../src/session';
import { Store } from '../../src/store';
import { kNothing, type Design } from '../../src/views/design/address';
import type { StepProps } from '../../src/views/design/parts';
import { PushStep } from '../../src/views/design/push_step';
import { fake_document, FakeNode } from '../fake_dom';

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

const robot = (robot_id: string) =>
  ({
    robot_id,
    link: 'connected',
    mode: 'manual',
    emergency_id: null,
    pending_stop: null,
    control: null,
    controller_checksum: 1,
  }) as unknown as RobotState;

const kRefusal = new ApiError('It may use more duty.', 409, 'confirm_required');

const kInDoubt = { plant_doubts_text: 'in grave doubt: the search did not converge' };

// The step as an admin sees it, and what was asked of the robots.
function drawn() {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  store.receive({
    type: 'welcome',
    actor: '',
    version: '',
    utc_us: 0,
    stamp_us: 0,
    robots: [robot('sim-1'), robot('sim-2')],
  });
  store.is_current.value = true;
  store.select('sim-1');
  store.refresh();
  const session = {
    store,
    phase: signal('live'),
    me: signal({ role: 'admin', scopes: 'command' }),
    api: {},
  } as unknown as Session;
  const asked: string[] = [];
  const ask = (what: string, is_confirmed: boolean) => {
    asked.push(`${what}${is_confirmed ? ', confirmed' : ''}`);
    return is_confirmed ? Promise.resolve({ verified: true }) : Promise.reject(kRefusal);
  };
  const work = {
    states: signal({}),
    dragged: signal(null),
    pushed: signal(null),
    kept: signal(0),
    tuning: { answer_to: (key: string) => (key === 'asked' ? { job_id: 3, result: { feasible: true } } : null) },
    api: {
      design: (id: number) => Promise.resolve({ design_id: id, name: 'made', document: id === 7 ? kInDoubt : {} }),
      push: (id: string, controller: number, is_confirmed: boolean) => ask(`${controller} to ${id}`, is_confirmed),
      restore: (id: string, is_confirmed: boolean) => ask(`restore ${id}`, is_confirmed),
    },
  };
  const page = new FakeNode(1, 'body');
  const draw = async (design: Partial<Design>, tune_key?: string) => {
    const props = {
      session,
      work,
      design: { ...kNothing, ...design },
      runs: { answer: null, problem: '' },
      designs: [],
      model: null,
      in_force: { found: null, is_read: true },
      tune: tune_key === undefined ? null : { key: tune_key, body: {} },
    } as unknown as StepProps;
    render(h(PushStep, props), page as unknown as Element);
    await vi.advanceTimersByTimeAsync(100);
  };
  const press = async (id: string) => {
    page.find(id)!.fire('Click');
    await vi.advanceTimersByTimeAsync(100);
  };
  const tick = async () => {
    page.find('design-confirm')!.fire('Change', { currentTarget: { checked: true } });
    await vi.advanceTimersByTimeAsync(100);
  };
  return { page, store, asked, draw, press, tick, state: () => page.find('design-push-state')!.text };
}

test('SAFETY: a wider duty range that was confirmed for one controller is not confirmed for another', async () => {
  const { page, asked, draw, press, tick } = drawn();
  await draw({ controller: 8 });
  await press('design-push');
  await tick();
  await draw({ controller: 9 });
  expect(page.find('design-confirm')).toBeNull();
  await press('design-push');
  expect(asked).toEqual(['8 to sim-1', '9 to sim-1']);
});

test('SAFETY: and not for another robot, nor when one comes back', async () => {
  const { store, asked, draw, press, tick } = drawn();
  await draw({ controller: 8 });
  await press('design-push');
  await tick();
  store.select('sim-2');
  await draw({ controller: 8 });
  await press('design-push');
  store.select('sim-1');
  await draw({ controller: 8 });
  await press('design-push');
  expect(asked).toEqual(['8 to sim-1', '8 to sim-2', '8 to sim-1']);
});

test('SAFETY: a tick for sending is none for restoring; with it what it was given for is sent', async () => {
  const { page, asked, draw, press, tick } = drawn();
  await draw({ controller: 8 });
  await press('design-push');
  await tick();
  await press('design-restore');
  expect(page.find('design-confirm')).not.toBeNull(); // now of the one before
  await press('design-push');
  await tick();
  await press('design-push');
  expect(asked).toEqual(['8 to sim-1', 'restore sim-1', '8 to sim-1', '8 to sim-1, confirmed']);
  expect(page.find('design-confirm')).toBeNull();
});

test('SAFETY: the robot that is chosen in the list is the one that the stop is for', async () => {
  vi.stubGlobal('history', { pushState: () => undefined, replaceState: () => undefined });
  const { page, store, draw } = drawn();
  await draw({});
  for (const key of ['ArrowDown', 'ArrowDown', 'Enter']) {
    page.find('design-robot')!.fire('KeyDown', { key });
    await vi.advanceTimersByTimeAsync(100);
  }
  expect(store.selected_id.value).toBe('sim-2');
});

test('SAFETY: a page that is cut off sends nothing, and none to a robot that is not selected any more', async () => {
  const { store, asked, draw, press } = drawn();
  await draw({ controller: 8 });
  store.is_current.value = false;
  await press('design-push');
  store.is_current.value = true;
  await draw({ controller: 8 });
  store.select('sim-2'); // and before the page is drawn again
  await press('design-push');
  expect(asked).toEqual([]);
  await press('design-push');
  expect(asked).toEqual(['8 to sim-2']);
});

test('what failed is shown for the robot and the controller that it failed with', async () => {
  const { store, draw, press, state } = drawn();
  await draw({ controller: 8 });
  await press('design-push');
  expect(state()).toBe('failed: It may use more duty.');
  await draw({ controller: 9 });
  expect(state()).toBe('ready to be sent to sim-1');
  store.select('sim-2');
  await draw({ controller: 8 });
  expect(state()).toBe('ready to be sent to sim-2');
});

test('what was tuned is kept only while it is what is asked now', async () => {
  const { page, draw } = drawn();
  const is_disabled = () => 'disabled' in page.find('design-keep-controller')!.attributes;
  await draw({}, 'asked');
  expect(is_disabled()).toBe(false);
  await draw({}, 'asked for another model');
  expect(is_disabled()).toBe(true);
  await draw({});
  expect(is_disabled()).toBe(true);
});

test('what is in doubt about the model that a controller was tuned for stands beside its sending', async () => {
  const { page, draw } = drawn();
  await draw({ controller: 8 });
  expect(page.find('design-push-doubts')).toBeNull();
  await draw({ controller: 7 });
  expect(page.find('design-push-doubts')!.text).toBe(
    'The model that it was tuned for: in grave doubt: the search did not converge.',
  );
});
