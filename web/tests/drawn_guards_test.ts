// Guards of docs/safety.md in parts that are drawn: what they show and send while the page is cut off, the robot is silent,
// or the hand is gone.
import { signal } from '@preact/signals';
import { h, render, type ComponentType } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { pause_count_downs } from '../src/count_downs';
import type { ExperimentSummary } from '../src/experiments_store';
import { listen_for_any_press } from '../src/keys';
import { GamepadLine } from '../src/parts/gamepad_line';
import { AlertLine, alerts_of, thresholds } from '../src/parts/threshold_list';
import { resting_place, Vessel } from '../src/parts/vessel';
import { route } from '../src/route';
import { Session } from '../src/session';
import { Coast } from '../src/vessel/coast';
import { ActsOfOne } from '../src/views/experiments/acts_of_one';
import { OneExperiment } from '../src/views/experiments/one';
import { state_word } from '../src/views/runs/list_view';
import { State } from '../src/views/runs/run_view';
import { link_word } from '../src/views/station/robots';
import { fake_document, FakeNode } from './fake_dom';
import { batch, robot, store_with } from './fakes';

const pages: FakeNode[] = [];
let listeners: Record<string, (event: object) => void> = {};

beforeEach(() => {
  vi.useFakeTimers();
  listeners = {};
  const listen = (type: string, listener: (event: object) => void) => void (listeners[type] = listener);
  vi.stubGlobal('document', { ...fake_document, addEventListener: listen, removeEventListener: () => undefined });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('addEventListener', listen);
  vi.stubGlobal('removeEventListener', () => undefined);
  vi.stubGlobal('requestAnimationFrame', (callback: () => void) => setTimeout(callback, 16));
  vi.stubGlobal('cancelAnimationFrame', (id: number) => clearTimeout(id));
  vi.stubGlobal('navigator', { getGamepads: () => [] });
});
afterEach(async () => {
  for (const page of pages.splice(0)) render(null, page as unknown as Element);
  await drawn_again(); // what a part still has to do after it was drawn
  vi.unstubAllGlobals();
  vi.useRealTimers();
  route.value = { view: 'robot', parts: [], query: {} };
});

// What it has drawn, and drawn again after a signal has changed.
function drawn<P>(part: ComponentType<P>, props: P) {
  const page = new FakeNode(1, 'body');
  pages.push(page);
  render(h(part as ComponentType<unknown>, props as object), page as unknown as Element);
  return page;
}
const drawn_again = () => vi.advanceTimersByTimeAsync(200);

test('of a silent robot no place to come to rest is foretold', () => {
  const { store, clock } = store_with(robot('rheo-1'));
  store.receive(batch(0, 200, { duty: Array(200).fill(0.5), velocity_m_s: Array(200).fill(0.1) } as never));
  store.refresh();
  const one = store.find('rheo-1')!;
  const coast = { distance_m: () => 0.05 } as unknown as Coast;
  expect(resting_place(one, coast)).not.toBeNull();
  clock.page = 700;
  store.refresh();
  expect(one.readout.value.stale).toBe(true);
  expect(resting_place(one, coast)).toBeNull();
});

test('a setpoint that is being moved is given up when somebody else takes control, and not sent', async () => {
  const { store } = store_with(robot('rheo-1', { mode: 'auto', parameters_checksum: 0, boot_id: '1', fluid: '' }));
  const sent: number[] = [];
  store.receive(batch(0, 5));
  store.refresh();
  const one = store.find('rheo-1')!;
  const session = {
    store,
    phase: signal('live'),
    me: signal({ role: 'operator' }),
    fluids: signal([]),
    api: {
      set_setpoint: (_: string, value_m: number) => Promise.resolve(void sent.push(value_m)),
      robot_parameters: () => new Promise(() => undefined),
    },
  } as unknown as Session;
  const page = drawn(Vessel, { session, robot: one });
  await drawn_again();
  const handle = () => page.find('setpoint-ghost')!;
  const move = async () => {
    handle().fire('KeyDown', { key: 'ArrowRight' });
    await drawn_again();
  };
  await move();
  handle().fire('KeyDown', { key: 'Enter' });
  expect(sent).toEqual([0.101]);
  await drawn_again();
  await move();
  store.receive({
    type: 'robot',
    robot: robot('rheo-1', {
      mode: 'auto',
      control: { holder: 'session:2', requested_by: null },
      parameters_checksum: 0,
      boot_id: '1',
      fluid: '',
    }),
  });
  store.refresh();
  await drawn_again();
  handle().fire('KeyDown', { key: 'Enter' });
  expect(sent).toEqual([0.101]);
});

test('an old value crosses no threshold', async () => {
  const { store, clock } = store_with(robot('rheo-1'));
  store.receive(batch(0, 5));
  store.refresh();
  const one = store.find('rheo-1')!;
  const session = {
    store,
    settings: { sound: { on: signal(false) }, threshold_mute: { on: signal(true) } },
    alerts: { chime: () => undefined },
  } as unknown as Session;
  clock.page = 700;
  store.refresh();
  thresholds.ranges.value = { duty: { low: null, high: 0.1 } };
  try {
    const page = drawn(AlertLine, { session, robot: one });
    await drawn_again();
    expect(alerts_of(one).alerts.value).toEqual([]);
    store.receive(batch(5, 5));
    store.refresh();
    await drawn_again();
    expect(alerts_of(one).alerts.value.length).toBe(1);
    expect(page.find('alert-line')).not.toBeNull();
  } finally {
    thresholds.ranges.value = {};
  }
});

