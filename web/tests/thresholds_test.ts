// Thresholds of this browser: what is beyond one is announced until somebody acknowledges it.
import { expect, test } from 'vitest';
import { Alerts, Thresholds, type Channel } from '../src/thresholds';

const kRanges = { estimate_m: { low: -0.1, high: 0.2 } };
const values = (estimate_m: number | null): Record<Channel, number | null> => ({
  estimate_m,
  position_sd_m: 0.5,
  velocity_m_s: 0,
  duty: 0,
  impedance_mv: 175,
  round_trip_us: null,
});
const shelf = (text: string | null = null) => {
  const held = { text, getItem: () => held.text, setItem: (_: string, next: string) => void (held.text = next) };
  return held;
};

function judged() {
  const alerts = new Alerts();
  let now_ms = 0;
  return {
    alerts,
    judge: (value: number | null) => alerts.judge(kRanges, values(value), (now_ms += 100)),
    of: () => alerts.alerts.value[0],
  };
}

test('a value beyond a threshold is announced, with the worst that was seen; one without a threshold never', () => {
  const { alerts, judge, of } = judged();
  judge(0.2);
  expect(of()).toBeUndefined();
  for (const value of [0.21, 0.3, 0.25]) judge(value);
  expect(alerts.alerts.value).toEqual([
    {
      channel: 'estimate_m',
      since_ms: 200,
      worst: 0.3,
      worst_sd_m: 0.5,
      limit: 0.2,
      is_beyond: true,
      is_acknowledged: false,
    },
  ]);
});

test('one that has come back stays announced until it is acknowledged', () => {
  const { alerts, judge, of } = judged();
  judge(-0.2);
  judge(0);
  expect(of()?.is_beyond).toBe(false);
  alerts.acknowledge();
  expect(of()).toBeUndefined();
});

test('acknowledged, what is still beyond stays coloured, ends by itself, and is announced when it comes again', () => {
  const { alerts, judge, of } = judged();
  judge(0.3);
  alerts.acknowledge();
  judge(0.3);
  expect(of()).toMatchObject({ is_beyond: true, is_acknowledged: true });
  judge(0.1);
  expect(of()).toBeUndefined();
  judge(0.3);
  expect(of()).toMatchObject({ is_beyond: true, is_acknowledged: false });
});

test('a value that is not known begins nothing and ends nothing', () => {
  const { judge, of } = judged();
  judge(null);
  expect(of()).toBeUndefined();
  judge(0.3);
  judge(null);
  expect(of()?.is_beyond).toBe(true);
});

test('a threshold that is taken away takes its announcement with it', () => {
  const { alerts, judge } = judged();
  judge(0.3);
  alerts.judge({}, values(0.3), 900);
  expect(alerts.alerts.value).toEqual([]);
});

test('they are kept in the browser, and what cannot be read is as if it were not there', () => {
  const held = shelf();
  new Thresholds(held).set('duty', { low: null, high: 0.8 });
  expect(new Thresholds(held).ranges.value).toEqual({ duty: { low: null, high: 0.8 } });
  new Thresholds(held).set('duty', { low: null, high: null });
  expect(new Thresholds(held).ranges.value).toEqual({});
  for (const broken of ['{', 'null', '{"duty":{"high":"x"}}', '{"none":{"high":1}}'])
    expect(new Thresholds(shelf(broken)).ranges.value).toEqual({});
});

test('a threshold is typed in the unit that is shown; nothing is none, and what is no number is refused', async () => {
  const { parse_threshold } = await import('../src/parts/threshold_list');
  expect(parse_threshold(' 12,5 ', 1e-3)).toBe(0.0125);
  expect(parse_threshold('\u22123', 1e-3)).toBe(-0.003);
  expect(parse_threshold('', 1)).toBeNull();
  for (const text of ['x', '1e3', '1 2', '-']) expect(parse_threshold(text, 1)).toBeUndefined();
});

test('the line says the "±" of a position, which way it went, and no old value as the present', async () => {
  const { sentence } = await import('../src/parts/threshold_list');
  const { judge, of } = judged();
  judge(0.25);
  expect(sentence(of()!, true)).toMatch(
    /^Position, estimated above 200\.0 mm since \d\d:\d\d:\d\d, up to 250\.0 ± 1000\.0$/,
  );
  expect(sentence(of()!, false)).toMatch(
    /^Position, estimated was above 200\.0 mm from \S+ until it was seen last, up/,
  );
  judge(0.1);
  expect(sentence(of()!, false)).toMatch(/ above 200\.0 mm at \S+, up to 250\.0 ± 1000\.0; over now$/);
  const low = judged();
  low.judge(-0.3);
  expect(sentence(low.of()!, true)).toMatch(/ below −100\.0 mm since \S+, down to −300\.0 ± 1000\.0$/);
});

test('the "±" is that of the worst moment', () => {
  const alerts = new Alerts();
  for (const [estimate_m, position_sd_m] of [
    [0.3, 0.001],
    [0.25, 0.02],
  ] as const)
    alerts.judge(kRanges, { ...values(estimate_m), position_sd_m }, 0);
  expect(alerts.alerts.value[0]).toMatchObject({ worst: 0.3, worst_sd_m: 0.001 });
});
