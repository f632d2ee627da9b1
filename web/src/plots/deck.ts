// Draws all strips of a robot in one animation loop: each newest sample at least 30 times a second while they run, once
// for each change while they are held, and never while the page is hidden.

import { StripChart, kAxis_px, kRight_px, type Box, type Painters, type StripOptions } from '../chart';
import type { AnyColumn } from '../samples';
import type { DerivedRows } from './derived';
import type { Marks } from './marks';
import type { Past } from './past';
import type { Stretch, TimeAxis } from './time_axis';
import { TraceWindow } from './trace_window';

const kFrame_ms = 1000 / 32; // a little less than a thirtieth of a second, on the average of the frames
const kMostBins = 1000;
const kFewMarks = 24; // more are drawn as ticks alone

export interface DeckSource {
  rows: DerivedRows;
  past: Past | null;
  marks: Marks;
  shift_s(): number; // UTC less the times of the rows
  edge_s(page_ms: number): number; // UTC at the right edge of plots that run
  is_still(): boolean; // the edge stands: what is drawn stays as it is
  zone_s(): number; // the axis' clock less UTC
}

export class Deck {
  readonly window: TraceWindow;
  now_s = 0; // UTC at the right edge of a plot that runs
  frames = 0; // drawn so far
  private readonly charts: StripChart[] = [];
  private frame = 0;
  private due_ms = 0;
  private is_dirty = true;
  private colours: Record<string, string> = {};

  constructor(
    private readonly host: HTMLElement,
    private readonly axis: TimeAxis,
    private readonly source: DeckSource,
    columns: readonly AnyColumn[],
    private readonly on_drawn: () => void,
  ) {
    this.window = new TraceWindow(4 * kMostBins, columns);
    this.read_colours();
    this.now_s = source.edge_s(performance.now());
    this.frame = requestAnimationFrame(this.tick);
  }

  add(host: HTMLElement, options: StripOptions, is_first: boolean, is_last: boolean): void {
    const painters: Painters = {
      under: (context, x, box) => this.paint_under(context, x, box, is_first),
      over: (context, x, box) => this.paint_over(context, x, box, is_first),
    };
    this.charts.push(new StripChart(host, options, this.window, is_last, painters, () => this.mark_dirty()));
  }

  // Whether the strip with that number cuts its band off.
  cuts_band(at: number): boolean {
    return this.charts[at]?.cuts_band ?? false;
  }

  mark_dirty(): void {
    this.is_dirty = true;
  }

  get view(): Stretch {
    return this.axis.view(this.now_s);
  }

  // Where in the plots' width a time is drawn, and what is drawn there, in CSS pixels from the left edge of the strips.
  x_of(at_s: number): number {
    const { from_s, to_s } = this.view;
    return kAxis_px + ((at_s - from_s) / (to_s - from_s)) * this.width_px;
  }
  time_at(x_px: number): number {
    const { from_s, to_s } = this.view;
    return from_s + ((x_px - kAxis_px) / this.width_px) * (to_s - from_s);
  }
  get width_px(): number {
    return Math.max(1, this.host.clientWidth - kAxis_px - kRight_px);
  }

  restyle(): void {
    this.read_colours();
    for (const chart of this.charts) chart.restyle();
    this.mark_dirty();
  }

  destroy(): void {
    cancelAnimationFrame(this.frame);
    for (const chart of this.charts) chart.destroy();
  }

  private readonly tick = (page_ms: number): void => {
    this.frame = requestAnimationFrame(this.tick);
    this.now_s = this.source.edge_s(page_ms);
    const runs = this.axis.is_live && !this.source.is_still();
    if (page_ms < this.due_ms || !(runs || this.is_dirty)) return;
    this.due_ms = Math.max(this.due_ms + kFrame_ms, page_ms - kFrame_ms);
    this.is_dirty = false;
    this.draw();
  };

  private draw(): void {
    const { rows, past } = this.source;
    const view = this.view;
    rows.update();
    past?.begin();
    this.window.fill({ ring: rows, shift_s: this.source.shift_s(), past }, view, Math.min(kMostBins, this.width_px));
    past?.end();
    for (const chart of this.charts) chart.draw(view, this.axis.is_live, this.source.zone_s());
    this.frames += 1;
    this.on_drawn();
  }

