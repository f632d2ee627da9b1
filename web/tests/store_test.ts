// What the page knows: numerals, stale marks, the log, selection.
import { expect, test } from 'vitest';
import type { CommandRecord, EventRecord, RobotState, RunRecord } from '../src/api';
import { natural_order } from '../src/fleet';
import { kLogLines, Store } from '../src/store';
import { batch } from './fakes';

const robot = (robot_id: string, change: Partial<RobotState> = {}) =>
  ({ robot_id, link: 'connected', mode: 'manual', sub_state: 'none', emergency_id: null, ...change }) as RobotState;

function store_with(...robots: RobotState[]) {
  const clock = { page: 0, utc: 1_700_000_000_000 };
  const store = new Store({ page_ms: () => clock.page, utc_ms: () => clock.utc });
  store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots });
  return { store, clock };
}

test('numerals follow the last sample, at the refresh and not per sample', () => {
  const { store } = store_with(robot('rheo-1'));
  const one = store.find('rheo-1')!;
  store.receive(batch(0, 5));
  expect(one.readout.value.position_m).toBeNull();
  store.refresh();
  expect(one.readout.value).toMatchObject({
    position_m: 0.004,
    estimate_m: 0.004,
    setpoint_m: 0.1,
    duty: 0.5,
    mode: 'auto',
    stale: false,
  });
});

test('a disturbance moves what the controller sees away from where the robot is', () => {
  const { store } = store_with(robot('rheo-1'));
  store.receive(batch(100, 1, { disturbance_m: -0.05, position_m: [0.1] }));
  store.refresh();
  const { position_m, estimate_m, disturbance_m } = store.find('rheo-1')!.readout.value;
  expect(position_m).toBeCloseTo(0.1, 12);
  expect(estimate_m).toBeCloseTo(0.15, 12);
  expect(disturbance_m).toBe(-0.05);
});

test('without a known disturbance nobody knows where the robot is', () => {
  const { store } = store_with(robot('rheo-1'));
  store.receive(batch(100, 1, { disturbance_m: null }));
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({ estimate_m: null, position_m: 0.1 });
});

test('no sample for over half a second marks every numeral stale and shows the age', () => {
  const { store, clock } = store_with(robot('rheo-1'));
  store.receive(batch(0, 5));
  clock.page = 500;
  store.refresh();
  expect(store.find('rheo-1')!.readout.value.stale).toBe(false);
  clock.page = 620;
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({ stale: true, sample_age_ms: 620, position_m: 0.004 });
});

test('of a silent robot the mode is the one that the station knows', () => {
  const { store, clock } = store_with(robot('rheo-1'));
  store.receive(batch(0, 5));
  clock.page = 1000;
  store.receive({ type: 'robot', robot: robot('rheo-1', { mode: 'emergency', emergency_id: '9' }) });
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({ mode: 'emergency', emergency_id: '9' });
});

test('backfill is history: it does not move the numerals back', () => {
  const { store } = store_with(robot('rheo-1'));
  store.receive(batch(0, 5));
  store.receive(batch(20, 5));
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({ received: 10, missing: 15 });
  store.receive(batch(5, 15, { backfill: true, mode: 'manual' }));
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({
    position_m: 0.024,
    mode: 'auto',
    received: 25,
    missing: 0,
  });
});

test('a new boot counts anew', () => {
  const { store } = store_with(robot('rheo-1'));
  store.receive(batch(500, 5));
  store.receive(batch(0, 5, { boot_id: '12' }));
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({ received: 5, missing: 0 });
});

test('the only robot is selected by itself, a connected one rather than one that is away', () => {
  const { store } = store_with(robot('a', { link: 'disconnected' }), robot('b'));
  expect(store.selected_id.value).toBe('b');
});

test('what a person selected stays, whoever connects', () => {
  const { store } = store_with(robot('a', { link: 'disconnected' }));
  store.select('a');
  store.receive({ type: 'robot', robot: robot('b') });
  expect(store.selected_id.value).toBe('a');
  expect(store.robots.value).toHaveLength(2);
});

// SAFETY: Escape stops what is selected.
test('a robot that was connected stays selected when its link breaks, whoever else is there', () => {
  const { store } = store_with(robot('a'), robot('b'));
  store.receive({ type: 'robot', robot: robot('a', { link: 'disconnected' }) });
  expect(store.selected_id.value).toBe('a');
  store.receive({
    type: 'welcome',
    actor: 'session:1',
    version: '',
    utc_us: 0,
    stamp_us: 0,
    robots: [robot('a', { link: 'disconnected' }), robot('b')],
  });
  expect(store.selected_id.value).toBe('a');
});

