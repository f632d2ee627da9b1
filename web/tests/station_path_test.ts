// The way to the station: how old its stamps are, how long the round trip is, and what proves that it receives.
import { describe, expect, test } from 'vitest';
import { kSilent_ms, StationPath } from '../src/station_path';

// A station whose stamps are on their way for `transit_ms`, and which answers echoes.
function connected({ echoes = true, transit_ms = 2 } = {}) {
  const path = new StationPath();
  const start_us = 5_000_000_000;
  path.begin({ stamp_us: start_us, utc_us: 1_764_000_000_000_000, echoes }, 0);
  // A stamp that was sent at sent_ms, arrives at `at_ms`.
  const stamp = (sent_ms: number, at_ms = sent_ms + transit_ms, echo?: { of_ms: number; held_ms: number }) => {
    const stamp_us = start_us + sent_ms * 1000;
    const said = echo ? { echo_us: start_us + echo.of_ms * 1000, echo_held_us: echo.held_ms * 1000 } : {};
    const answer = path.receive({ stamp_us, ...said }, at_ms);
    if (answer) path.echoed(stamp_us, at_ms);
    return answer;
  };
  return { path, stamp };
}

describe('the round trip', () => {
  test('is from the echo to the stamp that confirms it, without the wait in the station', () => {
    const { path, stamp } = connected();
    stamp(100); // arrives at 102, its echo at 105 there, held for 95 ms until the next stamp
    stamp(200, 202, { of_ms: 100, held_ms: 95 });
    expect(path.round_trip_ms).toBeCloseTo(5);
  });

  test('shown is the middle one of the latest, so that one delay does not shake it', () => {
    const { path, stamp } = connected();
    stamp(100);
    for (let k = 2; k <= 10; ++k) stamp(100 * k, 100 * k + (k === 6 ? 80 : 2), { of_ms: 100 * (k - 1), held_ms: 95 });
    expect(path.round_trip_ms).toBeCloseTo(5);
  });

  test('of a station that confirms nothing there is none, and nothing is sent to it', () => {
    const { path, stamp } = connected({ echoes: false });
    expect(stamp(100)).toBe(false);
    expect(path.round_trip_ms).toBeNull();
    expect(path.is_received).toBe(true);
  });

  test('a station that begins to confirm is answered from then on', () => {
    const { stamp } = connected({ echoes: false });
    expect(stamp(100, 102, { of_ms: 0, held_ms: 0 })).toBe(true);
  });
});

describe('silence', () => {
  test('is counted from the newest stamp', () => {
    const { path, stamp } = connected();
    stamp(100);
    expect(path.heard_until_ms).toBeCloseTo(102 + kSilent_ms);
  });

  // SAFETY: a page that stood still reads old stamps when it runs again.
  test('stamps that have waited for 5 s prove nothing of now', () => {
    const { path, stamp } = connected();
    stamp(100);
    for (let sent_ms = 200; sent_ms < 3000; sent_ms += 100) stamp(sent_ms, 8000);
    expect(path.stamp_age_ms(8000)).toBeGreaterThan(5000);
    expect(path.heard_until_ms).toBeLessThan(8000);
    stamp(7999, 8001);
    expect(path.stamp_age_ms(8001)).toBeLessThan(1);
  });

  test('clocks that drift apart do not age a stamp', () => {
    const path = new StationPath();
    path.begin({ stamp_us: 0, utc_us: 0, echoes: true }, 0);
    const fast = 1 + 50e-6; // the page's clock
    for (let ms = 100; ms < 3_600_000; ms += 100) path.receive({ stamp_us: ms * 1000 }, ms * fast + 2);
    const now_ms = 3_600_000 * fast;
    expect(path.stamp_age_ms(now_ms)).toBeLessThan(110);
  });
});

describe('what this page sends', () => {
  test('counts as received while echoes are confirmed', () => {
    const { path, stamp } = connected();
    for (let k = 1; k < 20; ++k) {
      const of_ms = 100 * (k - 1);
      stamp(100 * k, 100 * k + (k % 5 === 0 ? 90 : 2), k > 1 ? { of_ms, held_ms: 95 } : undefined);
      expect(path.is_received).toBe(true); // however late a stamp comes down
    }
  });

  // SAFETY: the way up can be dead while stamps still come down.
  test('does not count when stamps come and confirm nothing new', () => {
    const { path, stamp } = connected();
    stamp(100);
    const confirmed = (k: number) => stamp(100 * k, 100 * k + 2, { of_ms: 100, held_ms: 95 + 100 * (k - 2) });
    confirmed(2);
    expect(path.is_received).toBe(true);
    confirmed(3); // 200 ms after the last echo that has come
    expect(path.is_received).toBe(false);
  });

  test('a page that stood still does not answer all that has waited for it', () => {
    const { stamp } = connected();
    let answers = 0;
    for (let sent_ms = 100; sent_ms < 5000; sent_ms += 100) answers += stamp(sent_ms, 5000) ? 1 : 0;
    expect(answers).toBe(1);
  });
});

test('the station’s time is known to within half the round trip', () => {
  const { path, stamp } = connected({ transit_ms: 3 });
  stamp(100);
  stamp(200, 203, { of_ms: 100, held_ms: 94 }); // round trip 6 ms
  expect(path.station_us(303)).toBeCloseTo(5_000_000_000 + 303_000, -1);
  expect(path.station_utc_us(303)).toBeCloseTo(1_764_000_000_000_000 + 303_000, -1);
});

test('of a connection that has ended nothing is left', () => {
  const { path, stamp } = connected();
  stamp(100);
  path.end();
  expect(path.heard_until_ms).toBe(-Infinity);
  expect(path.station_us(200)).toBeNull();
});
