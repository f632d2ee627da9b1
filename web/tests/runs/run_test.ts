// One run in words: what happened in it, how complete it is, what the cursor reads.

import { expect, test } from 'vitest';
import type { EventRecord } from '../../src/api';
import { knot_of, Knots } from '../../src/views/runs/knots';
import { interrupted_stretches, interruptions_text, moments_of } from '../../src/views/runs/moments';
import { completeness_text } from '../../src/views/runs/record';
import type { Certificate, ImpedanceMap, Marker, Step } from '../../src/views/runs/runs_api';
import { columns_of } from '../../src/views/runs/impedance';
import { cursor_text, kStrips } from '../../src/views/runs/strips';
import { traces_of } from '../../src/views/runs/traces';
import { made_overview, made_run, made_sample } from './made';

const knots = new Knots(10_000);
knots.add([knot_of(made_sample(1_000_000, { robot_time_us: 0 }))]);
const event = (said: Partial<EventRecord>) =>
  ({
    robot_id: 'sim-1',
    boot_id: '7',
    event_seq: 1,
    sample_seq: 10,
    robot_time_us: 100_000,
    cause: 'none',
    ...said,
  }) as EventRecord;
const certificate = (said: Partial<Certificate>) =>
  ({
    samples_expected: 4207,
    samples_lost: 0,
    samples_missing: 0,
    lost_by_cause: {},
    longest_gap_samples: 0,
    missed_ticks: 0,
    longest_missed_ticks: 0,
    ...said,
  }) as Certificate;

test('markers, commands and events of a run are in order, at their own times; others are left out', () => {
  const marker = { marker_id: 1, utc_us: 1_050_000, text: 'light on', actor: 'user:anna' } as Marker;
  const events = [
    event({ kind: 'setpoint_changed', value: 0.1, event_seq: 2 }),
    event({ kind: 'emergency', cause: 'operator', event_seq: 3, robot_time_us: 200_000 }),
    event({ kind: 'detection', sample_seq: 100, event_seq: 4 }), // after the run
    event({ kind: 'detection', boot_id: '8', event_seq: 5 }),
    event({ kind: 'control_taken', event_seq: null }),
  ];
  const found = moments_of(made_run(), [marker], events, [], [1_000_000], knots);
  expect(found.map(({ utc_us, kind, text }) => [utc_us, kind, text])).toEqual([
    [1_050_000, 'marker', 'light on'],
    [1_100_000, 'command', 'setpoint 100 mm'],
    [1_200_000, 'alarm', 'emergency stop (operator)'],
  ]);
});

test('of a run whose events are out of reach, the steps say what was commanded', () => {
  const step = { span: 0, first_seq: 5, at_s: 2, cause: 'setpoint', target_m: 0.1 } as Step;
  const found = moments_of(made_run(), [], [], [step], [1_000_000], knots);
  expect(found).toMatchObject([{ utc_us: 3_000_000, kind: 'command', text: 'setpoint 100 mm' }]);
  const known = moments_of(
    made_run(),
    [],
    [event({ kind: 'setpoint_changed', value: 0.1 })],
    [step],
    [1_000_000],
    knots,
  );
  expect(known.length).toBe(1);
});

test('where the robot waited at rest is shaded, listed, and said with its length', () => {
  const interrupted = [
    { span: 0, from_robot_time_us: 500_000, to_robot_time_us: 7_000_000, reason: 'link_lost', detail: '' },
    { span: 0, from_robot_time_us: 9_000_000, to_robot_time_us: 9_500_000, reason: 'requested', detail: '' },
  ];
  const run = { ...made_run(), interrupted };
  expect(interrupted_stretches(run, 1_000_000, knots)).toEqual([
    [0.5, 7],
    [9, 9.5],
  ]);
  expect(interrupted_stretches(run, 1_000_000, new Knots(10_000))).toEqual([]);
  expect(moments_of(run, [], [], [], [1_000_000], knots).map(({ utc_us, text }) => [utc_us, text])).toEqual([
    [1_500_000, 'interrupted for 6.5 s (link lost)'],
    [10_000_000, 'interrupted for 0.5 s (requested)'],
  ]);
  expect(interruptions_text(run)).toMatch(/^Interrupted 2 times, 7.0 s in all: the robot waited at rest/);
  expect(interruptions_text(made_run())).toBe('');
});

