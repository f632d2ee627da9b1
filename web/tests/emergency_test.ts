// The emergency stop and its key.
import { expect, test } from 'vitest';
import type { CommandRecord } from '../src/api';
import { EmergencyStop, kAgain_ms, kKept_ms, kLate_ms, type StopState } from '../src/emergency';
import { kFullScreenNote, kShortcuts, listen_for_stop_key } from '../src/keys';
import { outcome_of, type StopEvidence } from '../src/stop_outcome';
import { settle } from './fakes';

const record = (state: CommandRecord['state'], robot_id = 'rheo-1', reason = '') =>
  ({ state, robot_id, reason }) as CommandRecord;

function stop_with(over_http: () => Promise<CommandRecord[]>, over_socket: () => boolean = () => true) {
  const evidence: StopEvidence = { latched: 0, kept: 0, cleared: 0, open: 1 };
  const world = { now_ms: 0, ways: [] as string[], keys: [] as string[], states: [] as StopState[], evidence };
  const emergency = new EmergencyStop({
    over_socket: (robot_id, key) => {
      world.ways.push(`socket ${robot_id}`);
      world.keys.push(key);
      return over_socket();
    },
    over_http: (robot_id, key) => {
      world.ways.push(`http ${robot_id}`);
      world.keys.push(key);
      return over_http().then(outcome_of);
    },
    evidence: () => world.evidence,
    was_answered: (error) => (error as Error).message.startsWith('refused'),
    now_ms: () => world.now_ms,
    on_change: (state) => world.states.push(state),
  });
  return { emergency, world };
}

test('leaves over both ways in the call that pressed it', () => {
  const { emergency, world } = stop_with(() => new Promise(() => undefined));
  void emergency.stop('rheo-1');
  expect(world.ways).toEqual(['socket rheo-1', 'http rheo-1']);
  expect(emergency.state.phase).toBe('sent');
});

test('one press has one key on both ways, the next press another', () => {
  const { emergency, world } = stop_with(() => new Promise(() => undefined));
  void emergency.stop('rheo-1');
  void emergency.stop('rheo-1');
  const [first, second, third, fourth] = world.keys;
  expect(first).toMatch(/^[A-Za-z0-9._:-]{1,64}$/);
  expect(second).toBe(first);
  expect(fourth).toBe(third);
  expect(third).not.toBe(first);
});

test('a stop that telemetry has shown already is shown as stopped', async () => {
  const { emergency } = stop_with(() => Promise.resolve([record('verified')]));
  await emergency.stop('rheo-1');
  expect(emergency.state.phase).toBe('stopped');
});

test('a broken socket does not keep it from the other way', async () => {
  const { emergency, world } = stop_with(
    () => Promise.resolve([record('acknowledged')]),
    () => {
      throw new Error('socket');
    },
  );
  world.now_ms = 1000;
  const done = emergency.stop('rheo-1');
  world.now_ms = 1023;
  await done;
  expect(emergency.state).toMatchObject({ phase: 'stopped', answered_after_ms: 23, robot_id: 'rheo-1' });
});

test('for a robot that is away it says that the stop is kept', async () => {
  const { emergency } = stop_with(() => Promise.resolve([record('acknowledged', 'a'), record('queued', 'b')]));
  await emergency.stop(null);
  expect(emergency.state).toMatchObject({ phase: 'kept', outcome: { summary: { acknowledged: 1, kept: 1 } } });
});

test('a sent stop without an answer is not shown as stopped', async () => {
  const { emergency } = stop_with(() => Promise.resolve([record('sent')]));
  await emergency.stop('rheo-1');
  expect(emergency.state.phase).toBe('unanswered');
});

test('a failure is said, with what did work', async () => {
  const { emergency } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  await emergency.stop('rheo-1');
  expect(emergency.state.phase).toBe('failed');
  expect(emergency.state.problem).toContain('over the live link');
});