test('until a robot is connected the selection looks for one', () => {
  const { store } = store_with(robot('a', { link: 'disconnected' }), robot('b', { link: 'disconnected' }));
  expect(store.selected_id.value).toBe('a');
  store.receive({ type: 'robot', robot: robot('b') });
  expect(store.selected_id.value).toBe('b');
  store.receive({ type: 'robot', robot: robot('a') });
  store.receive({ type: 'robot', robot: robot('b', { link: 'disconnected' }) });
  expect(store.selected_id.value).toBe('b');
});

test('a robot that was sent something stays selected, also one that was never connected', () => {
  const { store } = store_with(robot('a', { link: 'disconnected' }));
  store.keep_selected();
  store.receive({ type: 'robot', robot: robot('b') });
  expect(store.selected_id.value).toBe('a');
});

const event_at = (robot_time_us: number, change: Partial<EventRecord> = {}) =>
  ({
    robot_id: 'rheo-1',
    boot_id: '11',
    event_seq: robot_time_us,
    robot_time_us,
    kind: 'mode_changed',
    position_m: 0.1,
    received_at_us: 9,
    ...change,
  }) as EventRecord;

test('the position of an event has the ± of its own moment, or none', () => {
  const { store } = store_with(robot('rheo-1', { boot_id: '11', latest_robot_time_us: 0, position_sd_m: 0.02 }));
  const sd_of = (event: EventRecord) => {
    store.receive({ type: 'event', event });
    store.refresh();
    return store.log.value[0]?.position_sd_m;
  };
  expect(sd_of(event_at(100_000))).toBe(0.02); // of the state, before samples come
  store.receive(batch(1000, 5, { position_sd_m: 0.03 })); // to 10.04 s
  expect(sd_of(event_at(10_100_000))).toBe(0.03);
  expect(sd_of(event_at(4_000_000))).toBeNull();
  expect(sd_of(event_at(10_050_000, { boot_id: '10' }))).toBeNull();
  expect(sd_of(event_at(10_060_000, { kind: 'position_zeroed', position_m: 0 }))).toBeNull();
  store.receive(batch(1005, 5, { position_sd_m: 0 })); // a perfect sensor
  expect(sd_of(event_at(10_110_000))).toBe(0);
});

test('the log keeps the last lines, newest first, and a command has one line that changes', () => {
  const { store } = store_with(robot('rheo-1'));
  const command = (n: number, state: CommandRecord['state']) =>
    store.receive({
      type: 'command',
      command: { command_id: String(n), robot_id: 'rheo-1', state, submitted_at_us: n } as CommandRecord,
    });
  for (let n = 0; n < 3 * kLogLines; ++n) {
    command(n, 'sent');
    if (n % 7 === 0) store.refresh();
  }
  store.refresh();
  command(3 * kLogLines - 2, 'acknowledged');
  store.refresh();
  expect(store.log.value).toHaveLength(kLogLines);
  expect(store.log.value[0]?.key).toBe(`command-${3 * kLogLines - 1}`);
  expect(store.log.value[1]?.command?.state).toBe('acknowledged');
});

test('a log brings events and commands together; of each command one line stays', () => {
  const { store } = store_with(robot('rheo-1'));
  const command = (n: number, state: CommandRecord['state']) =>
    ({ command_id: String(n), robot_id: 'rheo-1', state, submitted_at_us: n }) as CommandRecord;
  const event = { robot_id: 'rheo-1', boot_id: '7', event_seq: 3, kind: 'emergency', received_at_us: 9 } as EventRecord;
  store.receive({ type: 'command', command: command(1, 'sent') });
  store.receive({ type: 'log', events: [event], commands: [command(1, 'acknowledged'), command(2, 'sent')] });
  store.refresh();
  expect(store.log.value.map((line) => line.command?.state ?? line.event?.kind)).toEqual([
    'sent',
    'acknowledged',
    'emergency',
  ]);
});

