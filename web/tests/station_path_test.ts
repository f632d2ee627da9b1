// The way to the station: how old its stamps are, how long the round trip is, and what proves that it receives.
import { describe, expect, test } from 'vitest';
import { kSilent_ms, kUnanswered_ms, StationPath } from '../src/station_path';

// A station whose stamps are on their way for `transit_ms`.
function connected({ transit_ms = 2 } = {}) {
  const path = new StationPath();
  const start_us = 5_000_000_000;
  path.begin({ stamp_us: start_us, utc_us: 1_764_000_000_000_000 }, 0);
  // A stamp that was sent at sent_ms, arrives at `at_ms`.
  const stamp = (sent_ms: number, at_ms = sent_ms + transit_ms) => {
    const stamp_us = start_us + sent_ms * 1000;
    const answer = path.receive({ stamp_us }, at_ms);
    if (answer) path.echoed(stamp_us, at_ms);
    return answer;
  };
  const echo = (of_ms: number, at_ms: number) => path.receive_echo(start_us + of_ms * 1000, at_ms);
  return { path, stamp, echo };
}

describe('the round trip', () => {
  test('is from an echo to its return', () => {
    const { path, stamp, echo } = connected();
    expect(path.round_trip_ms).toBeNull();
    stamp(100);
    echo(100, 107);
    expect(path.round_trip_ms).toBe(5);
  });

  test('shown is the middle one of the latest, so that one delay does not shake it', () => {
    const { path, stamp, echo } = connected();
    for (let k = 1; k < 20; k += 2) {
      stamp(100 * k);
      echo(100 * k, 100 * k + (k === 9 ? 80 : 7));
    }
    expect(path.round_trip_ms).toBe(5);
  });

  test('every second stamp is echoed', () => {
    const { stamp } = connected();
    expect([100, 200, 300, 400, 500].map((ms) => stamp(ms))).toEqual([true, false, true, false, true]);
  });

  test('an echo that nobody sent counts for nothing', () => {
    const { path, echo } = connected();
    echo(100, 200);
    expect(path.round_trip_ms).toBeNull();
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
    path.begin({ stamp_us: 0, utc_us: 0 }, 0);
    const fast = 1 + 50e-6; // the page's clock
    for (let ms = 100; ms < 3_600_000; ms += 100) path.receive({ stamp_us: ms * 1000 }, ms * fast + 2);
    const now_ms = 3_600_000 * fast;
    expect(path.stamp_age_ms(now_ms)).toBeLessThan(110);
  });
});

describe('what this page sends', () => {
  test('counts as received while its echoes come back', () => {
    const { path, stamp, echo } = connected();
    for (let k = 1; k < 40; ++k) {
      if (!stamp(100 * k)) continue;
      expect(path.received_until_ms).toBeGreaterThan(100 * k + 50);
      echo(100 * k, 100 * k + 6);
      expect(path.received_until_ms).toBe(Infinity);
    }
  });

  // SAFETY: the way up can be dead while stamps still come down.
  test('does not count when stamps come and echoes do not', () => {
    const { path, stamp, echo } = connected();
    stamp(100);
    echo(100, 106);
    for (let k = 2; k < 6; ++k) stamp(100 * k);
    expect(path.received_until_ms).toBe(302 + kUnanswered_ms + 2 * 4); // of the oldest that is not back
    expect(path.heard_until_ms).toBeGreaterThan(700);
  });

  test('a slow network is given its usual time, within bounds', () => {
    const { path, stamp, echo } = connected();
    stamp(100);
    echo(100, 402);
    stamp(500);
    expect(path.received_until_ms).toBe(502 + kUnanswered_ms + 600);
    echo(500, 9000);
    echo(500, 9000);
    stamp(9100);
    echo(9100, 99_000);
    stamp(99_100);
    expect(path.received_until_ms).toBeLessThanOrEqual(99_102 + kUnanswered_ms + 1000);
  });

  test('a page that stood still does not answer all that has waited for it', () => {
    const { stamp } = connected();
    let answers = 0;
    for (let sent_ms = 100; sent_ms < 5000; sent_ms += 100) answers += stamp(sent_ms, 5000) ? 1 : 0;
    expect(answers).toBe(1);
  });
});

test('the station’s time is known to within half the round trip', () => {
  const { path, stamp, echo } = connected({ transit_ms: 3 });
  stamp(100);
  echo(100, 109); // round trip 6 ms
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

describe("the station's time in UTC", () => {
  test('is known from the welcome on, whatever the clock of this computer says, and after the connection is lost', () => {
    const { path, stamp } = connected();
    expect(path.utc_s(50)).toBeCloseTo(1_764_000_000.05, 3);
    stamp(100);
    expect(path.utc_s(1000)).toBeCloseTo(1_764_000_000.998, 3);
    path.end();
    expect(path.utc_s(2000)).toBeCloseTo(1_764_000_001.998, 3);
  });

  test('is that of this computer before the first connection', () => {
    expect(Math.abs(new StationPath().utc_s(123) - Date.now() / 1000)).toBeLessThan(1);
  });
});