test('a second press sends again, and the answer to the first is not shown over it', async () => {
  const answers: ((records: CommandRecord[]) => void)[] = [];
  const { emergency, world } = stop_with(() => new Promise((done) => answers.push(done)));
  void emergency.stop('a');
  void emergency.stop('b');
  expect(world.ways).toHaveLength(4);
  answers[0]?.([record('acknowledged', 'a')]);
  await settle();
  expect(emergency.state).toMatchObject({ phase: 'sent', robot_id: 'b' });
});

test('without an answer for a second it says that the stop may not have arrived', () => {
  const { emergency, world } = stop_with(() => new Promise(() => undefined));
  void emergency.stop('rheo-1');
  world.now_ms = kLate_ms - 1;
  emergency.look();
  expect(emergency.state.phase).toBe('sent');
  world.now_ms = kLate_ms;
  emergency.look();
  expect(emergency.state.phase).toBe('late');
});

test('that it may not have arrived stands until telemetry shows the latch', async () => {
  const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  await emergency.stop('rheo-1');
  for (world.now_ms = 0; world.now_ms < 3_600_000; world.now_ms += 60_000) emergency.look();
  expect(emergency.state.phase).toBe('failed');
  world.evidence = { latched: 1, kept: 0, cleared: 0, open: 0 };
  emergency.look();
  expect(emergency.state.phase).toBe('seen');
});

test('of every robot each must show its latch, or be away with the stop kept', async () => {
  const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  await emergency.stop(null);
  world.evidence = { latched: 2, kept: 1, cleared: 0, open: 1 };
  emergency.look();
  expect(emergency.state.phase).toBe('failed');
  world.evidence = { latched: 3, kept: 1, cleared: 0, open: 0 };
  emergency.look();
  expect(emergency.state.phase).toBe('kept');
  world.evidence = { latched: 4, kept: 0, cleared: 0, open: 0 };
  emergency.look();
  expect(emergency.state.phase).toBe('seen');
});

test('a late failure of one way is not shown over a latch that was seen', async () => {
  const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  world.evidence = { latched: 1, kept: 0, cleared: 0, open: 0 };
  await emergency.stop('rheo-1');
  expect(emergency.state.phase).toBe('seen');
});

test('that a robot was stopped is no longer said when its latch is gone', async () => {
  const { emergency, world } = stop_with(() => Promise.resolve([record('acknowledged')]));
  await emergency.stop('rheo-1');
  emergency.look();
  expect(emergency.state.phase).toBe('stopped');
  world.evidence = { latched: 0, kept: 0, cleared: 1, open: 0 };
  emergency.look();
  expect(emergency.state.phase).toBe('idle');
});

// SAFETY: what may not have arrived stays on the screen, and goes again, whatever else is cleared.
test('that one robot is cleared takes away no stop of all robots, and none of another robot', async () => {
  for (const stopped of [null, 'r5']) {
    const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
    await emergency.stop(stopped);
    emergency.cleared('r1', emergency.newest_press);
    expect(emergency.state).toMatchObject({ phase: 'failed', robot_id: stopped });
    emergency.again();
    expect(world.ways.slice(2)).toEqual([`socket ${stopped}`, `http ${stopped}`]);
  }
});

test('a press while a clear is on its way outlives the answer to the clear', async () => {
  const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  await emergency.stop('r1');
  const before = emergency.newest_press;
  await emergency.stop('r1');
  emergency.cleared('r1', before);
  expect(emergency.state).toMatchObject({ phase: 'failed', is_kept: true });
  emergency.again();
  expect(world.ways).toHaveLength(6);
});

test('the stop of the robot that is cleared is history', async () => {
  const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  await emergency.stop('r1');
  emergency.cleared('r1', emergency.newest_press);
  expect(emergency.state.phase).toBe('idle');
  emergency.again();
  expect(world.ways).toHaveLength(2);
});

function press(key: string, change: Partial<KeyboardEvent> = {}) {
  let stops = 0;
  let listener: (event: KeyboardEvent) => void = () => undefined;
  let prevented = false;
  const target = {
    addEventListener: (_: 'keydown', given: (event: KeyboardEvent) => void, options: { capture: boolean }) => {
      expect(options.capture).toBe(true); // ahead of every field and dialog
      listener = given;
    },
    removeEventListener: () => undefined,
  };
  listen_for_stop_key(target, () => (stops += 1));
  listener({ key, repeat: false, preventDefault: () => (prevented = true), ...change } as KeyboardEvent);
  return { stops, prevented };
}

