// Traces that are computed from others: their values, their gaps, and what comes late or again.
import { expect, test } from 'vitest';
import { column_of, DerivedRows, lead_s, name_of, parse_spec, type DerivedSpec } from '../../src/plots/derived';
import { Past } from '../../src/plots/past';
import { channels_of, chosen_strips, kRecorded, look_of_derived, PlotSettings } from '../../src/plots/strips';
import { TraceWindow } from '../../src/plots/trace_window';
import { SampleRing } from '../../src/samples';
import { parse_time } from '../../src/plots/derived_choice';
import { batch, settle } from '../fakes';

const kSlope: DerivedSpec = { kind: 'derivative', of: 'position_m', window_s: 0.2 };
const kSmooth: DerivedSpec = { kind: 'low_pass', of: 'position_m', time_constant_s: 0.5 };
const kError: DerivedSpec = { kind: 'difference', of: 'position_m', less: 'setpoint_m' };
const all = [kSlope, kSmooth, kError];

function rows_of(ring: SampleRing, specs: readonly DerivedSpec[] = all) {
  const rows = new DerivedRows(ring, specs);
  rows.update();
  const value = (spec: DerivedSpec, index: number) => rows.column(column_of(spec))[index % ring.capacity] as number;
  return { rows, value };
}

test('their names say what they are', () => {
  expect(all.map(name_of)).toEqual([
    'd/dt position_m (0.2 s)',
    'low-pass position_m (0.5 s)',
    'position_m \u2212 setpoint_m',
  ]);
});

test('a difference is one less the other, sample by sample', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 10), 1);
  const { value } = rows_of(ring);
  expect(value(kError, 7)).toBeCloseTo(0.007 - 0.1, 12);
});

test('a derivative is the slope over its window, and none within a window after a gap', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 100), 1); // 0.1 m/s
  ring.append(batch(150, 100), 2.5);
  const { value } = rows_of(ring);
  expect(value(kSlope, 19)).toBeNaN();
  expect(value(kSlope, 20)).toBeCloseTo(0.1, 9);
  expect(value(kSlope, 99)).toBeCloseTo(0.1, 9);
  expect(value(kSlope, 150)).toBeNaN();
  expect(value(kSlope, 169)).toBeNaN();
  expect(value(kSlope, 170)).toBeCloseTo(0.1, 9);
});

test('a low pass follows a step with its time constant, and begins anew after a gap', () => {
  const ring = new SampleRing(8192);
  const step = (first: number, size: number, value: number) =>
    batch(first, size, { position_m: Array.from({ length: size }, () => value) });
  ring.append(step(0, 100, 0), 1);
  ring.append(step(100, 51, 1), 1.51);
  ring.append(step(300, 5, 7), 3.05);
  const { value } = rows_of(ring);
  expect(value(kSmooth, 99)).toBe(0);
  expect(value(kSmooth, 149)).toBeCloseTo(1 - Math.exp(-1), 9); // 50 steps of 10 ms after the last 0
  expect(value(kSmooth, 300)).toBe(7);
});

test('computed piece by piece it is the same as at once', () => {
  const at_once = new SampleRing(8192);
  const piecewise = new SampleRing(8192);
  const rows = new DerivedRows(piecewise, all);
  for (let seq = 0; seq < 700; seq += 7) {
    for (const ring of [at_once, piecewise]) ring.append(batch(seq, 7), 1 + seq / 100);
    rows.update();
  }
  const { value } = rows_of(at_once);
  for (const spec of all)
    for (const index of [30, 123, 500, 699])
      expect(rows.column(column_of(spec))[index]).toBeCloseTo(value(spec, index), 12);
});

test('a sample that comes late changes what depends on it, and blocks that were drawn are made anew', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 100), 1);
  ring.append(batch(105, 100), 2.05);
  const { rows, value } = rows_of(ring);
  const { epoch } = rows;
  expect(value(kSlope, 110)).toBeNaN();
  ring.append(batch(100, 5), 2.1);
  rows.update();
  expect(value(kSlope, 110)).toBeCloseTo(0.1, 9);
  expect(rows.epoch).toBeGreaterThan(epoch);
});

test('a ring that grows is computed anew', () => {
  const ring = new SampleRing(1024);
  ring.append(batch(0, 100), 1);
  const { rows, value } = rows_of(ring);
  ring.grow(4096);
  rows.update();
  expect(value(kSlope, 50)).toBeCloseTo(0.1, 9);
});

