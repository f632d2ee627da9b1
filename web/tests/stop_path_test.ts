// Whether a stop would work now: how soon the page says so when it would not, and what it says.
import { expect, test } from 'vitest';
import type { RobotState } from '../src/api';
import { kEcho_ms, kUnanswered_ms, StationPath } from '../src/station_path';
import { latency_text, readiness_of, StopPath } from '../src/stop_path';
import { FakeTime } from './fakes';

function watched() {
  const time = new FakeTime();
  const path = new StationPath();
  const world = { is_live: true, echoes: true };
  const stop_path = new StopPath(path, {
    now_ms: () => time.now_ms,
    set_timer: (callback, delay_ms) => time.set(callback, delay_ms),
    clear_timer: (timer) => time.clear(timer),
    is_live: () => world.is_live,
  });
  const stamp = (sent_ms = time.now_ms) => {
    if (path.receive({ stamp_us: sent_ms * 1000 }, time.now_ms)) {
      path.echoed(sent_ms * 1000, time.now_ms);
      if (world.echoes) path.receive_echo(sent_ms * 1000, time.now_ms + 1);
    }
    stop_path.look();
  };
  const run = async (ms: number) => {
    for (let at_ms = 0; at_ms < ms; at_ms += 100) {
      await time.advance(100);
      stamp();
    }
  };
  path.begin({ stamp_us: 0, utc_us: 0 }, 0);
  stop_path.look();
  return { time, world, stop_path, stamp, run };
}

test('it would work while stamps come and echoes are confirmed', async () => {
  const { stop_path, run } = watched();
  await run(5000);
  expect(stop_path.hindrance.value).toBeNull();
});

// SAFETY: within 300 ms.
test('a station that stands still is seen within 300 ms, without a message', async () => {
  const { stop_path, run, time } = watched();
  await run(1000);
  await time.advance(240);
  expect(stop_path.hindrance.value).toBeNull();
  await time.advance(60);
  expect(stop_path.hindrance.value).toBe('silent');
});

test('a way up that is dead is seen within 300 ms or so, while stamps still come', async () => {
  const { stop_path, run, world, stamp, time } = watched();
  await run(1000);
  world.echoes = false;
  let after_ms = 0;
  for (; stop_path.hindrance.value === null; after_ms += 10) {
    await time.advance(10);
    if (time.now_ms % 100 === 0) stamp();
  }
  expect(stop_path.hindrance.value).toBe('unanswered');
  expect(after_ms).toBeLessThanOrEqual(kEcho_ms + kUnanswered_ms + 10);
  world.echoes = true;
  await run(300);
  expect(stop_path.hindrance.value).toBeNull();
});

// SAFETY: a tab that was frozen finds its timer late and old stamps waiting.
test('a tab that was frozen judges by the true age when it runs again', async () => {
  const { stop_path, run, time, stamp } = watched();
  await run(1000);
  time.now_ms = 9000; // nothing ran meanwhile
  stamp(1100); // it has waited
  expect(stop_path.hindrance.value).toBe('silent');
  stamp(1200);
  expect(stop_path.hindrance.value).toBe('silent');
  stamp(8990);
  expect(stop_path.hindrance.value).toBeNull();
});

test('a timer that finds the page standing still lets it read first, and once only', async () => {
  const { stop_path, run, time } = watched();
  await run(1000);
  const seen: unknown[] = [];
  const end = stop_path.hindrance.subscribe((value) => seen.push(value));
  time.now_ms = 5000;
  await time.advance(0); // the late timer
  await time.advance(1);
  expect(stop_path.hindrance.value).toBe('silent');
  end();
});

test('a connection that is lost is said at once', async () => {
  const { stop_path, run, world } = watched();
  await run(500);
  world.is_live = false;
  stop_path.look();
  expect(stop_path.hindrance.value).toBe('cut_off');
});

const robot = (change: Partial<RobotState> = {}) => ({ robot_id: 'sim-1', link: 'connected', ...change }) as RobotState;
const open = (round_trip_us: number | null) => ({ is_open: true, round_trip_us, answered_at_us: 1 });

test('the latency is that of both parts', () => {
  const ready = readiness_of(null, 1.25, robot({ stop_path: open(2250) }));
  expect(ready).toMatchObject({ works: true, latency_ms: 3.5 });
  expect(latency_text(ready)).toBe('path 3.5 ms');
  expect(ready.parts).toBe('There and back: page to station 1.3 ms, station to sim-1 2.3 ms');
});

test('what is not measured is said to be so, and is no reason against the stop', () => {
  for (const ready of [
    readiness_of(null, null, robot({ stop_path: open(2250) })),
    readiness_of(null, 1.2, robot({ stop_path: open(null) })),
    readiness_of(null, 1.2, robot()),
  ]) {
    expect(ready).toMatchObject({ works: true, latency_ms: null });
    expect(latency_text(ready)).toBe('path not measured yet');
  }
});

test('what hinders it is named with what becomes of a press', () => {
  const text = (...given: Parameters<typeof readiness_of>) => {
    const ready = readiness_of(...given);
    expect(ready).toMatchObject({ works: false, latency_ms: null });
    return ready.text;
  };
  const shut = { is_open: false, round_trip_us: 2000, answered_at_us: 1 };
  expect(text('cut_off', 1, robot())).toBe('will be sent when the station answers');
  expect(text('silent', 1, null)).toBe('will be sent when the station answers');
  expect(text('unanswered', 1, null)).toBe('will be sent when the station is reached');
  expect(text(null, 1, robot({ link: 'disconnected' }))).toBe('will be sent when sim-1 returns');
  expect(text(null, 1, robot({ stop_path: shut }))).toBe('will be sent when sim-1 answers');
});