test('Escape stops, also from inside a field, once however long it is held', () => {
  expect(press('Escape').stops).toBe(1);
  expect(press('Escape', { target: { tagName: 'INPUT' } as never }).stops).toBe(1);
  expect(press('Escape', { repeat: true }).stops).toBe(0);
});

test('Escape stops while an input method composes a word and hides the name of the key', () => {
  expect(press('Process', { code: 'Escape', isComposing: true }).stops).toBe(1);
  expect(press('Process', { code: 'KeyA', isComposing: true }).stops).toBe(0);
  expect(press('CapsLock', { code: 'Escape' }).stops).toBe(0); // the key means something else on this keyboard
});

test('the list of keys says that Space never stops, and who keeps Escape in full screen', () => {
  expect(kShortcuts.find(({ keys }) => keys.includes('Space'))?.what).toMatch(/^Never stops/);
  expect(kFullScreenNote).toMatch(/full screen/);
});

test('typing does not stop', () => {
  for (const key of ['a', ' ', 'Enter', 'Backspace', '1']) expect(press(key)).toEqual({ stops: 0, prevented: false });
});

test('a press that nothing has answered goes again when the station is back, as the same press', async () => {
  let is_back = false;
  const { emergency, world } = stop_with(() =>
    is_back ? Promise.resolve([record('acknowledged')]) : Promise.reject(new Error('The station did not answer.')),
  );
  await emergency.stop('rheo-1');
  expect(emergency.state).toMatchObject({ phase: 'failed', is_kept: true });
  is_back = true;
  emergency.again();
  await settle();
  expect(new Set(world.keys).size).toBe(1);
  expect(world.ways).toHaveLength(4);
  expect(emergency.state.phase).toBe('stopped');
  emergency.again();
  expect(world.ways).toHaveLength(4); // it has been answered
});

test('one that was refused, that telemetry has shown, or that is old, does not go again', async () => {
  const away = () => Promise.reject(new Error('The station did not answer.'));
  const refused = stop_with(() => Promise.reject(new Error('refused')));
  await refused.emergency.stop('rheo-1');
  const seen = stop_with(away);
  await seen.emergency.stop('rheo-1');
  seen.world.evidence = { latched: 0, kept: 0, cleared: 1, open: 0 };
  const old = stop_with(away);
  await old.emergency.stop('rheo-1');
  old.world.now_ms = kKept_ms + 1;
  for (const { emergency, world } of [refused, seen, old]) {
    emergency.again();
    expect(world.ways).toHaveLength(2);
  }
});

// SAFETY: a busy station or a proxy answers while the live link stays as it is, so that no welcome comes.
test('a press that nothing has answered goes again each second, as the same press, until it is answered', async () => {
  const failures = [new Error('busy'), new Error('busy')];
  const { emergency, world } = stop_with(() => {
    const failure = failures.shift();
    return failure ? Promise.reject(failure) : Promise.resolve([record('verified')]);
  });
  await emergency.stop('rheo-1');
  for (const [after_ms, tries] of [
    [kAgain_ms - 1, 1],
    [kAgain_ms, 2],
    [2 * kAgain_ms - 1, 2],
    [2 * kAgain_ms, 3],
    [9 * kAgain_ms, 3],
  ] as const) {
    world.now_ms = after_ms;
    emergency.look();
    await settle();
    expect([after_ms, world.ways.filter((way) => way.startsWith('http')).length]).toEqual([after_ms, tries]);
  }
  expect(new Set(world.keys).size).toBe(1);
  expect(emergency.state.phase).toBe('stopped');
});

test('each robot has its own press that goes again', async () => {
  const { emergency, world } = stop_with(() => Promise.reject(new Error('The station did not answer.')));
  await emergency.stop('a');
  await emergency.stop('b');
  world.ways.length = 0;
  emergency.again();
  expect(world.ways).toEqual(['socket a', 'http a', 'socket b', 'http b']);
});
