// The "±" of positions in the log of a replay: from the samples around an event, wherever the moment of the replay is.
import { expect, test } from 'vitest';
import type { EventRecord, StoredSample } from '../../src/api';
import { describe } from '../../src/parts/log_strip';
import { lines_of, Replay } from '../../src/views/runs/replay/replay';
import { settle } from '../fakes';
import { at, kOrigin_us, kPeriod_us, sample, samples } from './made';

const kSamples = 100_000;
const kExtent = { first_us: kOrigin_us, last_us: at(kSamples - 1), period_us: kPeriod_us };

const event = (seq: number, change: Partial<EventRecord> = {}) =>
  ({
    robot_id: 'rheo-1',
    boot_id: '11',
    event_seq: seq,
    sample_seq: seq,
    robot_time_us: seq * kPeriod_us,
    received_at_us: at(seq),
    kind: 'time_step',
    cause: 'none',
    emergency_cause: null,
    detail: '',
    position_m: seq / 1000,
    value: null,
    ...change,
  }) as EventRecord;

function replay_of(recorded: (seq: number) => Partial<StoredSample> | null, events: EventRecord[]) {
  const asked: [number, number][] = [];
  const timers: (() => void)[] = [];
  const state = { fails: false };
  const ways = {
    samples: (from_us: number, to_us: number, limit: number) => {
      if (to_us - from_us < 1000 * kPeriod_us) asked.push([from_us, to_us]); // less than a page
      if (state.fails) return Promise.reject(new Error('away'));
      const [first, last] = [from_us, to_us].map((us) => Math.max(0, Math.ceil((us - kOrigin_us) / kPeriod_us)));
      const found = samples(first!, Math.min(last!, kSamples)).flatMap(({ seq }) => {
        const change = recorded(seq);
        return change ? [sample(seq, change)] : [];
      });
      return Promise.resolve(found.slice(0, limit));
    },
    set_timer: (callback: () => void) => timers.push(callback),
  };
  const replay = new Replay(kExtent, ways, () => 0);
  replay.take_lines(lines_of(events, [], [], kExtent));
  const texts = async () => {
    for (let turn = 0; turn < 20; ++turn) await settle();
    return replay.lines.value.map((line) => /controller at (.*)/.exec(describe(line)[2])?.[1]);
  };
  return { replay, asked, timers, state, texts };
}

test('an event has the ± of the sample of its moment, which is that of the page', async () => {
  const { replay, asked, texts } = replay_of(
    (seq) => ({ position_sd_m: seq < 500 ? 0.001 : 0.003 }),
    [event(100), event(500)],
  );
  await texts(); // its page has come
  replay.seek(8);
  expect(await texts()).toEqual(['500.0 ± 6.0 mm', '100.0 ± 2.0 mm']);
  expect(asked).toEqual([]);
});

test('of an event far before the moment the few samples around it are read, once', async () => {
  const { replay, asked, texts } = replay_of(() => ({ position_sd_m: 0.001 }), [event(100), event(40_000)]);
  replay.seek(900);
  await texts();
  replay.seek(900.5);
  expect(await texts()).toEqual(['40000.0 ± 2.0 mm', '100.0 ± 2.0 mm']);
  expect(asked).toEqual([
    [at(40_000) - 200_000, at(40_000) + 1],
    [at(100) - 200_000, at(100) + 1],
  ]);
});

test('until they have come nothing is said of the ±; a request that fails is made again', async () => {
  const { replay, timers, state, texts } = replay_of(() => ({ position_sd_m: 0.001 }), [event(40_000)]);
  await texts();
  state.fails = true;
  replay.seek(900);
  expect(await texts()).toEqual(['40000.0 mm']);
  state.fails = false;
  timers.forEach((callback) => callback());
  expect(await texts()).toEqual(['40000.0 ± 2.0 mm']);
});

test('not known is what no sample within 0.2 s knows, of another boot, or without a place in the recording', async () => {
  const is_there = (seq: number) => (seq < 1000 || seq >= 1100 ? { position_sd_m: seq < 200 ? null : 0.001 } : null);
  const { replay, texts } = replay_of(is_there, [
    event(100), // samples without a ±
    event(1020), // 21 samples after the last one
    event(1019),
    event(1200, { boot_id: '12' }),
    event(1300, { sample_seq: null }),
    event(1400, { kind: 'position_zeroed', position_m: 0 }),
  ]);
  for (const at_s of [20, 900]) {
    replay.seek(at_s);
    expect(await texts()).toEqual([
      '0.0 mm',
      '1300.0 mm, ± not known',
      '1200.0 mm, ± not known',
      '1020.0 mm, ± not known',
      '1019.0 ± 2.0 mm',
      '100.0 mm, ± not known',
    ]);
  }
});
