// Strip charts: uPlot dressed as a recorder, with a fixed graticule under traces that run to the left.
//
// A StripChart draws one PlotWindow. ChartDeck runs all charts of a robot in one animation loop, at most 30 times a
// second and not at all while the page is hidden, and holds what they share: running, looked at, or zoomed.

import uPlot from 'uplot';
import { next_range, range_splits } from './range';
import { PlotWindow, type Column, type SampleRing } from './samples';

export interface Trace {
  column: Column;
  colour: string; // name of a CSS variable
  width_px: number;
  dash_px?: number[];
}

// A surface between two columns, drawn below all traces; the range does not follow it.
export interface Band {
  low: Column;
  high: Column;
  colour: string; // name of a CSS variable
}

export interface StripOptions {
  band?: Band;
  traces: Trace[]; // the last one is drawn on top and is the main one
  label: (value: number) => string; // of the graticule, in the unit people read
  fixed_range?: [number, number];
  least_span?: number; // of a range that follows the data
  splits?: number[];
  show_time: boolean;
}

export const kSpan_s = 60;
const kTimeSplits_s = [-60, -50, -40, -30, -20, -10, 0];
const kFrame_ms = 1000 / 30 - 4; // animation frames come each 16.7 ms: every second one is drawn
export const kLook_ms = 4000; // a pointer at rest for this long no longer holds the charts

export class StripChart {
  readonly window: PlotWindow;
  private plot: uPlot;
  private range: [number, number];
  private view_s: [number, number] = [-kSpan_s, 0];
  private readonly observer: ResizeObserver;

  constructor(
    private readonly host: HTMLElement,
    private readonly options: StripOptions,
    capacity: number,
    private readonly on_zoom: (from_s: number, to_s: number) => void,
    private readonly on_cursor: (index: number | null) => void,
  ) {
    const edges = options.band ? [options.band.low, options.band.high] : [];
    this.window = new PlotWindow(capacity, [...edges, ...options.traces.map((trace) => trace.column)], edges.length);
    this.range = options.fixed_range ?? [-(options.least_span ?? 1) / 2, (options.least_span ?? 1) / 2];
    this.plot = this.build();
    this.observer = new ResizeObserver(() => this.fit());
    this.observer.observe(host);
  }

  draw(view_s: [number, number]): void {
    const { window, options } = this;
    this.view_s = view_s;
    if (!options.fixed_range) this.range = next_range(this.range, window.low, window.high, options.least_span ?? 1);
    const data = [window.time_s, ...window.values].map((column) => column.subarray(0, window.size));
    this.plot.batch(() => {
      this.plot.setData(data as unknown as uPlot.AlignedData, false);
      this.plot.setScale('x', { min: view_s[0], max: view_s[1] });
      this.plot.setScale('y', { min: this.range[0], max: this.range[1] });
    });
  }

  // Colours live in the style sheet; a change of theme builds the plot anew.
  restyle(): void {
    this.plot.destroy();
    this.plot = this.build();
  }