test('what happened before stands in the log by its time, once, and nothing that is newer is taken back', () => {
  const { store } = store_with(robot('rheo-1'));
  const command = (n: number, state: CommandRecord['state'], change: Partial<CommandRecord> = {}) =>
    ({ command_id: String(n), robot_id: 'rheo-1', state, submitted_at_us: n * 1000, ...change }) as CommandRecord;
  const event = (n: number, change: Partial<EventRecord> = {}) => event_at(n, { received_at_us: n * 1000, ...change });
  store.receive({ type: 'event', event: event(4) });
  store.receive({ type: 'command', command: command(5, 'sent') });
  store.receive({ type: 'command', command: command(6, 'sent') });
  const asked_at = store.mark_log();
  store.receive({ type: 'command', command: command(6, 'verified') }); // since then
  const latch = event(1, { kind: 'emergency', emergency_id: '77' });
  const listed = [5, 6].map((n) => command(n, 'acknowledged'));
  const lease = command(3, 'acknowledged', { kind: 'renew_lease' });
  store.take_past([event(4), latch], [...listed, command(2, 'verified'), lease], asked_at);
  expect(store.log.value.map((line) => [line.at_ms, line.command?.state ?? line.event?.kind])).toEqual([
    [6, 'verified'],
    [5, 'acknowledged'], // it went on while this page was cut off
    [4, 'mode_changed'],
    [2, 'verified'],
    [1, 'emergency'],
  ]);
  expect(store.latches.is_known('77')).toBe(true);
  const many = Array.from({ length: 2 * kLogLines }, (_, n) => event(100 + n));
  store.take_past(many, [], store.mark_log());
  expect(store.log.value).toHaveLength(kLogLines);
  expect(store.log.value[0]?.at_ms).toBe(100 + 2 * kLogLines - 1);
});

test('dropped messages are said', () => {
  const { store } = store_with(robot('rheo-1'));
  store.receive({ type: 'dropped', count: 12 });
  store.refresh();
  expect(store.log.value[0]?.note).toContain('12');
});

test('an open run is shown until it ends', () => {
  const { store } = store_with(robot('rheo-1'));
  const run = { run_id: 7, robot_id: 'rheo-1', ended_at_us: null } as never as Parameters<Store['take_run']>[0];
  store.receive({ type: 'run', run });
  expect(store.runs.value).toHaveLength(1);
  store.receive({ type: 'run', run: { ...run, ended_at_us: 5 } });
  expect(store.runs.value).toHaveLength(0);
});

test('a list of open runs that was asked for earlier takes back nothing that was reported since', () => {
  const { store } = store_with(robot('rheo-1'));
  const run = (run_id: number, ended_at_us: number | null = null) =>
    ({ run_id, robot_id: 'rheo-1', ended_at_us }) as never as Parameters<Store['take_run']>[0];
  const open = () => store.runs.value.map(({ run_id }) => run_id);
  store.take_run(run(6));
  const asked_at = store.mark();
  store.receive({ type: 'run', run: run(7, 5) });
  store.receive({ type: 'run', run: run(8) });
  store.set_runs([run(7)], asked_at);
  expect(open()).toEqual([8]); // 6 is listed no more, 7 has ended since, 8 has begun since
  store.take_run_answer(run(7), asked_at); // the newest run of a robot is asked for as well
  expect(open()).toEqual([8]);
  store.set_runs([run(9)], store.mark());
  expect(open()).toEqual([9]);
});

test('a robot whose samples are not asked for shows link and mode, and no old numbers', () => {
  const { store, clock } = store_with(robot('rheo-1'), robot('rheo-2', { mode: 'auto' }));
  store.is_current.value = true;
  store.watch(['rheo-1']);
  clock.page = 1500;
  store.refresh();
  expect(store.find('rheo-2')!.readout.value).toMatchObject({
    watched: false,
    position_m: null,
    estimate_m: null,
    mode: 'auto',
    stale: false,
  });
  expect(store.find('rheo-1')!.readout.value.stale).toBe(true);
  store.receive({ type: 'robot', robot: robot('rheo-2', { mode: 'emergency', link: 'disconnected' }) });
  store.refresh();
  expect(store.find('rheo-2')!.readout.value).toMatchObject({ mode: 'emergency', stale: true });
});

test('what was not asked for is not missing afterwards', () => {
  const { store } = store_with(robot('rheo-1'));
  store.receive(batch(0, 5));
  store.watch([]);
  store.watch(['rheo-1']);
  store.receive(batch(500, 5));
  store.refresh();
  expect(store.find('rheo-1')!.readout.value).toMatchObject({ received: 5, missing: 0 });
});

test('the time of a latch is known only of one that this page saw begin', () => {
  const latched = { mode: 'emergency', emergency_id: '7' } as const;
  const { store, clock } = store_with(robot('a', latched), robot('b'));
  const name = (id: string) => store.latches.name(id, 'operator');
  const since = name('7');
  expect(since).toMatch(/^operator, before /);
  clock.utc += 60_000;
  store.receive({ type: 'robot', robot: robot('a', latched) }); // ten a second
  expect(name('7')).toBe(since);
  store.receive({ type: 'robot', robot: robot('b', { mode: 'emergency', emergency_id: '8' }) });
  expect(name('8')).not.toContain('before');
  store.receive({ type: 'robot', robot: robot('c', { mode: 'emergency', emergency_id: '9' }) }); // not known until now
  store.receive({ type: 'robot', robot: robot('c', { mode: 'emergency', emergency_id: '9' }) });
  expect(name('9')).toContain('before');
});

