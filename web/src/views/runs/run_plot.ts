// One plot of recorded runs: uPlot dressed as the strip charts are, with a window of time that is dragged out.
//
// Plots of one group share cursor and window. A row's gap is a null. Lines across the plot are moments, drawn below traces.

import uPlot from 'uplot';
import { is_cut, kNoExtent, next_range, range_splits, with_band, type Extent } from '../../range';
import type { Values } from './traces';

export interface PlotTrace {
  values: Values;
  colour: string; // name of a CSS variable
  width_px: number;
  dash_px?: number[] | undefined;
  holds?: boolean; // between rows it keeps its value
}

export interface PlotLine {
  at_s: number;
  colour: string;
  dash_px: number[];
  label: string; // '' for none; drawn at the top
}

export interface PlotContent {
  time_s: number[];
  bands: { low: Values; high: Values; colour: string; alpha?: string }[]; // alpha: two hexadecimal digits
  traces: PlotTrace[];
  gaps_s: [number, number][];
  waits_s?: [number, number][]; // where the robot waited at rest, interrupted
  lines: PlotLine[];
}

export interface PlotOptions {
  group: string;
  label: (value: number) => string;
  fixed_range?: [number, number] | undefined;
  splits?: number[] | undefined;
  least_span: number;
  x_label: (value: number, step: number) => string;
  x_splits: (from: number, to: number, width_px: number) => number[];
  shows_x: boolean;
  on_select?: ((from: number, to: number) => void) | undefined;
  on_cursor: (at: number | null) => void;
  on_pick?: ((at: number) => void) | undefined;
}

const kEmpty: PlotContent = { time_s: [], bands: [], traces: [], gaps_s: [], lines: [] };
const kLeastDrag_px = 8;

export class RunPlot {
  private content = kEmpty;
  private view: [number, number] = [0, 1];
  private range: [number, number];
  private plot: uPlot;
  private shape = '';
  private readonly observer: ResizeObserver;

  constructor(
    private readonly host: HTMLElement,
    private options: PlotOptions,
  ) {
    this.range = options.fixed_range ?? [0, options.least_span];
    this.plot = this.build();
    this.observer = new ResizeObserver(() => this.fit());
    this.observer.observe(host);
  }

  // Least and largest value in the view, of the traces and of the bands; null: nothing is there. Whether a band is cut.
  show(
    content: PlotContent,
    view: Extent,
    { traces, bands = null }: { traces: Extent | null; bands?: Extent | null },
    options = this.options,
  ): boolean {
    this.content = content;
    this.view = view;
    this.options = options;
    if (!options.fixed_range && traces) {
      const shown = with_band(traces, bands ?? kNoExtent, options.least_span);
      this.range = next_range([0, 0], ...shown, options.least_span);
    }
    const shape = JSON.stringify([
      content.bands.length,
      content.traces.map(({ colour, dash_px }) => [colour, dash_px]),
    ]);
    if (shape !== this.shape) {
      this.shape = shape;
      this.plot.destroy();
      this.plot = this.build();
    }
    this.fill();
    return bands !== null && is_cut(this.range, bands);
  }

  // Colours live in the style sheet; a change of theme builds the plot anew.
  restyle(): void {
    this.plot.destroy();
    this.plot = this.build();
    this.fill();
  }

  destroy(): void {
    this.observer.disconnect();
    this.plot.destroy();
  }