test('computed traces are drawn like recorded ones, with their extremes', () => {
  const ring = new SampleRing(8192);
  ring.append(batch(0, 4000), 40);
  const rows = new DerivedRows(ring, [kSlope]);
  rows.update();
  const window = new TraceWindow(4096, [column_of(kSlope)]);
  const from_s = ring.time_s[0] as number;
  window.fill({ ring: rows, shift_s: 0, past: null }, { from_s, to_s: from_s + 40 }, 50);
  expect(window.low[0]).toBeCloseTo(0.1, 6);
  expect(window.high[0]).toBeCloseTo(0.1, 6);
});

test('of the past as much is asked for before a stretch as they need to be right in it', async () => {
  expect(lead_s(all)).toBe(4);
  const asked: number[] = [];
  const from_s = 1_000_000_000;
  const row = (utc_s: number) => ({ utc_us: utc_s * 1e6, position_m: utc_s - from_s, setpoint_m: 0, disturbance_m: 0 });
  const past = new Past(
    {
      samples: (from_us, to_us) => {
        asked.push(from_us / 1e6);
        const size = Math.round((to_us - from_us) / 1e4);
        return Promise.resolve(Array.from({ length: size }, (_, i) => row(from_us / 1e6 + i / 100)) as never);
      },
      overview: () => Promise.reject(new Error('no overview')),
      now_s: () => from_s + 1000,
    },
    () => undefined,
  );
  past.derive([kSlope]);
  const look = () => {
    const found: number[] = [];
    past.begin();
    past.visit(from_s, from_s + 10, 0, (tile, at) => found.push(tile.columns[column_of(kSlope)]?.min[at] ?? NaN));
    past.end();
    return found;
  };
  look();
  await settle();
  expect(asked[0]).toBeCloseTo(from_s - 0.2, 6);
  const found = look();
  expect(found).toHaveLength(1000);
  expect(found[0]).toBeCloseTo(1, 4); // right from the first sample on
  past.derive([kSlope, kSmooth]);
  expect(look()).toHaveLength(0); // is asked for anew
});

test('what a browser has kept is read with care', () => {
  expect(parse_spec(kSlope, kRecorded)).toEqual(kSlope);
  expect(parse_spec({ kind: 'derivative', of: 'position_m', window_s: 99 }, kRecorded)).toBeNull();
  expect(parse_spec({ kind: 'difference', of: 'nothing', less: 'duty' }, kRecorded)).toBeNull();
  expect(parse_spec(null, kRecorded)).toBeNull();
});

test('one that is added is shown in a strip of its own, kept, and gone when it is removed', () => {
  const kept = new Map<string, string>();
  const shelf = {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
  };
  const settings = new PlotSettings(shelf);
  expect(settings.add_derived(kSlope)).toBe('');
  expect(settings.add_derived(kSlope)).toContain('is there already');
  expect(settings.add_derived({ kind: 'difference', of: 'duty', less: 'position_m' })).toContain(
    'choose two in one unit',
  );
  expect(settings.add_derived({ kind: 'difference', of: 'duty', less: 'duty' })).toContain('is 0');
  const again = new PlotSettings(shelf).kept.value;
  expect(again.derived).toEqual([kSlope]);
  const strip = chosen_strips(again.traces, again.derived).at(-1)!;
  expect([strip.title, strip.unit]).toEqual(['d/dt position_m (0.2 s)', 'mm/s']);
  expect(strip.label(0.05)).toBe('50.0');
  expect(channels_of(again.derived).at(-1)).toEqual({ column: column_of(kSlope), text: name_of(kSlope) });
  settings.change({ xy: { is_open: true, x: column_of(kSlope), y: 'duty' } });
  settings.remove_derived(kSlope);
  expect(settings.kept.value.derived).toEqual([]);
  expect(settings.kept.value.traces).not.toContain(column_of(kSlope));
  expect(settings.kept.value.xy.x).toBe('estimate_m');
});

test('a derivative of a velocity is an acceleration', () => {
  expect(look_of_derived({ kind: 'derivative', of: 'velocity_m_s', window_s: 0.1 }).unit).toBe('mm/s²');
  expect(look_of_derived({ kind: 'derivative', of: 'impedance_mv', window_s: 0.1 }).unit).toBe('mV/s');
  expect(look_of_derived(kSmooth).unit).toBe('mm');
});

test('a time is a number of seconds, with a point or a comma; else the page says which it may be', () => {
  expect(parse_time('0,2')).toBe(0.2);
  expect(parse_time('5')).toBe(5);
  expect(parse_time('6')).toContain('“6” is no time from 0.02 to 5 s');
  expect(parse_time('soon')).toContain('such as 0.2');
});

test('at least one recorded or computed trace stays', () => {
  const settings = new PlotSettings(null);
  settings.change({ traces: ['duty', 'predicted'] });
  settings.toggle('duty');
  expect(settings.kept.value.traces).toEqual(['duty', 'predicted']);
});
