// What the session does with what a page sends.
import { afterEach, expect, test, vi } from 'vitest';
import type { EventRecord, Recording, RobotState } from '../src/api';
import { kLease_ms } from '../src/duty_hold';
import { Session } from '../src/session';
import { FakeSocket } from './fakes';

afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const robot = (robot_id: string, link: RobotState['link']) =>
  ({ robot_id, link, mode: 'manual', emergency_id: null, pending_stop: null }) as RobotState;

function session_beside(away: RobotState) {
  vi.stubGlobal('fetch', () => Promise.reject(new Error('no network here')));
  const session = new Session({ open_socket: () => ({}) as never });
  session.store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots: [away] });
  return session;
}

// SAFETY: Escape stops what is selected.
test('a robot that was stopped, or sent anything, stays selected when another one connects', async () => {
  const acts: ((session: Session) => unknown)[] = [
    (session) => session.stop_selected(),
    (session) => session.api.set_fluid('a', 'water').catch(() => undefined),
  ];
  for (const act of acts) {
    const session = session_beside(robot('a', 'disconnected'));
    await act(session);
    session.store.receive({ type: 'robot', robot: robot('b', 'connected') });
    expect(session.store.selected_id.value).toBe('a');
  }
});

// SAFETY: while the station restarts, a proxy in front of it answers in its place.
test('a stop that only a proxy, or a station that is too busy, has answered goes again; one that the station refused does not', async () => {
  const problem = (status: number, reason: string) => new Response(JSON.stringify({ status, reason }), { status });
  const answers: [Response, boolean][] = [
    [new Response('<h1>Bad Gateway</h1>', { status: 502 }), true],
    [new Response('<h1>Unavailable</h1>', { status: 503 }), true],
    [new Response('<h1>Time-out</h1>', { status: 504 }), true],
    [new Response('<h1>Too many</h1>', { status: 429 }), true],
    [new Response('<h1>Sign in to the network</h1>'), true],
    [problem(503, 'busy'), true],
    [problem(429, 'busy'), true],
    [problem(504, 'no_answer'), false], // it was sent
    [problem(403, 'not_permitted'), false],
  ];
  for (const [answer, is_kept] of answers) {
    const session = session_beside(robot('a', 'connected'));
    vi.stubGlobal('fetch', () => Promise.resolve(answer));
    await session.emergency.stop('a');
    expect([answer.status, session.stop_state.value.is_kept]).toEqual([answer.status, is_kept]);
  }
});

test('what a page asks chooses no robot', async () => {
  const session = session_beside(robot('a', 'disconnected'));
  await session.api.newest_run('a').catch(() => undefined);
  session.store.receive({ type: 'robot', robot: robot('b', 'connected') });
  expect(session.store.selected_id.value).toBe('b');
});

test('who is signed in is asked again until it is known', async () => {
  const me = { actor: 'session:1', user: '', role: 'admin', scopes: 'admin' };
  let asked = 0;
  vi.stubGlobal('fetch', (path: string) => {
    if (!path.endsWith('/me')) return Promise.resolve(new Response(JSON.stringify({ runs: [], fluids: [] })));
    return ++asked === 1 ? Promise.reject(new Error('too slow')) : Promise.resolve(new Response(JSON.stringify(me)));
  });
  const session = new Session({ open_socket: () => ({}) as never });
  session.phase.value = 'live';
  const look = () => (session as unknown as { load_recording(): Promise<void> }).load_recording(); // each five seconds
  await look();
  await vi.waitFor(() => expect(asked).toBe(1));
  expect(session.me.value).toBeNull();
  await look();
  await vi.waitFor(() => expect(session.me.value?.role).toBe('admin'));
});

// SAFETY: the motor rests, whatever the hand does; the button must not say that it runs.
test('a held duty ends on the page when somebody else has taken control, and nothing more is sent', async () => {
  vi.useFakeTimers({ toFake: ['performance', 'setInterval', 'clearInterval'] });
  const controlled_by = (holder: string | null) =>
    ({ ...robot('a', 'connected'), control: holder && { holder, wished_by: null } }) as RobotState;
  const session = session_beside(controlled_by(null));
  const refresh = () => (session as unknown as { refresh(): void }).refresh();
  const sent: number[] = [];
  session.api.set_duty = (_, duty) => {
    sent.push(duty);
    return Promise.resolve({} as never);
  };
  session.link.send = () => true;
  Object.assign(session.link, { stamp_us: 1, stamp_is_fresh: () => true });

  session.store.receive({ type: 'robot', robot: controlled_by('session:2') }); // which is older than the press
  session.hold.press('a', 0.3);
  vi.advanceTimersByTime(100);
  refresh();
  expect(session.held.value.robot_id).toBe('a');
  session.store.receive({ type: 'robot', robot: controlled_by('session:1') });
  vi.advanceTimersByTime(5 * kLease_ms);
  refresh();
  expect(session.held.value.robot_id).toBe('a');
  session.store.receive({ type: 'robot', robot: controlled_by('session:2') });
  refresh();
  expect(session.held.value.robot_id).toBeNull();
  expect(sent).toEqual([0.3]);
});

test('when the link comes up the log gets what happened before: of each robot, of a large fleet of the selected one', async () => {
  const asked: string[] = [];
  let [open, most_open] = [0, 0];
  const happened = { robot_id: 'r-1', event_seq: 1, kind: 'mode_changed', received_at_us: 5e6 } as EventRecord;
  vi.stubGlobal('fetch', async (path: string) => {
    const is_past = /\/robots\/.*limit=/.test(path);
    if (is_past) asked.push(path);
    if (is_past) most_open = Math.max(most_open, ++open);
    await Promise.resolve();
    if (is_past) open -= 1;
    const events = path.includes('/r-1/events') ? [happened] : [];
    return new Response(JSON.stringify({ events, commands: [], runs: [], fluids: [] }));
  });
  for (const [size, requests] of [
    [2, 4],
    [20, 2],
  ] as const) {
    asked.length = 0;
    const socket = new FakeSocket();
    const session = new Session({ open_socket: () => socket, set_timer: () => 0, clear_timer: () => undefined });
    session.link.start();
    const robots = Array.from({ length: size }, (_, n) => robot(`r-${n + 1}`, 'connected'));
    socket.say({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots });
    await vi.waitFor(() => expect(asked).toHaveLength(requests));
    await vi.waitFor(() => expect(session.store.log.value.map((line) => line.event?.kind)).toContain('mode_changed'));
  }
  expect(most_open).toBe(1); // a stop by HTTP waits behind none of them
});

test('a past that could not be read is noted', async () => {
  const session = session_beside(robot('a', 'connected'));
  await (session as unknown as { load_log(): Promise<void> }).load_log();
  session.store.refresh();
  expect(session.store.log.value[0]?.note).toContain('could not be read');
});

test('of two looks at the recording the one that was asked for last counts, whichever comes last', () => {
  const session = session_beside(robot('a', 'connected'));
  const failing = { state: 'failing' } as Recording;
  session.take_recording(failing, 200);
  session.take_recording({ state: 'recording' } as Recording, 100);
  expect(session.recording.value).toBe(failing);
});
