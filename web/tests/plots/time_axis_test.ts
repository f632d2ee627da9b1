// One time axis: it runs, is held, moved and zoomed, and stands in the address.
import { expect, test } from 'vitest';
import { clock_label, clock_splits, day_label, kLeastSpan_s, stretch_of, TimeAxis } from '../../src/plots/time_axis';

const kNow_s = 1_795_000_000;

test('while it runs, its right edge is now', () => {
  const axis = new TimeAxis(60);
  expect(axis.view(kNow_s)).toEqual({ from_s: kNow_s - 60, to_s: kNow_s });
  expect(axis.view(kNow_s + 5).to_s).toBe(kNow_s + 5);
  expect(axis.address()).toBeNull();
});

test('moved into the past it stays there, and moved past the newest sample it runs again', () => {
  const axis = new TimeAxis(60);
  axis.pan(-30, kNow_s);
  expect(axis.view(kNow_s + 100)).toEqual({ from_s: kNow_s - 90, to_s: kNow_s - 30 });
  axis.pan(20, kNow_s);
  expect(axis.is_live).toBe(false);
  axis.pan(20, kNow_s);
  expect(axis.is_live).toBe(true);
});

test('zooming keeps what is under the pointer, and the newest sample while it runs', () => {
  const axis = new TimeAxis(60);
  axis.zoom(0.5, kNow_s - 30, kNow_s);
  expect(axis.is_live).toBe(true);
  expect(axis.view(kNow_s)).toEqual({ from_s: kNow_s - 30, to_s: kNow_s });
  axis.pan(-100, kNow_s); // shows −130 … −100
  axis.zoom(0.5, kNow_s - 120, kNow_s);
  expect(axis.view(kNow_s)).toEqual({ from_s: kNow_s - 125, to_s: kNow_s - 110 });
});

test('it never shows less than it can', () => {
  const axis = new TimeAxis(60);
  axis.zoom(1e-9, kNow_s, kNow_s);
  expect(axis.span_s).toBe(kLeastSpan_s);
});

test('what is held stands in the address, and an address leads to the same', () => {
  const axis = new TimeAxis(60);
  axis.pan(-30, kNow_s);
  const address = axis.address()!;
  expect(address).toEqual({ from: String((kNow_s - 90) * 1000), to: String((kNow_s - 30) * 1000) });
  const asked = stretch_of(address)!;
  const other = new TimeAxis(600);
  other.hold(asked.from_s, asked.to_s);
  expect(other.view(kNow_s)).toEqual(axis.view(kNow_s));
});

test('an address that names no stretch is none', () => {
  const typed = [{}, { from: '5' }, { from: '9', to: '5' }, { from: 'x', to: '5' }, { from: '1e3', to: '5000' }];
  for (const query of typed) expect(stretch_of(query)).toBeNull();
});

test('splits are round times of the clock that is shown', () => {
  const midnight_s = Date.UTC(2026, 10, 26) / 1000;
  const day = { from_s: midnight_s - 3600, to_s: midnight_s + 7200 };
  const utc = clock_splits(day, 4, 0);
  expect(utc.step_s).toBe(3600);
  expect(utc.at_s.map((at) => clock_label(at, utc.step_s, 0))).toEqual(['23:00', '26 Nov', '01:00', '02:00']);
  const half = clock_splits({ from_s: midnight_s, to_s: midnight_s + 7200 }, 2, 5.5 * 3600); // half an hour off
  expect(half.at_s.map((at) => clock_label(at, half.step_s, 5.5 * 3600))).toEqual(['06:00', '07:00']);
});

test('a label is as fine as its step', () => {
  const at_s = Date.UTC(2026, 10, 26, 14, 5, 30, 250) / 1000;
  expect([0.01, 0.2, 1, 60].map((step_s) => clock_label(at_s, step_s, 0))).toEqual([
    '14:05:30.25',
    '14:05:30.2',
    '14:05:30',
    '14:05',
  ]);
  expect(day_label(at_s, 12 * 3600)).toBe('27 Nov 2026');
});
