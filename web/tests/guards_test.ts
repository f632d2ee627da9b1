// Guards of docs/safety.md that are the subject of no other test: what is sent first, which robot the stop is for, and that
// settings of the browser only change the picture.
import { readFileSync } from 'node:fs';
import { effect } from '@preact/signals';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { route } from '../src/route';
import { Session } from '../src/session';
import { DesignApi } from '../src/views/design/design_api';
import { FakeSurroundings, robot, store_with } from './fakes';

afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
  route.value = { view: 'robot', parts: [], query: {} };
});
beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', { addEventListener: () => undefined });
});

// ---- what only changes the picture

// Files that a file imports, itself or over others, under src; not what it needs for its types alone.
function reached_from(start: string, seen = new Set<string>()): Set<string> {
  if (seen.has(start)) return seen;
  seen.add(start);
  const text = readFileSync(new URL(`../src/${start}`, import.meta.url), 'utf8');
  for (const [, from] of text.matchAll(/^(?:import|export) (?!type)[^;]*? from '\.\/([\w/]+)';/gm)) {
    const name = ['.ts', '.tsx'].map((suffix) => from + suffix).find((each) => exists(each));
    if (name !== undefined) reached_from(name, seen);
  }
  return seen;
}
function exists(name: string): boolean {
  try {
    return readFileSync(new URL(`../src/${name}`, import.meta.url)).length > 0;
  } catch {
    return false;
  }
}

test('nothing that commands or stops reads a setting of the browser', () => {
  for (const part of [
    'emergency.ts',
    'keys.ts',
    'duty_hold.ts',
    'gamepad.ts',
    'api.ts',
    'live.ts',
    'stop_path.ts',
    'past_guard.ts',
  ]) {
    const reached = [...reached_from(part)];
    expect(reached.filter((name) => /settings|thresholds|threshold_sound|strips/.test(name))).toEqual([]);
  }
  expect([...reached_from('emergency.ts')]).toContain('emergency.ts');
  expect([...reached_from('session.ts')]).toContain('settings.ts'); // this way of looking finds what is there
});

// ---- the session

function live_session(answers: Record<string, unknown> = {}) {
  const around = new FakeSurroundings();
  vi.stubGlobal('fetch', (path: string) => {
    const found = Object.keys(answers).find((each) => path.includes(each));
    return found
      ? Promise.resolve(new Response(JSON.stringify(answers[found])))
      : Promise.reject(new Error('no network'));
  });
  const session = new Session(around);
  session.link.start();
  return { session, around };
}

test('the echo of a stamp leaves before the page does anything with the message', () => {
  const { session, around } = live_session();
  around.socket.welcome();
  const echoes = () => around.socket.sent.filter((each) => (each as { type: string }).type === 'echo').length;
  let sent_by_then = 0;
  session.store.receive = () => void (sent_by_then = echoes());
  for (const stamp_us of [50_000, 100_000, 150_000, 200_000]) {
    around.socket.say({ type: 'stamp', stamp_us } as never);
    expect(sent_by_then).toBe(echoes());
  }
  expect(echoes()).toBeGreaterThan(0);
});

test('with the right password the link opens, whatever else does not answer', async () => {
  const me = { actor: 'session:1', user: 'anna', role: 'admin', scopes: 'admin' };
  const { session, around } = live_session({ '/login': me });
  session.api.me = () => new Promise(() => undefined);
  const opened = around.sockets.length;
  around.signed_out = true;
  around.socket.break();
  await vi.advanceTimersByTimeAsync(200);
  await session.log_in('anna', 'a good password');
  expect(around.sockets.length).toBe(opened + 1);
});

test('a page that was loaded anew gives signs of life for what it has begun before', async () => {
  const begun = {
    experiment_id: 7,
    robot_id: 'a',
    state: 'running',
    held: false,
    acts_for: 'session:1',
    unattended: false,
  };
  const { around } = live_session({ '/experiments': { experiments: [begun] } });
  around.socket.welcome();
  await vi.waitFor(() => {
    around.socket.say({ type: 'stamp', stamp_us: 50_000 } as never);
    expect(around.socket.sent).toContainEqual(expect.objectContaining({ type: 'keep_alive' }));
  });
});

test('a robot of an address that is not known yet does not take the stop button when it appears', () => {
  const { store } = store_with(robot('a'));
  expect(store.selected_id.value).toBe('a');
  store.want('b');
  store.receive({ type: 'robot', robot: robot('b') });
  expect(store.selected_id.value).toBe('a');
  store.want('b'); // pressed, as the view offers it
  expect(store.selected_id.value).toBe('b');
});

test('an address selects its robot when it changes, and never because something else has', () => {
  const { session } = live_session();
  session.store.receive({
    type: 'welcome',
    actor: 'session:1',
    version: '',
    utc_us: 0,
    stamp_us: 0,
    robots: [robot('a'), robot('b')],
  });
  route.value = { view: 'robot', parts: ['a'], query: {} };
  const end = effect(() => (session as unknown as { follow_route(): void }).follow_route());
  expect(session.store.selected_id.value).toBe('a');
  session.store.select('b');
  session.store.receive({ type: 'robot', robot: robot('c') });
  expect(session.store.selected_id.value).toBe('b');
  end();
});

test('what a controller is sent with carries the latest stamp', async () => {
  const bodies: object[] = [];
  const ask = (_: string, path: string, body: object) => Promise.resolve(void bodies.push({ path, ...body }));
  const api = new DesignApi({ ask } as never, () => 42);
  await api.push('a', 3, false);
  await api.restore('a', true);
  expect(bodies).toEqual([
    { path: '/robots/a/controller', design_id: 3, stamp_us: 42 },
    { path: '/robots/a/commands?wait=verified', kind: 'restore_controller', stamp_us: 42, confirm: true },
  ]);
  const cut_off = new DesignApi({ ask } as never, () => null);
  expect(() => cut_off.push('a', 3, false)).toThrow();
});
