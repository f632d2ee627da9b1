// Controls that could only be refused are disabled and give the reason; with nobody in control they are not.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { why_no_command } from '../src/command_reason';
import { AutoControl } from '../src/parts/auto_control';
import { DisturbanceControl } from '../src/parts/disturbance_control';
import { ManualControl } from '../src/parts/manual_control';
import { RunControl } from '../src/parts/run_control';
import type { Session } from '../src/session';
import { fake_document, FakeNode } from './fake_dom';
import { robot, store_with } from './fakes';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', { ...fake_document, addEventListener() {}, removeEventListener() {} });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('navigator', { getGamepads: () => [] });
  for (const name of ['addEventListener', 'removeEventListener', 'cancelAnimationFrame'])
    vi.stubGlobal(name, () => undefined);
  vi.stubGlobal('requestAnimationFrame', (callback: () => void) => setTimeout(callback, 16));
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const settle = () => vi.advanceTimersByTimeAsync(200);

// The controls of a robot in a mode, and what they send.
async function controls_in(mode: string) {
  const model = { state: 'assumed', fluid: null, reason: '' };
  const state = (change: object) => robot('a', { mode, fluid: 'water', model, ...change });
  const { store } = store_with(state({}));
  store.set_runs([]);
  const sent: string[] = [];
  const send = (what: string) => () => Promise.resolve(void sent.push(what));
  const held = signal({ robot_id: null as string | null, lapsed: false, error: '' });
  const session = {
    store,
    held,
    phase: signal('live'),
    me: signal({ role: 'operator' }),
    fluids: signal([{ fluid: 'water', model: null }]),
    settings: { dismissed: { names: signal(new Set<string>()) } },
    hold: { press: send('hold'), release() {}, change() {} },
    api: { set_auto: send('auto'), set_setpoint: send('setpoint'), inject_disturbance: send('disturbance') },
    utc_us: () => 0,
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  const one = store.selected.value!;
  const parts = [AutoControl, DisturbanceControl, ManualControl, RunControl];
  const drawn = parts.map((Part) => h(Part, { session, robot: one }));
  render(h('div', {}, drawn), page as unknown as Element);
  await settle();
  const become = async (change: object) => {
    store.receive({ type: 'robot', robot: state(change) });
    store.refresh();
    await settle();
  };
  const is_disabled = (id: string) => 'disabled' in page.find(id)!.attributes;
  const submit = (id: string) => {
    let node = page.find(id);
    while (node && node.localName !== 'form') node = node.parentNode;
    node!.fire('Submit');
  };
  return { page, store, session, one, sent, held, become, is_disabled, submit };
}

const kOf = {
  manual: ['send-setpoint', 'hold-to-run', 'run-fluid'],
  auto: ['send-setpoint', 'inject-disturbance', 'to-manual', 'run-fluid'],
};

test.each(['manual', 'auto'] as const)(
  'in %s, who is not in control can command nothing, and reads why',
  async (mode) => {
    const { page, become, is_disabled, sent, submit } = await controls_in(mode);
    for (const id of kOf[mode]) expect(is_disabled(id), id).toBe(false);
    await become({ control: { holder: 'session:2' } });
    for (const id of [...kOf[mode], ...(mode === 'manual' ? ['zero-position'] : [])]) {
      expect(is_disabled(id), id).toBe(true);
      expect(page.find(id)!.attributes['title'], id).toBe('session:2 is in control.');
    }
    expect(page.find('setpoint-reason')!.text).toBe('session:2 is in control.');
    submit('setpoint-entry'); // by Enter
    submit('disturbance-entry');
    expect(sent).toEqual([]);
    await become({ control: { holder: 'session:1' } }); // this page
    for (const id of kOf[mode]) expect(is_disabled(id), id).toBe(false);
    expect(page.find('setpoint-reason')).toBeNull();
  },
);

test.each(['manual', 'auto'] as const)('in %s, a page that is cut off can command nothing', async (mode) => {
  const { page, store, is_disabled, sent, submit } = await controls_in(mode);
  store.is_current.value = false;
  await settle();
  for (const id of kOf[mode].filter((each) => each !== 'run-fluid')) {
    expect(is_disabled(id), id).toBe(true);
    expect(page.find(id)!.attributes['title'], id).toMatch(/^Cut off/);
  }
  submit('setpoint-entry');
  expect(sent).toEqual([]);
});

test('with nobody in control a command may be sent: it takes control', async () => {
  const { session, one, sent, submit, become } = await controls_in('manual');
  await become({ control: null });
  expect(why_no_command(session, one)).toBe('');
  submit('setpoint-entry');
  expect(sent).toEqual(['auto']);
});

test('a duty that runs is not ended by a button, disabled under the hand of who was late for a moment', async () => {
  const { store, held, is_disabled } = await controls_in('manual');
  held.value = { robot_id: 'a', lapsed: false, error: '' };
  store.is_current.value = false;
  await settle();
  expect(is_disabled('hold-to-run')).toBe(false);
  held.value = { robot_id: null, lapsed: true, error: '' };
  await settle();
  expect(is_disabled('hold-to-run')).toBe(true);
});