  destroy(): void {
    this.observer.disconnect();
    this.plot.destroy();
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width > 0 && height > 0) this.plot.setSize({ width, height });
  }

  private build(): uPlot {
    const style = getComputedStyle(this.host);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const { band, traces, show_time, label } = this.options;
    const font = `11px ${colour('--numerals')}`;
    const grid = { stroke: colour('--graticule'), width: 1 };
    const axis = { stroke: colour('--muted'), font, grid, ticks: { show: false }, border: { show: false } };
    const edges: Trace[] = band ? [band.low, band.high].map((column) => ({ column, colour: '', width_px: 0 })) : [];
    const options: uPlot.Options = {
      width: Math.max(this.host.clientWidth, 50),
      height: Math.max(this.host.clientHeight, 40),
      padding: [8, 18, show_time ? 0 : 8, 0],
      legend: { show: false },
      cursor: {
        sync: { key: 'deck', setSeries: false },
        points: { size: 7, width: 1.5, fill: colour('--plot') },
        y: false,
        drag: { x: true, y: false, setScale: false },
        bind: { dblclick: () => () => null },
      },
      scales: {
        x: { time: false, auto: false, range: () => this.view_s },
        y: { auto: false, range: () => this.range },
      },
      axes: [
        {
          ...axis,
          show: true,
          size: show_time ? 26 : 0,
          gap: 6,
          splits: () => this.time_splits(),
          values: show_time ? (_, at) => at.map(time_label) : () => [],
        },
        {
          ...axis,
          size: 58,
          gap: 8,
          splits: () => this.options.splits ?? range_splits(this.range),
          values: (_, at) => at.map(label),
        },
      ],
      bands: band ? [{ series: [2, 1], fill: colour(band.colour) }] : [],
      series: [
        {},
        ...edges.map((edge, at) => this.series(edge, at, 'transparent')),
        ...traces.map((trace, at) => this.series(trace, at + edges.length, colour(trace.colour))),
      ],
      hooks: {
        setSelect: [(u) => this.selected(u)],
        setCursor: [
          (u) => this.on_cursor(u.cursor.left === undefined || u.cursor.left < 0 ? null : (u.cursor.idx ?? null)),
        ],
        draw: [(u) => this.draw_pen(u, colour('--plot'), colour(traces.at(-1)?.colour ?? '--ink'))],
      },
    };
    return new uPlot(options, [[], ...this.window.names.map(() => [])] as unknown as uPlot.AlignedData, this.host);
  }

  private series(trace: Trace, at: number, stroke: string): uPlot.Series {
    return {
      stroke,
      width: trace.width_px,
      ...(trace.dash_px ? { dash: trace.dash_px } : {}),
      points: { show: false },
      gaps: (u) =>
        (this.window.gaps_s[at] ?? []).map(([from_s, to_s]) => [
          u.valToPos(from_s, 'x', true),
          u.valToPos(to_s, 'x', true),
        ]),
    };
  }

  private time_splits(): number[] {
    const [from, to] = this.view_s;
    return from === -kSpan_s && to === 0 ? kTimeSplits_s : range_splits(this.view_s);
  }

  // The pen: a dot where the main trace ends now.
  private draw_pen(u: uPlot, fill: string, stroke: string): void {
    const last = this.window.size - 1;
    if (last < 0 || this.view_s[1] !== 0) return;
    const time_s = this.window.time_s[last] as number;
    if (time_s < -0.5) return;
    const ratio = devicePixelRatio;
    u.ctx.beginPath();
    u.ctx.arc(
      u.valToPos(time_s, 'x', true),
      u.valToPos(this.window.values.at(-1)?.[last] as number, 'y', true),
      3.5 * ratio,
      0,
      7,
    );
    u.ctx.fillStyle = fill;
    u.ctx.fill();
    u.ctx.lineWidth = 2 * ratio;
    u.ctx.strokeStyle = stroke;
    u.ctx.stroke();
  }

  private selected(u: uPlot): void {
    if (u.select.width < 8) return;
    const from_s = u.posToVal(u.select.left, 'x');
    const to_s = u.posToVal(u.select.left + u.select.width, 'x');
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.on_zoom(from_s, to_s);
  }
}

const time_label = (time_s: number) =>
  Math.abs(time_s) < 1e-6 ? 'now' : `\u2212${Number(Math.abs(time_s).toFixed(2))} s`;

export type DeckState = 'running' | 'looked_at' | 'zoomed';

export class ChartDeck {
  state: DeckState = 'running';
  private readonly charts: StripChart[] = [];
  private view_s: [number, number] = [-kSpan_s, 0];
  private frame = 0;
  private drawn_at_ms = 0;
  private looked_at_ms = 0;

  constructor(
    private ring: SampleRing,
    private readonly on_state: (state: DeckState) => void,
  ) {
    this.frame = requestAnimationFrame(this.tick);
  }

  // on_cursor gets which sample the pointer is at, null when it left.
  add(host: HTMLElement, options: StripOptions, on_cursor: (index: number | null, window: PlotWindow) => void): void {
    const chart: StripChart = new StripChart(
      host,
      options,
      this.ring.capacity,
      (from_s, to_s) => this.zoom(from_s, to_s),
      (index) => on_cursor(index, chart.window),
    );
    this.charts.push(chart);
  }

  show(ring: SampleRing): void {
    this.ring = ring;
    this.run();
  }

  // The pointer moved over a chart: hold still, so that a value can be read.
  look(): void {
    this.looked_at_ms = performance.now();
    if (this.state === 'running') this.enter('looked_at');
  }

  look_away(): void {
    if (this.state === 'looked_at') this.run();
  }

  zoom(from_s: number, to_s: number): void {
    this.view_s = [from_s, to_s];
    this.enter('zoomed');
    for (const chart of this.charts) chart.draw(this.view_s);
  }

  run(): void {
    this.view_s = [-kSpan_s, 0];
    this.enter('running');
  }

  restyle(): void {
    for (const chart of this.charts) {
      chart.restyle();
      chart.draw(this.view_s);
    }
  }

  destroy(): void {
    cancelAnimationFrame(this.frame);
    for (const chart of this.charts) chart.destroy();
  }

  private enter(state: DeckState): void {
    if (state === this.state) return;
    this.state = state;
    this.on_state(state);
  }

  private readonly tick = (now_ms: number): void => {
    this.frame = requestAnimationFrame(this.tick);
    if (now_ms - this.drawn_at_ms < kFrame_ms) return;
    this.drawn_at_ms = now_ms;
    if (this.state === 'looked_at' && now_ms - this.looked_at_ms > kLook_ms) this.run();
    if (this.state !== 'running') return;
    const edge_s = this.ring.edge_s(now_ms / 1000);
    for (const chart of this.charts) {
      chart.window.fill(this.ring, edge_s, kSpan_s);
      chart.draw(this.view_s);
    }
  };
}
