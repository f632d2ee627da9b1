// Overviews as columns of a plot.

import { expect, test } from 'vitest';
import { knot_of, Knots } from '../../src/views/runs/knots';
import { period_us_of, range_of, row_near, traces_of } from '../../src/views/runs/traces';
import { made_overview, made_sample } from './made';

const none = new Knots(10_000);
const known = (...samples: ReturnType<typeof made_sample>[]) => {
  const knots = new Knots(10_000);
  knots.add(samples.map(knot_of));
  return knots;
};

test('a point of several samples is a stroke that continues the trace', () => {
  const overview = made_overview([
    { at_us: 0, samples: 10, min: 0, max: 1 },
    { at_us: 100_000, samples: 10, min: 1.1, max: 3 },
    { at_us: 200_000, samples: 10, min: 1, max: 2.9 },
  ]);
  const { time_s, columns } = traces_of(overview, 0, none);
  expect(time_s).toEqual([0, 0.09, 0.1, 0.19, 0.2, 0.29]);
  expect(columns.duty).toEqual([0, 1, 1.1, 3, 2.9, 1]);
});

test('where nothing is stored the trace has a hole, and the hole is marked', () => {
  const overview = made_overview([
    { at_us: 0, samples: 1, min: 1, max: 1 },
    { at_us: 10_000, samples: 1, min: 2, max: 2 },
    { at_us: 50_000, samples: 1, min: 3, max: 3 },
  ]);
  const { time_s, columns, gaps_s, point_at } = traces_of(overview, 0, none);
  expect(columns.duty).toEqual([1, 2, null, 3]);
  expect(time_s).toEqual([0, 0.01, 0.03, 0.05]);
  expect(gaps_s).toEqual([[0.01, 0.05]]);
  expect(point_at).toEqual([0, 1, -1, 2]);
});

test('samples missing inside of a point are marked as well', () => {
  const overview = made_overview([
    { at_us: 0, samples: 10, min: 0, max: 1 },
    { at_us: 100_000, samples: 10, min: 0, max: 1 },
  ]);
  overview.samples[1] = 5;
  expect(traces_of(overview, 0, none).gaps_s).toEqual([[0.1, 0.19]]);
});

test('the estimate is the position less the disturbance, with its ± around the extremes; not where that is unknown', () => {
  const overview = made_overview([
    { at_us: 0, samples: 10, min: 0.04, max: 0.05 },
    { at_us: 100_000, samples: 10, min: 0.05, max: 0.06 },
  ]);
  const at = { disturbance_m: -0.05, setpoint_m: 0.05, position_sd_m: 0.001 };
  const traces = traces_of(overview, 0, known(made_sample(0, at), made_sample(90_000, at)));
  const rounded = (values: (number | null)[]) =>
    values.map((value) => (value === null ? null : Number(value.toFixed(6))));
  expect(rounded(traces.columns.estimate_m)).toEqual([0.09, 0.1, 0.1, null]);
  expect(rounded(traces.columns.low_m)).toEqual([0.088, 0.088, 0.098, null]);
  expect(rounded(traces.columns.high_m)).toEqual([0.102, 0.102, 0.112, null]);
  expect(traces.columns.setpoint_m).toEqual([0.05, 0.05, 0.05, null]);
});

test('a channel without a value is a hole of that channel alone', () => {
  const overview = made_overview([{ at_us: 0, samples: 1, min: 1, max: 1 }]);
  overview.duty = { min: [null], max: [null] };
  const { columns } = traces_of(overview, 0, none);
  expect([columns.duty, columns.position_m, columns.impedance_mv]).toEqual([[null], [1], [null]]);
});

test('the cursor finds the nearest sample, and none in a gap', () => {
  const overview = made_overview([
    { at_us: 0, samples: 1, min: 1, max: 1 },
    { at_us: 10_000, samples: 1, min: 2, max: 2 },
    { at_us: 1_000_000, samples: 1, min: 3, max: 3 },
  ]);
  const traces = traces_of(overview, 0, none);
  expect(row_near(traces, 0.004)).toBe(0);
  expect(row_near(traces, 0.006)).toBe(1);
  expect(row_near(traces, 0.3)).toBeNull();
  expect(row_near(traces, 5)).toBeNull();
  expect(row_near({ ...traces, time_s: [], point_at: [] }, 0)).toBeNull();
});

test('a range is that of what is looked at', () => {
  const overview = made_overview([
    { at_us: 0, samples: 1, min: -5, max: -5 },
    { at_us: 10_000, samples: 1, min: 2, max: 2 },
    { at_us: 20_000, samples: 1, min: 3, max: 3 },
  ]);
  const traces = traces_of(overview, 0, none);
  expect(range_of(traces, ['duty'], 0.005, 1)).toEqual([2, 3]);
  expect(range_of(traces, ['impedance_mv'], 0, 1)).toBeNull();
  expect(period_us_of(overview)).toBe(10_000);
});