  private read_colours(): void {
    const style = getComputedStyle(this.host);
    for (const name of ['muted', 'caution', 'alarm', 'commanded', 'line', 'line-strong', 'ink', 'words', 'plate-high'])
      this.colours[name] = style.getPropertyValue(`--${name}`).trim();
  }

  // Stretches without any sample are hatched; runs are a bar over the first strip.
  private paint_under(
    context: CanvasRenderingContext2D,
    x: (time_s: number) => number,
    box: Box,
    is_first: boolean,
  ): void {
    const ratio = devicePixelRatio;
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    context.strokeStyle = this.colours['line'] ?? '';
    context.lineWidth = ratio;
    for (const [from_s, to_s] of this.window.holes_s) {
      const [left, right] = [Math.max(box.left, x(from_s)), Math.min(box.left + box.width, x(to_s))];
      if (right - left >= 3 * ratio) hatch(context, left, right, box, 7 * ratio);
    }
    if (is_first) this.paint_runs(context, x, box);
    context.restore();
  }

  private paint_runs(context: CanvasRenderingContext2D, x: (time_s: number) => number, box: Box): void {
    const ratio = devicePixelRatio;
    const { from_s, to_s } = this.view;
    context.font = `${10 * ratio}px ${this.colours['words']}`;
    context.textAlign = 'left';
    context.textBaseline = 'alphabetic';
    for (const run of this.source.marks.runs) {
      const end_s = run.to_s ?? this.now_s;
      if (end_s < from_s || run.from_s > to_s) continue;
      const [left, right] = [Math.max(box.left, x(run.from_s)), Math.min(box.left + box.width, x(end_s))];
      context.fillStyle = this.colours['line-strong'] ?? '';
      context.fillRect(left, box.top, Math.max(ratio, right - left), 3 * ratio);
      for (const edge_s of [run.from_s, run.to_s]) {
        if (edge_s !== null && edge_s >= from_s && edge_s <= to_s)
          context.fillRect(x(edge_s), box.top, ratio, box.height);
      }
      if (right - left < 60 * ratio) continue;
      context.fillStyle = this.colours['muted'] ?? '';
      context.fillText(run.text, left + 5 * ratio, box.top + 15 * ratio, right - left - 8 * ratio);
    }
  }

  // Commands magenta, events as loud as in the log, markers with their text.
  private paint_over(
    context: CanvasRenderingContext2D,
    x: (time_s: number) => number,
    box: Box,
    is_first: boolean,
  ): void {
    const ratio = devicePixelRatio;
    const { from_s, to_s } = this.view;
    const marks = this.source.marks.within(from_s, to_s);
    const is_few = marks.length <= kFewMarks;
    context.save();
    context.lineWidth = ratio;
    context.textAlign = 'left';
    context.textBaseline = 'alphabetic';
    for (const { at_s, kind, tone, text } of marks) {
      const loud = tone === 'alarm' || tone === 'caution' || kind === 'marker';
      const name = tone || (kind === 'command' ? 'commanded' : kind === 'marker' ? 'ink' : 'muted');
      const colour = this.colours[name] ?? '';
      const at = Math.round(x(at_s)) + 0.5;
      context.strokeStyle = context.fillStyle = colour;
      if (is_few || loud) {
        context.globalAlpha = loud ? 0.7 : kind === 'command' ? 0.5 : 0.25;
        context.beginPath();
        context.moveTo(at, box.top);
        context.lineTo(at, box.top + box.height);
        context.stroke();
        context.globalAlpha = 1;
      }
      if (!is_first) continue;
      context.fillRect(at - 1.5 * ratio, box.top + box.height - 5 * ratio, 3 * ratio, 5 * ratio);
      if (kind !== 'marker') continue;
      context.font = `${10 * ratio}px ${this.colours['words']}`;
      context.fillText(text, at + 4 * ratio, box.top + box.height - 8 * ratio, 120 * ratio);
    }
    context.restore();
  }
}

function hatch(context: CanvasRenderingContext2D, left: number, right: number, box: Box, step: number): void {
  context.save();
  context.beginPath();
  context.rect(left, box.top, right - left, box.height);
  context.clip();
  context.beginPath();
  const first = Math.floor((left - box.height) / step) * step;
  for (let at = first; at < right; at += step) {
    context.moveTo(at, box.top + box.height);
    context.lineTo(at + box.height, box.top);
  }
  context.stroke();
  context.restore();
}