test('"nothing lost" is said only when nothing is lost and nothing is missing', () => {
  const text = (said: Partial<Certificate>) => completeness_text(made_run(), certificate(said));
  expect(text({})).toEqual({ tone: 'good', text: 'Recorded, nothing lost: all 4\u202f207 samples.' });
  expect(text({ samples_lost: 12, lost_by_cause: { ring_overrun: 12 }, longest_gap_samples: 7 })).toEqual({
    tone: 'caution',
    text: '12 of 4\u202f207 samples are lost (12 ring overrun); the longest gap has 7.',
  });
  expect(text({ samples_expected: 3803, missed_ticks: 264, longest_missed_ticks: 30 })).toEqual({
    tone: '',
    text: 'Recorded, nothing lost: all 3\u202f803 samples. Missed by the robot: 264 ticks, at most 30 in a row.',
  });
  expect(text({ samples_lost: 1, lost_by_cause: { reboot: 1 }, missed_ticks: 2, longest_missed_ticks: 1 }).text).toBe(
    '1 of 4\u202f207 samples are lost (1 reboot). Missed by the robot: 2 ticks, at most 1 in a row.',
  );
  expect(text({ missed_ticks: null, longest_missed_ticks: null }).tone).toBe('');
  expect(text({ samples_missing: 3 }).text).toBe('3 are still missing: the robot may send them yet.');
  expect(completeness_text(made_run({ state: 'discarded' }), certificate({})).tone).toBe('caution');
  expect(completeness_text(made_run(), null).text).not.toContain('nothing lost');
});

test('the cursor says one value of a sample, both extremes of a point, and that there is none', () => {
  const strip = kStrips[1] as (typeof kStrips)[number]; // duty
  const overview = made_overview([
    { at_us: 0, samples: 1, min: 0.5, max: 0.5 },
    { at_us: 10_000, samples: 10, min: -0.5, max: 1 },
  ]);
  const traces = traces_of(overview, 0, new Knots(10_000));
  expect(cursor_text(strip, traces, 0)).toBe('50.0 %');
  expect(cursor_text(strip, traces, 0.05)).toBe('−50.0 to 100.0 %');
  expect(cursor_text(strip, traces, 5)).toBe('no samples');
  expect(cursor_text(strip, traces, null)).toBe('');
});

test('a position whose disturbance is not known is said to be what the controller sees', () => {
  const position = kStrips[0] as (typeof kStrips)[number];
  const overview = made_overview([{ at_us: 0, samples: 1, min: 0.05, max: 0.05 }]);
  expect(cursor_text(position, traces_of(overview, 0, new Knots(10_000)), 0)).toBe(
    '50.0, as the controller sees it, mm',
  );
  const known = new Knots(10_000);
  known.add([knot_of(made_sample(0, { disturbance_m: -0.02, setpoint_m: 0.05, position_sd_m: 0.002 }))]);
  expect(cursor_text(position, traces_of(overview, 0, known), 0)).toBe('70.0 ± 4.0, setpoint 50.0 mm');
});

test('an impedance map has both directions on one axis, and holes where a direction was not', () => {
  const bins = (from_m: number[], mean_mv: number[]) => ({ from_m, mean_mv, sd_mv: mean_mv.map(() => 2) });
  const map = { bin_m: 0.005, forward: bins([0, 0.005, 0.015], [175, 180, 185]), backward: bins([0.015], [190]) };
  const columns = columns_of(map as unknown as ImpedanceMap);
  expect(columns.position_m.map((each) => Number(each.toFixed(4)))).toEqual([0.0025, 0.0075, 0.0125, 0.0175]);
  expect(columns.mean.forward).toEqual([175, 180, null, 185]);
  expect(columns.mean.backward).toEqual([null, null, null, 190]);
  expect(columns.high.backward).toEqual([null, null, null, 194]);
});