  private fill(): void {
    const { time_s, bands, traces } = this.content;
    const columns = [...bands.flatMap(({ low, high }) => [low, high]), ...traces.map(({ values }) => values)];
    this.plot.batch(() => {
      this.plot.setData([time_s, ...columns] as uPlot.AlignedData, false);
      this.plot.setScale('x', { min: this.view[0], max: this.view[1] });
      this.plot.setScale('y', { min: this.range[0], max: this.range[1] });
    });
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width > 0 && height > 0) this.plot.setSize({ width, height });
  }

  private build(): uPlot {
    const style = getComputedStyle(this.host);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const { bands, traces } = this.content;
    const grid = { stroke: colour('--graticule'), width: 1 };
    const font = `11px ${colour('--numerals')}`;
    const axis = { stroke: colour('--muted'), font, grid, ticks: { show: false }, border: { show: false } };
    const { stepped } = uPlot.paths;
    const options: uPlot.Options = {
      width: Math.max(this.host.clientWidth, 50),
      height: Math.max(this.host.clientHeight, 40),
      padding: [8, 18, this.options.shows_x ? 0 : 8, 0],
      legend: { show: false },
      cursor: {
        sync: { key: this.options.group, setSeries: false },
        points: { size: 7, width: 1.5, fill: colour('--plot') },
        y: false,
        drag: { x: this.options.on_select !== undefined, y: false, setScale: false },
        bind: { dblclick: () => () => null },
      },
      scales: {
        x: { time: false, auto: false, range: () => this.view },
        y: { auto: false, range: () => this.range },
      },
      axes: [
        {
          ...axis,
          size: this.options.shows_x ? 26 : 0,
          gap: 6,
          splits: (u) => this.options.x_splits(this.view[0], this.view[1], u.width),
          values: (_, at) => this.x_labels(at),
        },
        {
          ...axis,
          size: 58,
          gap: 8,
          splits: () => this.options.splits ?? range_splits(this.range),
          values: (_, at) => at.map((value) => this.options.label(value)),
        },
      ],
      bands: bands.map((band, at) => ({
        series: [2 * at + 2, 2 * at + 1],
        fill: colour(band.colour) + (band.alpha ?? ''),
      })),
      series: [
        {},
        ...bands.flatMap(() => [hidden, hidden]),
        ...traces.map((trace): uPlot.Series => ({
          stroke: colour(trace.colour),
          width: trace.width_px,
          ...(trace.dash_px ? { dash: trace.dash_px } : {}),
          ...(trace.holds && stepped ? { paths: stepped({ align: 1 }) } : {}),
          points: { show: false },
        })),
      ],
      hooks: {
        setSelect: [(u) => this.selected(u)],
        setCursor: [(u) => this.options.on_cursor(cursor_at(u))],
        drawClear: [
          (u) => {
            this.shade(u, this.content.waits_s ?? [], colour('--wait'));
            this.shade(u, this.content.gaps_s, colour('--gap'));
          },
        ],
        drawAxes: [(u) => this.draw_lines(u, colour, font)],
        ready: [(u) => this.listen(u)],
      },
    };
    const columns = Array.from({ length: 2 * bands.length + traces.length }, () => []);
    return new uPlot(options, [[], ...columns] as unknown as uPlot.AlignedData, this.host);
  }

  private x_labels(at: number[]): string[] {
    if (!this.options.shows_x) return [];
    const step = at.length > 1 ? (at[1] as number) - (at[0] as number) : this.view[1] - this.view[0];
    return at.map((value) => this.options.x_label(value, step));
  }

  private selected(u: uPlot): void {
    if (u.select.width < kLeastDrag_px) return;
    const from = u.posToVal(u.select.left, 'x');
    const to = u.posToVal(u.select.left + u.select.width, 'x');
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.options.on_select?.(from, to);
  }

  // A click that is no drag picks a moment.
  private listen(u: uPlot): void {
    u.over.addEventListener('click', () => {
      const at = cursor_at(u);
      if (at !== null && u.select.width < kLeastDrag_px) this.options.on_pick?.(at);
    });
  }

  private shade(u: uPlot, stretches: [number, number][], fill: string): void {
    const { ctx, bbox } = u;
    ctx.fillStyle = fill;
    for (const [from, to] of stretches) {
      if (to < this.view[0] || from > this.view[1]) continue;
      const left = Math.max(bbox.left, u.valToPos(from, 'x', true));
      const right = Math.min(bbox.left + bbox.width, u.valToPos(to, 'x', true));
      ctx.fillRect(left, bbox.top, Math.max(2, right - left), bbox.height);
    }
  }

  private draw_lines(u: uPlot, colour: (name: string) => string, font: string): void {
    const { ctx, bbox } = u;
    const ratio = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = ratio;
    ctx.textAlign = 'left';
    ctx.textBaseline = 'alphabetic';
    ctx.font = font.replace('11px', `${11 * ratio}px`);
    let free_from = -Infinity; // labels do not lie on each other
    for (const line of this.content.lines) {
      if (line.at_s < this.view[0] || line.at_s > this.view[1]) continue;
      const x = Math.round(u.valToPos(line.at_s, 'x', true)) + ratio / 2;
      ctx.strokeStyle = ctx.fillStyle = colour(line.colour);
      ctx.setLineDash(line.dash_px.map((length) => length * ratio));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      if (!line.label || x < free_from) continue;
      ctx.fillText(line.label, x + 4 * ratio, bbox.top + 12 * ratio);
      free_from = x + ctx.measureText(line.label).width + 12 * ratio;
    }
    ctx.restore();
  }
}

const hidden: uPlot.Series = { stroke: 'transparent', width: 0, points: { show: false } };

const cursor_at = (u: uPlot): number | null =>
  u.cursor.left === undefined || u.cursor.left < 0 ? null : u.posToVal(u.cursor.left, 'x');