test('what is known of a robot that is not watched is old while the page is cut off', () => {
  const { store } = store_with(robot('rheo-1'));
  store.watch([]);
  store.is_current.value = true;
  store.refresh();
  expect(store.find('rheo-1')!.readout.value.stale).toBe(false);
  store.is_current.value = false;
  store.refresh();
  expect(store.find('rheo-1')!.readout.value.stale).toBe(true);
});

test('renewals of a lease are no lines of the log, unless they fail', () => {
  const { store } = store_with(robot('rheo-1'));
  const renewal = (n: number, state: CommandRecord['state']) =>
    ({ command_id: String(n), robot_id: 'rheo-1', kind: 'renew_lease', state, submitted_at_us: n }) as CommandRecord;
  const states = ['queued', 'sent', 'acknowledged', 'verified', 'superseded'] as const;
  states.forEach((state, n) => store.receive({ type: 'command', command: renewal(n, state) }));
  store.receive({ type: 'log', events: [], commands: states.map((state, n) => renewal(10 + n, state)) });
  store.refresh();
  expect(store.log.value).toHaveLength(0);
  store.receive({ type: 'command', command: renewal(20, 'rejected') });
  store.refresh();
  expect(store.log.value.map((line) => line.command?.state)).toEqual(['rejected']);
});

const run = (run_id: number, state: RunRecord['state']) =>
  ({
    run_id,
    robot_id: 'rheo-1',
    name: 'a',
    state,
    started_at_us: 1,
    ended_at_us: state === 'open' ? null : 2,
  }) as RunRecord;

test('a run that was interrupted is known until its robot has a newer one, and is reported once', () => {
  const { store } = store_with(robot('rheo-1'));
  store.take_run(run(7, 'interrupted'));
  store.take_run(run(7, 'interrupted'));
  store.refresh();
  expect(store.interrupted.value.map((each) => each.run_id)).toEqual([7]);
  expect(store.log.value).toHaveLength(1);
  store.take_run(run(6, 'ended'));
  expect(store.interrupted.value).toHaveLength(1);
  store.take_run(run(8, 'open'));
  expect(store.interrupted.value).toHaveLength(0);
});

test('a stop is shown by telemetry received after it, and not by what a robot that is away was last', () => {
  const { store, clock } = store_with(robot('rheo-1'));
  const latched = { mode: 'emergency', emergency_id: '9' } as const;
  clock.page = 100;
  store.receive(batch(0, 5, latched));
  expect(store.stop_evidence('rheo-1', 100)).toMatchObject({ latched: 0, open: 1 });
  clock.page = 200;
  store.receive({ type: 'robot', robot: robot('rheo-1', { ...latched, link: 'disconnected', pending_stop: null }) });
  expect(store.stop_evidence('rheo-1', 100)).toMatchObject({ latched: 0, open: 1 });
  store.receive({ type: 'robot', robot: robot('rheo-1', { ...latched, link: 'disconnected', pending_stop: '5' }) });
  expect(store.stop_evidence('rheo-1', 100)).toMatchObject({ kept: 1, open: 0 });
  clock.page = 300;
  store.receive(batch(5, 5, latched));
  expect(store.stop_evidence('rheo-1', 100)).toMatchObject({ latched: 1, open: 0 });
});

test('samples of before the latch that come after its news do not undo it; its end does', () => {
  const { store, clock } = store_with(robot('rheo-1'));
  clock.page = 100;
  store.receive({ type: 'robot', robot: robot('rheo-1', { mode: 'emergency', emergency_id: '9' }) });
  clock.page = 150;
  store.receive(batch(0, 5));
  expect(store.stop_evidence('rheo-1', 50)).toMatchObject({ latched: 1, cleared: 0 });
  clock.page = 5000;
  store.receive(batch(5, 5, { mode: 'manual' }));
  expect(store.stop_evidence('rheo-1', 50)).toMatchObject({ latched: 0, cleared: 1 });
});

test('of a stop of every robot a retired one counts only while it is connected', () => {
  const { store } = store_with(
    robot('a', { retired: true, link: 'disconnected' }),
    robot('b', { retired: true }),
    robot('c'),
  );
  expect(store.stop_evidence(null, 0).open).toBe(2);
});

test('621 robots are taken in order, in one welcome', () => {
  const { store } = store_with(...Array.from({ length: 621 }, (_, n) => robot(`r-${(n * 7919) % 1000}`)));
  const ids = store.robots.value.map((each) => each.state.value.robot_id);
  expect(ids).toEqual([...ids].sort(natural_order));
  expect(ids).toHaveLength(621);
});