test('whatever hides the robot from the hand ends its duty: lost focus, a hidden page, a closed one, an unplugged pad', async () => {
  for (const what of ['blur', 'pagehide', 'visibilitychange', 'gamepaddisconnected']) {
    const pad = {
      index: 0,
      mapping: 'standard',
      connected: true,
      axes: [-1, 0, 0, 0],
      buttons: Array.from({ length: 16 }, () => ({ pressed: false })),
    };
    vi.stubGlobal('navigator', { getGamepads: () => [pad] });
    const hold = {
      robot_id: null as string | null,
      press(robot_id: string) {
        this.robot_id = robot_id;
      },
      change() {},
      release() {
        this.robot_id = null;
      },
    };
    const session = { hold } as unknown as Session;
    drawn(GamepadLine, { session, robot_id: 'a', why_not: '', full_duty: 0.5 } as never);
    await drawn_again();
    for (const button of pad.buttons) button.pressed = true;
    await drawn_again();
    expect(hold.robot_id).toBe('a');
    Object.assign(document, { hidden: true });
    listeners[what]!({});
    expect(hold.robot_id, what).toBeNull();
  }
});

const experiment = (change: object = {}) =>
  ({
    experiment_id: 7,
    robot_id: 'b',
    state: 'paused',
    held: false,
    acts_for: 'session:1',
    unattended: false,
    run_counts: {},
    activity: '',
    progress: null,
    reason: null,
    runs_planned: 1,
    owner: 'session:1',
    created_at_us: 0,
    started_at_us: null,
    ended_at_us: null,
    duration_s: 10,
    notes: '',
    name: 'a test',
    priority: 'normal',
    ...change,
  }) as unknown as ExperimentSummary;

test('a page that is cut off resumes no experiment, and aborts one even while another request waits', async () => {
  const { store } = store_with(robot('b'));
  const asked: string[] = [];
  const session = {
    store,
    me: signal({ role: 'operator', scopes: 'command' }),
    phase: signal('live'),
    experiments: { resume: () => undefined, abort: () => undefined, pause: () => undefined },
  } as unknown as Session;
  const acts = {
    pending: signal(''),
    problem: signal(''),
    act: (what: string) => void (acts.pending.value === '' && asked.push(what)),
  };
  const page = drawn(ActsOfOne, { session, experiment: experiment(), acts } as never);
  const is_disabled = (id: string) => 'disabled' in page.find(id)!.attributes;
  expect(is_disabled('resume-experiment')).toBe(false);
  store.is_current.value = false;
  await drawn_again();
  expect(is_disabled('resume-experiment')).toBe(true);
  expect(is_disabled('abort-experiment')).toBe(false);
  acts.pending.value = 'pause';
  page.find('abort-experiment')!.fire('Click');
  expect(asked).toEqual(['abort']);
});

test('any key or press pauses an experiment of this page that is about to go on by itself, and no other', async () => {
  const { store } = store_with(robot('b'));
  const counting = { progress: { goes_on_in_s: 2 }, client: store.client.value };
  store.experiments.take_answer(
    [
      experiment({ ...counting, experiment_id: 1, acts_for: store.actor.value }),
      experiment({ ...counting, experiment_id: 2, acts_for: 'session:2' }),
      experiment({ ...counting, experiment_id: 3, acts_for: store.actor.value, progress: { goes_on_in_s: null } }),
    ],
    store.experiments.mark(),
  );
  const paused: number[] = [];
  const pause = (id: number) => Promise.resolve(void paused.push(id));
  const heard = new Map<string, (event: Event) => void>();
  const target = { addEventListener: (kind: string, listener: (event: Event) => void) => heard.set(kind, listener) };
  listen_for_any_press(target as never, () => pause_count_downs({ store, experiments: { pause } } as never));
  heard.get('keydown')!({ repeat: true } as KeyboardEvent);
  expect(paused).toEqual([]);
  heard.get('keydown')!({ repeat: false } as KeyboardEvent);
  heard.get('pointerdown')!({} as PointerEvent);
  expect(paused).toEqual([1, 1]);
  const session = {
    store,
    me: signal({ role: 'operator', scopes: 'command' }),
    phase: signal('live'),
    experiments: {},
  };
  const acts = { pending: signal(''), problem: signal(''), act: () => undefined };
  const page = drawn(ActsOfOne, { session, experiment: store.experiments.find(1), acts } as never);
  expect(page.find('pause-experiment')).toBeTruthy();
  expect(page.find('resume-experiment')).toBeFalsy();
});

test('an experiment that goes on selects its robot for the stop when it is opened', async () => {
  const { store } = store_with(robot('a'), robot('b'));
  store.select('a');
  store.experiments.take_answer([experiment()], store.experiments.mark());
  const session = {
    store,
    phase: signal('live'),
    me: signal(null),
    experiments: { one: () => new Promise(() => undefined) },
  };
  drawn(OneExperiment, { session, id: 7 } as never);
  await drawn_again();
  expect(store.selected_id.value).toBe('b');
});

test('that a robot is connected, or a run open, is only said while the page is connected', () => {
  const { store } = store_with(robot('a'), robot('gone', { link: 'disconnected' }));
  const words = (is_current: boolean) =>
    ['a', 'gone', 'none'].map((robot_id) => link_word(store.find(robot_id), is_current));
  expect(words(true)).toEqual(['connected', 'away', 'never seen']);
  expect(words(false)).toEqual(['was connected', 'away', 'never seen']);
  expect([state_word('open', true), state_word('open', false), state_word('ended', false)]).toEqual([
    'open',
    'was open',
    'ended',
  ]);
  const run = { state: 'open' };
  expect(drawn(State, { session: { store }, run } as never).text).toBe('open');
  store.is_current.value = false;
  expect(drawn(State, { session: { store }, run } as never).text).toBe('was open when the station was last heard');
});
