// What the page knows of experiments, the order of a queue, and for which of them it gives signs of life.
import { afterEach, expect, test, vi } from 'vitest';
import type { LiveMessage } from '../src/api';
import { ExperimentsStore, type ExperimentSummary } from '../src/experiments_store';
import { Session } from '../src/session';
import { Store } from '../src/store';
import { experiment } from './experiments/experiment';
import { FakeSurroundings } from './fakes';

afterEach(() => vi.unstubAllGlobals());

const ids = (list: readonly ExperimentSummary[]) => list.map((each) => each.experiment_id);

test('what /live reports of an experiment is taken in by the store of the page', () => {
  const store = new Store({ page_ms: () => 0, utc_ms: () => 0 });
  store.receive({ type: 'experiment', experiment: experiment(3, { state: 'running' }) });
  expect(store.experiments.find(3)?.state).toBe('running');
  expect(store.experiments.at_work_on('sim-1')?.experiment_id).toBe(3);
  expect(store.experiments.at_work_on('sim-2')).toBeUndefined();
});

test('an answer that is older than a report of /live changes nothing', () => {
  const store = new ExperimentsStore();
  store.take(experiment(3, { state: 'running' }));
  const asked_at = store.mark();
  store.take(experiment(3, { state: 'paused' }));
  store.take_answer([experiment(3, { state: 'running' }), experiment(4)], asked_at);
  expect(store.find(3)?.state).toBe('paused');
  expect(store.find(4)?.state).toBe('waiting');
  store.take_answer([experiment(3, { state: 'running' })], store.mark());
  expect(store.find(3)?.state).toBe('running');
});

test('what has ended never goes on again', () => {
  const store = new ExperimentsStore();
  store.take(experiment(3, { state: 'aborted' }));
  store.take_answer([experiment(3, { state: 'running' })], store.mark());
  expect(store.find(3)?.state).toBe('aborted');
});

test('what went on before the connection broke and is not listed any more is forgotten', () => {
  const store = new ExperimentsStore();
  store.take(experiment(1, { state: 'running' }));
  store.take(experiment(2, { state: 'done' }));
  const asked_at = store.mark();
  store.take(experiment(5));
  store.take_open([experiment(4)], asked_at);
  expect([...store.known.value.keys()].sort()).toEqual([2, 4, 5]);
});

test('the ended ones do not fill the memory, the others stay', () => {
  const store = new ExperimentsStore();
  store.take(experiment(1));
  for (let id = 2; id < 300; ++id) store.take(experiment(id, { state: 'done' }));
  expect(store.known.value.size).toBe(201);
  expect(store.find(1)).toBeDefined();
  expect(store.find(99)).toBeUndefined();
});

test('the highest priority begins first, then the oldest, and what runs does not wait', () => {
  const store = new ExperimentsStore();
  const list = [experiment(4), experiment(2), experiment(3, { priority: 5 }), experiment(1, { state: 'running' })];
  store.take_open([...list, experiment(9, { robot_id: 'sim-2' })], 0);
  expect(ids(store.queue_of('sim-1'))).toEqual([3, 2, 4]);
});

test('a move changes the places as the station does, and the priority comes with the place', () => {
  const store = new ExperimentsStore();
  store.take_open([experiment(1, { priority: 2 }), experiment(2), experiment(3), experiment(4)], 0);
  store.note_move(experiment(4), 2);
  expect(ids(store.queue_of('sim-1'))).toEqual([1, 4, 2, 3]);
  store.note_move(experiment(3, { priority: 2 }), 1);
  expect(ids(store.queue_of('sim-1'))).toEqual([3, 1, 4, 2]);
  store.note_move(experiment(3, { priority: 0 }), null);
  expect(ids(store.queue_of('sim-1'))).toEqual([1, 4, 2, 3]);
});

test('where the station reports the place it decides', () => {
  const store = new ExperimentsStore();
  store.take_open([experiment(1, { place: 7 }), experiment(2, { place: 3 })], 0);
  expect(ids(store.queue_of('sim-1'))).toEqual([2, 1]);
});

// SAFETY: a sign of life lets a robot go on.
test('signs of life are for what is in the hands of this tab and goes on', () => {
  const kept = (change: Partial<ExperimentSummary>) => {
    const store = new ExperimentsStore();
    store.take(experiment(1, { client: 'this-tab', ...change }));
    return store.kept_by('session:1', 'this-tab');
  };
  expect(kept({ state: 'running' })).toEqual([1]);
  expect(kept({ state: 'waiting' })).toEqual([1]);
  expect(kept({ state: 'waiting', held: true })).toEqual([1]); // its page is there when it is resumed
  expect(kept({ state: 'done' })).toEqual([]);
  expect(kept({ state: 'running', acts_for: 'session:2' })).toEqual([]);
  expect(kept({ state: 'running', client: 'other-tab' })).toEqual([]);
  expect(new ExperimentsStore().kept_by('', '')).toEqual([]);
});

test('the page gives a sign of life with each stamp while something acts in its name, and no stamp otherwise', () => {
  vi.stubGlobal('fetch', () => Promise.reject(new Error('no network here')));
  const surroundings = new FakeSurroundings();
  const session = new Session({ open_socket: surroundings.open_socket });
  session.link.start();
  const { socket } = surroundings;
  socket.welcome();
  const stamp = (stamp_us: number) => socket.say({ type: 'stamp', stamp_us, utc_us: 0 } as LiveMessage);
  const signs = () => socket.sent.filter((said) => (said as { type: string }).type === 'keep_alive');
  stamp(100);
  expect(signs()).toEqual([]);
  socket.say({ type: 'experiment', experiment: experiment(1, { state: 'running' }) });
  stamp(200);
  stamp(300);
  expect(signs()).toEqual([
    { type: 'keep_alive', stamp_us: 200, robots: [], experiments: [1] },
    { type: 'keep_alive', stamp_us: 300, robots: [], experiments: [1] },
  ]);
  socket.say({ type: 'experiment', experiment: experiment(1, { state: 'done' }) });
  stamp(400);
  expect(signs()).toHaveLength(2);
  session.link.stop();
});
