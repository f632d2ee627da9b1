// How long the outcome of a request is shown, and what ends it.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { ControlLine } from '../src/parts/control_line';
import {
  kDone_ms,
  kFailed_ms,
  kRead_ms,
  PresentContext,
  present_of,
  useAsking,
  type Asking,
} from '../src/parts/request';
import type { Session } from '../src/session';
import { fake_document, FakeNode } from './fake_dom';
import { robot, store_with } from './fakes';

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

const page = () => new FakeNode(1, 'body') as unknown as Element;
const settle = () => vi.advanceTimersByTimeAsync(200);

// A part that asks, on a page whose clock moves only by `pass`.
async function asking_part(about: 'robot' | 'station' = 'robot') {
  const { store, clock } = store_with(robot('a'));
  const phase = signal('live') as Session['phase'];
  let asking = null as Asking | null;
  const Part = () => {
    asking = useAsking(about);
    return null;
  };
  render(h(PresentContext.Provider, { value: present_of({ store, phase }), children: h(Part, {}) }), page());
  await settle();
  const pass = (time_ms: number) => {
    clock.page += time_ms;
    store.refresh();
  };
  const become = (change: object) => store.receive({ type: 'robot', robot: robot('a', change) });
  return { asking: asking!, store, phase, pass, become, shown: () => asking!.outcome.value.phase };
}
const refused = () => Promise.reject(new Error('robot is controlled by anna'));

test('that something was accepted is shown for some seconds', async () => {
  const { asking, pass, become, shown } = await asking_part();
  await asking.ask('Setpoint 61.0 mm', () => Promise.resolve());
  become({ mode: 'auto', control: { holder: 'session:1' } }); // as it was asked for
  pass(kDone_ms - 1);
  expect(shown()).toBe('done');
  pass(1);
  expect(shown()).toBe('idle');
});

test('a refusal ends when the control, the mode or the link of the robot changes, or the link of the page', async () => {
  const { asking, store, phase, pass, become, shown } = await asking_part();
  for (const change of [
    () => become({ control: { holder: 'session:2' } }),
    () => become({ control: null }),
    () => become({ mode: 'auto' }),
    () => become({ mode: 'auto', link: 'disconnected' }),
    () => (phase.value = 'connecting'),
    () => (store.is_current.value = false),
  ]) {
    await asking.ask('Auto', refused);
    pass(kRead_ms);
    expect(shown()).toBe('failed');
    change();
    expect(shown(), String(change)).toBe('idle');
  }
});

test('a refusal whose cause is gone at once can still be read', async () => {
  const { asking, pass, become, shown } = await asking_part();
  await asking.ask('Auto', refused);
  become({ control: { holder: 'session:2' } }); // came later than the refusal
  pass(kRead_ms - 1);
  expect(shown()).toBe('failed');
  pass(1);
  expect(shown()).toBe('idle');
});

test('a refusal of which nothing changes is shown for a minute, each from its own beginning', async () => {
  const { asking, pass, shown } = await asking_part();
  asking.fail('“abc” is not a length in millimetres.');
  pass(kFailed_ms - 1);
  asking.fail('“abcd” is not a length in millimetres.');
  pass(kFailed_ms - 1);
  expect(shown()).toBe('failed');
  pass(1);
  expect(shown()).toBe('idle');
});

test('what the station alone was asked does not end with the state of a robot', async () => {
  const { asking, store, pass, become, shown } = await asking_part('station');
  await asking.ask('Change', refused);
  become({ mode: 'auto' });
  pass(kRead_ms);
  expect(shown()).toBe('failed');
  store.is_current.value = false;
  expect(shown()).toBe('idle');
});

test('what is asked now is waited for, however long it takes', async () => {
  const { asking, pass, become, shown } = await asking_part();
  void asking.ask('Auto', () => new Promise(() => undefined));
  become({ mode: 'auto' });
  pass(2 * kFailed_ms);
  expect(shown()).toBe('pending');
});

test('that somebody else was in control does not stand beside "Nobody is in control"', async () => {
  const { store, clock } = store_with(robot('a', { control: null }));
  const phase = signal('live');
  const api = { change_control: refused };
  const session = { store, phase, api, me: signal({ role: 'operator' }) } as unknown as Session;
  const body = new FakeNode(1, 'body');
  const line = h(ControlLine, { session, robot: store.selected.value! });
  render(h(PresentContext.Provider, { value: present_of(session), children: line }), body as unknown as Element);
  await settle();
  body.find('take-control')!.fire('Click');
  await settle();
  expect(body.text).toContain('robot is controlled by anna');
  clock.page = kRead_ms;
  store.receive({ type: 'robot', robot: robot('a', { control: { holder: 'anna' } }) });
  store.receive({ type: 'robot', robot: robot('a', { control: null }) });
  store.refresh();
  await settle();
  expect(body.text).toContain('Nobody is in control');
  expect(body.text).not.toContain('robot is controlled by anna');
});
