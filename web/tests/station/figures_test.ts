// Times, pace and Prometheus' text as the view of the station reads them.

import { expect, test } from 'vitest';
import type { Recording } from '../../src/api';
import { Metrics } from '../../src/views/station/metrics';
import { ago_text, backup_name, exact_text, moment_text, span_text } from '../../src/views/station/moments';
import { bytes_per_day, full_in_s, is_within_disk, PaceMeter } from '../../src/views/station/pace';
import { backup_problem } from '../../src/views/station/station_api';

const kAt_us = Date.UTC(2026, 10, 26, 5, 50, 35) * 1000 + 496_012;

test('a moment to the minute, to the second, and exactly', () => {
  expect(moment_text(kAt_us, true)).toBe('2026-11-26 05:50');
  expect(moment_text(kAt_us, true, true)).toBe('2026-11-26 05:50:35');
  expect(exact_text(kAt_us)).toBe('2026-11-26 05:50:35.496012 UTC');
});

test('local time is that of the machine at that moment', () => {
  const local = new Date(kAt_us / 1000);
  expect(moment_text(kAt_us, false).slice(11)).toBe(
    `${String(local.getHours()).padStart(2, '0')}:${String(local.getMinutes()).padStart(2, '0')}`,
  );
});

test('a span is one short word', () => {
  const spans: [number, string][] = [
    [-1, '0 s'],
    [59.9, '59 s'],
    [60, '1 min'],
    [3600, '1 h'],
    [47 * 3600, '47 h'],
    [64.9 * 86_400, '64 days'],
    [4 * 365 * 86_400, '4 years'],
    [1e12, 'more than 1000 years'],
  ];
  for (const [time_s, text] of spans) expect(span_text(time_s)).toBe(text);
  expect(ago_text(kAt_us, kAt_us / 1000 + 30_000)).toBe('just now');
  expect(ago_text(kAt_us, kAt_us / 1000 + 200_000)).toBe('3 min ago');
});

test('a backup without a name gets one that sorts by time and that the station takes', () => {
  expect(backup_name(kAt_us / 1000)).toBe('2026-11-26-055035Z');
  expect(backup_problem(backup_name(kAt_us / 1000))).toBe('');
});

test('the pace is counted by the station, over at most the last minute', () => {
  const meter = new PaceMeter();
  meter.note(0, { samples_written: 0, commits: 0 });
  expect(meter.pace()).toBeNull();
  meter.note(3, { samples_written: 600, commits: 6 });
  expect(meter.pace()).toBeNull(); // too short to be a pace
  meter.note(10, { samples_written: 2000, commits: 20 });
  expect(meter.pace()).toEqual({ samples_per_s: 200, commits: 20, over_s: 10 });
  for (let at_s = 15; at_s <= 100; at_s += 5) meter.note(at_s, { samples_written: 2000, commits: 20 });
  expect(meter.pace()).toMatchObject({ samples_per_s: 0, commits: 0 });
  meter.note(105, { samples_written: 10, commits: 1 }); // the station was started again
  expect(meter.pace()).toBeNull();
});

test('until the disk is full', () => {
  const pace = { samples_per_s: 200, commits: 1, over_s: 10 };
  expect(bytes_per_day(pace)).toBe(200 * 66 * 86_400);
  expect(full_in_s(pace, 200 * 66 * 50)).toBeCloseTo(50);
  expect(full_in_s({ ...pace, samples_per_s: 0 }, 1e9)).toBeNull();
});

test('a limit keeps the disk from filling only where it fits on the disk and can be kept', () => {
  const recording = (max_database_bytes: number, all_held = false) =>
    ({ retention: { max_database_bytes, all_held }, database_bytes: 300, free_bytes: 700 }) as Recording;
  expect(is_within_disk(recording(1000))).toBe(true);
  expect(is_within_disk(recording(1001))).toBe(false);
  expect(is_within_disk(recording(1000, true))).toBe(false); // runs hold all that is left
  expect(is_within_disk(recording(200))).toBe(true); // it shrinks
  expect(is_within_disk(recording(0))).toBe(false); // no limit
});

const kText = `# HELP rheonaut_exceptions_total What ended by a fault.
# TYPE rheonaut_exceptions_total counter
rheonaut_exceptions_total{where="request"} 2
rheonaut_exceptions_total{where="model"} 1
rheonaut_free_bytes 7.4e+10
rheonaut_stop_bucket{stage="acknowledged",le="0.001"} 97
rheonaut_stop_bucket{stage="acknowledged",le="0.005"} 99
rheonaut_stop_bucket{stage="acknowledged",le="+Inf"} 100
rheonaut_stop_bucket{stage="sent",le="0.001"} 100
rheonaut_stop_count{stage="acknowledged"} 100
rheonaut_stop_count{stage="sent"} 0
not a figure`;

test('figures, their sums, and the bound that a share of a histogram lies within', () => {
  const metrics = new Metrics(kText);
  expect(metrics.value('rheonaut_free_bytes')).toBe(7.4e10);
  expect(metrics.value('rheonaut_exceptions_total', 'where="model"')).toBe(1);
  expect(metrics.value('rheonaut_nothing')).toBeNull();
  expect(metrics.sum('rheonaut_exceptions_total')).toBe(3);
  expect(metrics.sum('rheonaut_nothing')).toBeNull();
  expect(metrics.within('rheonaut_stop', 'stage="acknowledged"', 0.99)).toEqual({ count: 100, bound_s: 0.005 });
  expect(metrics.within('rheonaut_stop', 'stage="acknowledged"', 0.999)).toEqual({ count: 100, bound_s: null });
  expect(metrics.within('rheonaut_stop', 'stage="sent"', 0.99)).toEqual({ count: 0, bound_s: null });
});
