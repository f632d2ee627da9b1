// How much of the band of ± 2 sd the axis of a position shows, and what is said where it cannot show all of it.
import { beforeEach, expect, test, vi } from 'vitest';
import { StripChart } from '../../src/chart';
import { band_cut_text } from '../../src/format';
import { TraceWindow } from '../../src/plots/trace_window';
import { is_cut, with_band } from '../../src/range';
import { SampleRing } from '../../src/samples';
import { content_of, extents_of, largest_spread_m as largest_of_compared_m } from '../../src/views/runs/compare_plots';
import { RunPlot, type PlotContent, type PlotOptions } from '../../src/views/runs/run_plot';
import { largest_spread_m, type Traces } from '../../src/views/runs/traces';
import { batch as sampled } from '../fakes';

const scales = vi.hoisted(() => ({ y: { min: NaN, max: NaN } }));
vi.mock('uplot', () => ({
  default: class {
    static paths = {};
    batch = (act: () => void) => act();
    setScale = (name: string, scale: { min: number; max: number }) => void (name === 'y' && (scales.y = scale));
    setData = () => undefined;
    destroy = () => undefined;
  },
}));

beforeEach(() => {
  vi.stubGlobal('getComputedStyle', () => ({ getPropertyValue: () => '' }));
  vi.stubGlobal(
    'ResizeObserver',
    class {
      observe = () => undefined;
    },
  );
});

test('a range holds both edges of a band that is not huge', () => {
  expect(with_band([0, 0.1], [-0.03, 0.12], 0.02)).toEqual([-0.03, 0.12]);
  expect(with_band([0, 0.1], [0.02, 0.08], 0.02), 'inside of the traces').toEqual([0, 0.1]);
  expect(with_band([0, 0.1], [Infinity, -Infinity], 0.02), 'without a band').toEqual([0, 0.1]);
});

test('a huge band leaves the traces a fifth of the height, and is cut', () => {
  const range = with_band([0, 0.1], [-1, 1.1], 0.02);
  expect(range[0]).toBeCloseTo(-0.2, 9);
  expect(range[1]).toBeCloseTo(0.3, 9);
  expect([is_cut(range, [-1, 1.1]), is_cut(range, [-0.1, 0.2]), is_cut(range, [0, 0.4])]).toEqual([true, false, true]);
  expect(with_band([0.1, 0.1], [0, 0.2], 0.08), 'of a robot at rest the least span counts').toEqual([0, 0.2]);
});

test('what is said of a band that is cut names its largest reach', () => {
  expect(band_cut_text(0.2604)).toBe('± cut at the edge: up to ± 260 mm');
});

const host = { clientWidth: 600, clientHeight: 200 } as HTMLElement;

// A live plot of positions from 0 to 99 mm, whose standard deviation is `sd_m`.
function live_plot(sd_m: number) {
  const ring = new SampleRing(256);
  ring.append(sampled(0, 100, { position_sd_m: sd_m, setpoint_m: 0.05 }), 1);
  const window = new TraceWindow(512, ['estimate_low_m', 'estimate_high_m', 'estimate_m']);
  window.fill({ ring, shift_s: 0, past: null }, { from_s: 0, to_s: 1.1 }, 400);
  const options = {
    band: { low: 'estimate_low_m' as const, high: 'estimate_high_m' as const, colour: '' },
    traces: [{ column: 'estimate_m' as const, colour: '', width_px: 1 }],
    label: String,
    least_span: 0.08,
  };
  const painters = { under: () => undefined, over: () => undefined };
  const chart = new StripChart(host, options, window, true, painters, () => undefined);
  chart.draw({ from_s: 0, to_s: 1.1 }, true, 0);
  return { chart, window };
}

test('the axis of a live position shows both edges of its band', () => {
  const { chart } = live_plot(0.03);
  expect(scales.y.min).toBeLessThanOrEqual(-0.06);
  expect(scales.y.max).toBeGreaterThanOrEqual(0.159);
  expect(chart.cuts_band).toBe(false);
});

test('a huge band of a live position is cut, and its largest reach is known', () => {
  const { chart, window } = live_plot(0.5);
  expect(scales.y.max - scales.y.min).toBeLessThan(0.75);
  expect(chart.cuts_band).toBe(true);
  expect(window.largest_spread()).toBeCloseTo(1, 9);
});

const options: PlotOptions = {
  group: '',
  label: String,
  least_span: 0.02,
  x_label: String,
  x_splits: () => [],
  shows_x: false,
  on_cursor: () => undefined,
};
const kPlain: PlotContent = { time_s: [], bands: [], traces: [], gaps_s: [], lines: [] };

test('the axis of a recorded position shows both edges of its band, and says when it cannot', () => {
  const plot = new RunPlot(host, options);
  expect(plot.show(kPlain, [0, 1], { traces: [0, 0.1], bands: [-0.05, 0.15] })).toBe(false);
  expect(scales.y.min).toBeLessThanOrEqual(-0.05);
  expect(scales.y.max).toBeGreaterThanOrEqual(0.15);
  expect(plot.show(kPlain, [0, 1], { traces: [0, 0.1], bands: [-1, 1.1] })).toBe(true);
  expect(scales.y.max - scales.y.min).toBeLessThan(0.75);
});

test('the reach of a recorded band is that of the samples, not of the extremes of a point', () => {
  const rows = { time_s: [0, 0.1, 1], columns: { estimate_m: [0, 0.1, 0], low_m: [-0.02, -0.02, -9] } };
  const traces = { ...rows, columns: { ...rows.columns, high_m: [0.12, 0.12, 9] } } as unknown as Traces;
  expect(largest_spread_m(traces, 0, 0.5)).toBeCloseTo(0.02, 9);
});

test('runs that are compared hand in their bands as well', () => {
  const run = { traces: { position_m: [0, 0.1, null] }, position_sd_m: [0.01, 0.03, null] };
  const aligned = { time_s: [0, 1, 2], runs: [run] } as never;
  const content = content_of(aligned, { channel: 'position_m' } as never);
  const { traces, bands } = extents_of(content);
  expect(traces).toEqual([0, 0.1]);
  expect(bands![0]).toBeCloseTo(-0.02, 9);
  expect(bands![1]).toBeCloseTo(0.16, 9);
  expect(largest_of_compared_m(content)).toBeCloseTo(0.06, 9);
});
