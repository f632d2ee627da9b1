// A strip chart, dressed as a recorder: a graticule under traces that run to the left.
//
// uPlot draws the axes. The traces are columns of a TraceWindow, which all strips of a robot share, and are drawn by
// plots/trace_painter.ts; what is drawn under and over them (gaps, runs, marks) is handed in. When it draws, and what
// stretch, is the deck's (plots/deck.ts).

import uPlot from 'uplot';
import { paint_band, paint_trace, type Pen, type Plane } from './plots/trace_painter';
import type { TraceWindow } from './plots/trace_window';
import { clock_label, clock_splits, type Stretch } from './plots/time_axis';
import { is_cut, kNoExtent, next_range, range_splits, with_band, type Extent } from './range';
import type { AnyColumn } from './samples';

export interface Trace {
  column: AnyColumn;
  colour: string; // name of a CSS variable
  width_px: number;
  dash_px?: number[];
}

// A surface between two columns, drawn below all traces; the range follows it as far as the traces stay readable.
export interface Band {
  low: AnyColumn;
  high: AnyColumn;
  colour: string; // name of a CSS variable
}

export interface StripOptions {
  band?: Band;
  traces: Trace[]; // the last one is drawn on top and is the main one
  label: (value: number) => string; // of the graticule, in the unit people read
  fixed_range?: [number, number];
  least_span?: number; // of a range that follows the data
  splits?: number[];
  is_large?: boolean;
  backdrop?: Backdrop;
}

// What is drawn below the traces on a time grid of its own, and how far it reaches.
export interface Backdrop {
  range(view: Stretch): [number, number] | null;
  paint(context: CanvasRenderingContext2D, plane: Plane, view: Stretch): void;
}

export interface Painters {
  under(context: CanvasRenderingContext2D, x_of: (time_s: number) => number, box: Box): void;
  over(context: CanvasRenderingContext2D, x_of: (time_s: number) => number, box: Box): void;
}
export type Box = { left: number; top: number; width: number; height: number };

export const kAxis_px = 58;
export const kRight_px = 18;
const kLabel_px = 110; // room that a clock time takes

export class StripChart {
  private plot: uPlot;
  private range: Extent;
  cuts_band = false; // in the range that was drawn last
  private view: Stretch = { from_s: 0, to_s: 1 };
  private is_live = true;
  private zone_s = 0;
  private readonly at: number[]; // of each series, its column in the window
  private readonly edges: number; // of the band
  private readonly observer: ResizeObserver;

  constructor(
    private readonly host: HTMLElement,
    private readonly options: StripOptions,
    private readonly window: TraceWindow,
    private readonly show_time: boolean,
    private readonly painters: Painters,
    on_size: () => void,
  ) {
    const { band, traces } = options;
    const edges = band ? [band.low, band.high] : [];
    this.edges = edges.length;
    this.at = [...edges, ...traces.map(({ column }) => column)].map((column) => window.names.indexOf(column));
    this.range = options.fixed_range ?? [-(options.least_span ?? 1) / 2, (options.least_span ?? 1) / 2];
    this.plot = this.build();
    this.observer = new ResizeObserver(() => {
      this.fit();
      on_size();
    });
    this.observer.observe(host);
  }

  draw(view: Stretch, is_live: boolean, zone_s: number): void {
    const { window, options } = this;
    Object.assign(this, { view, is_live, zone_s });
    if (!options.fixed_range) {
      const extent = (columns: number[], more: Extent = kNoExtent): Extent => [
        Math.min(more[0], ...columns.map((c) => window.low[c] as number)),
        Math.max(more[1], ...columns.map((c) => window.high[c] as number)),
      ];
      const least_span = options.least_span ?? 1;
      const band = extent(this.at.slice(0, this.edges));
      const traces = extent(this.at.slice(this.edges), options.backdrop?.range(view) ?? kNoExtent);
      this.range = next_range(this.range, ...with_band(traces, band, least_span), least_span);
      this.cuts_band = is_cut(this.range, band);
    }
    this.plot.batch(() => {
      this.plot.setScale('x', { min: view.from_s, max: view.to_s });
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
    const { band, traces, label } = this.options;
    const font = `11px ${colour('--numerals')}`;
    const grid = { stroke: colour('--graticule'), width: 1 };
    const axis = { stroke: colour('--muted'), font, grid, ticks: { show: false }, border: { show: false } };
    const pens = traces.map((trace) => ({ ...trace, colour: colour(trace.colour) }));
    const options: uPlot.Options = {
      width: Math.max(this.host.clientWidth, 50),
      height: Math.max(this.host.clientHeight, 40),
      padding: [8, kRight_px, this.show_time ? 0 : 8, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, auto: false, range: () => [this.view.from_s, this.view.to_s] },
        y: { auto: false, range: () => this.range },
      },
      axes: [
        {
          ...axis,
          show: true,
          size: this.show_time ? 26 : 0,
          gap: 6,
          splits: () => this.time_splits().at_s,
          values: this.show_time ? (_, at) => this.time_labels(at) : () => [],
        },
        {
          ...axis,
          size: kAxis_px,
          gap: 8,
          splits: () => this.options.splits ?? range_splits(this.range),
          values: (_, at) => at.map(label),
        },
      ],
      series: [{}],
      hooks: {
        drawAxes: [(u) => this.painters.under(u.ctx, x_of(u), u.bbox)],
        draw: [
          (u) => this.draw_traces(u, band ? colour(band.colour) : '', pens),
          (u) => this.painters.over(u.ctx, x_of(u), u.bbox),
          (u) => this.draw_pen(u, colour('--plot'), pens.at(-1)?.colour ?? ''),
        ],
      },
    };
    return new uPlot(options, [[]], this.host);
  }

  private draw_traces(u: uPlot, spread: string, pens: Pen[]): void {
    const { window, view, range, edges } = this;
    const { ctx: context, bbox: box } = u;
    const [per_s, per_unit] = [box.width / (view.to_s - view.from_s), box.height / (range[1] - range[0])];
    const plane: Plane = {
      box,
      x_of: (time_s) => box.left + (time_s - view.from_s) * per_s,
      y_of: (value) => box.top + (range[1] - value) * per_unit,
      ratio: devicePixelRatio,
    };
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    this.options.backdrop?.paint(context, plane, view);
    if (edges > 0) paint_band(context, window, this.at[0] as number, this.at[1] as number, plane, spread);
    pens.forEach((pen, at) => paint_trace(context, window, this.at[at + edges] as number, plane, pen));
    context.restore();
  }

  private time_splits(): { at_s: number[]; step_s: number } {
    const most = Math.max(2, Math.floor((this.host.clientWidth - kAxis_px - kRight_px) / kLabel_px));
    return clock_splits(this.view, most, this.zone_s);
  }

  private time_labels(at: number[]): string[] {
    const { step_s } = this.time_splits();
    return at.map((time_s) => clock_label(time_s, step_s, this.zone_s));
  }

  // The pen: a dot where the main trace ends now.
  private draw_pen(u: uPlot, fill: string, stroke: string): void {
    const last = this.window.size - 1;
    if (last < 0 || !this.is_live) return;
    const time_s = this.window.time_s[last] as number;
    const value = this.window.value_at(this.options.traces.at(-1)?.column as AnyColumn, last);
    if (time_s < this.view.to_s - 0.5 || value === null) return;
    const ratio = devicePixelRatio;
    u.ctx.save(); // uPlot remembers what it has set, and sets nothing twice
    u.ctx.beginPath();
    u.ctx.arc(u.valToPos(time_s, 'x', true), u.valToPos(value, 'y', true), 3.5 * ratio, 0, 7);
    u.ctx.fillStyle = fill;
    u.ctx.fill();
    u.ctx.lineWidth = 2 * ratio;
    u.ctx.strokeStyle = stroke;
    u.ctx.stroke();
    u.ctx.restore();
  }
}

const x_of = (u: uPlot) => (time_s: number) => u.valToPos(time_s, 'x', true);
