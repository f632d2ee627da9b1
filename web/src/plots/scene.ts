// All that lives as long as the plots of one source do: what is drawn, where the cursor is and what stands there.
//
// A source is a robot that is looked at, or a run that is replayed; each has a scene of its own on top of this one.

import { signal, type Signal } from '@preact/signals';
import { kAxis_px } from '../chart';
import { band_cut_text, kSpread_sd, plus_minus } from '../format';
import type { SampleRows } from '../samples';
import type { LogLine } from '../store';
import { Deck } from './deck';
import { DerivedRows, type DerivedSpec } from './derived';
import { Marks } from './marks';
import type { Past } from './past';
import type { PlotState } from './plot_bar';
import { PlotHand, type HandWays } from './plot_hand';
import { predicted_at, PredictedBackdrop } from './predictions';
import { columns_of, has_band, type PlotSettings, type Strip } from './strips';
import { clock_label, type Stretch, type TimeAxis } from './time_axis';
import type { TraceWindow } from './trace_window';

const kCursor_ms = 100; // between two texts of the cursor while the plots run
const kReach_px = 6; // of a mark

export const zone_at = (utc_s: number, is_utc: boolean) =>
  is_utc ? 0 : -60 * new Date(utc_s * 1000).getTimezoneOffset();

export interface SceneSource {
  rows: SampleRows;
  past: Past;
  shift_s(): number; // UTC less the times of the rows
  edge_s(page_ms: number): number;
  is_still(): boolean;
  known?(line: LogLine): LogLine; // see Marks; absent: what is known now
}

export abstract class Scene {
  readonly note = signal('');
  readonly texts = new Map<string, Signal<string>>(); // of the cursor, by strip
  readonly cuts = new Map<string, Signal<string>>(); // what is said of a band that is cut, by strip
  readonly has_predicted = signal(false); // in what is shown
  readonly marks: Marks;
  readonly predictions = new PredictedBackdrop();
  readonly drawn = new Set<() => void>(); // called after each drawing
  readonly state: Signal<PlotState>;
  readonly hand: PlotHand;
  line: HTMLElement | null = null; // the cursor's
  protected deck: Deck | null = null;
  private strips: Strip[] = [];
  private cursor_px: number | null = null;
  private told_at_ms = 0;
  rows: DerivedRows;

  constructor(
    readonly source: SceneSource,
    readonly axis: TimeAxis,
    readonly settings: PlotSettings,
    ways: (scene: Scene) => Pick<HandWays, 'pan' | 'zoom' | 'run'>,
  ) {
    this.state = signal({ is_live: true, span_s: axis.span_s, range: '' });
    this.rows = new DerivedRows(source.rows, []);
    this.marks = new Marks(source.known);
    this.hand = new PlotHand({
      ...ways(this),
      point: (at_px) => this.point(at_px),
      middle_px: () => kAxis_px + this.width_px() / 2,
      width_px: () => this.width_px(),
    });
  }

  get now_s(): number {
    return this.deck?.now_s ?? this.source.edge_s(performance.now());
  }
  get view(): Stretch {
    return this.axis.view(this.now_s);
  }
  time_at(at_px: number): number {
    return this.deck?.time_at(at_px) ?? 0;
  }
  readonly width_px = () => this.deck?.width_px ?? 1;
  readonly zone_s = () => zone_at(this.view.to_s, this.settings.kept.peek().is_utc);

  build(host: HTMLElement, strips: Strip[], derived: readonly DerivedSpec[]): () => void {
    const { source } = this;
    this.strips = strips;
    this.rows = new DerivedRows(source.rows, derived);
    source.past.derive(derived);
    const { marks, zone_s, rows } = this;
    const deck = new Deck(host, this.axis, { ...source, rows, marks, zone_s }, columns_of(strips), () =>
      this.on_drawn(),
    );
    const style = getComputedStyle(host);
    const read_colours = () => {
      const [line = '', band = ''] = ['--predicted', '--predicted-spread'].map((name) => style.getPropertyValue(name));
      this.predictions.colours = { line: line.trim(), band: band.trim() };
    };
    read_colours();
    const hosts = host.querySelectorAll<HTMLElement>('.strip > .plot');
    strips.forEach((strip, at) => {
      const band = has_band(strip)
        ? { low: 'estimate_low_m' as const, high: 'estimate_high_m' as const, colour: '--spread' }
        : undefined;
      const options = {
        ...strip,
        ...(band ? { band } : {}),
        ...(strip.has_predicted ? { backdrop: this.predictions } : {}),
      };
      deck.add(hosts[at] as HTMLElement, options, at === 0, at === strips.length - 1);
    });
    this.deck = deck;
    const theme = matchMedia('(prefers-color-scheme: light)');
    const restyle = () => {
      read_colours();
      deck.restyle();
    };
    theme.addEventListener('change', restyle);
    void document.fonts.ready.then(restyle); // numerals are drawn on the canvas, so the charts wait for their font
    return () => {
      theme.removeEventListener('change', restyle);
      deck.destroy();
      this.deck = null;
    };
  }

  redraw(): void {
    this.show_state();
    this.mark_dirty();
  }
  mark_dirty(): void {
    this.deck?.mark_dirty();
  }

  close(): void {
    this.source.past.close();
  }

  abstract show_state(): void;

  private on_drawn(): void {
    this.place_line();
    this.note_cuts();
    for (const told of this.drawn) told();
    const now_ms = performance.now();
    if (now_ms - this.told_at_ms < kCursor_ms) return;
    this.told_at_ms = now_ms;
    this.tell();
  }

  private note_cuts(): void {
    const { deck, strips, cuts } = this;
    strips.forEach((strip, at) => {
      const text = cuts.get(strip.name);
      if (text) text.value = deck?.cuts_band(at) ? band_cut_text(deck.window.largest_spread()) : '';
    });
  }

  private point(at_px: number | null): void {
    this.cursor_px = at_px === null || at_px < kAxis_px || at_px > kAxis_px + this.width_px() ? null : at_px;
    this.place_line();
    this.tell();
  }

  private place_line(): void {
    if (!this.line) return;
    this.line.hidden = this.cursor_px === null;
    this.line.style.transform = `translateX(${this.cursor_px ?? 0}px)`;
  }

  protected tell(): void {
    const { deck, cursor_px } = this;
    const at_s = deck && cursor_px !== null ? deck.time_at(cursor_px) : null;
    const row = deck && at_s !== null ? deck.window.row_at(at_s) : null;
    const time = at_s === null ? '' : clock_label(at_s, this.axis.span_s > 7200 ? 1 : 0.01, this.zone_s());
    this.has_predicted.value = this.predictions.within(this.view).length > 0;
    this.strips.forEach((strip, at) => {
      const text = this.texts.get(strip.name);
      if (!text) return;
      const value = at_s === null || !deck ? '' : cursor_text(strip, deck.window, row, at === 0 ? time : '');
      text.value = value === '' || at_s === null || !strip.has_predicted ? value : value + this.predicted_text(at_s);
    });
    const reach_s = (kReach_px / this.width_px()) * this.axis.span_s;
    const mark = at_s === null ? null : this.marks.near(at_s, reach_s);
    this.note.value = mark ? `${clock_label(mark.at_s, 0.01, this.zone_s())} ${mark.text}` : this.quiet_note();
  }

  private predicted_text(at_s: number): string {
    const predicted = predicted_at(this.predictions.predictions, at_s);
    if (!predicted) return '';
    const spread = predicted.sd_m === null ? '' : ` ${plus_minus(predicted.sd_m)}`;
    return `, predicted ${(this.strips[0] as Strip).value(predicted.m)}${spread}`;
  }

  // What is said where no mark is under the cursor.
  protected quiet_note(): string {
    const { past } = this.source;
    if (past.problem) return `The past is not complete: ${past.problem}`;
    return past.is_loading ? 'Asking the station …' : '';
  }
}

function cursor_text(strip: Strip, window: TraceWindow, row: number | null, time: string): string {
  const when = time && `at ${time}`;
  if (row === null) return ['no sample', when].filter(Boolean).join(' ');
  const of = (name: string) => {
    const trace = strip.traces.find((each) => each.name === name);
    return trace ? window.value_at(trace.column, row) : null;
  };
  if (strip.name !== 'position') return `${strip.value(of(strip.name))} ${strip.unit}`;
  const [estimate_m, seen_m, setpoint_m] = [of('position'), of('seen'), of('setpoint')];
  const spread_m = window.spread_at(row);
  const spread = estimate_m === null || spread_m === null ? '' : ` ${plus_minus(spread_m / kSpread_sd)}`;
  if (estimate_m === null && seen_m === null) return `\u2013 ${when}`;
  const seen = seen_m === null || seen_m === estimate_m ? '' : `seen ${strip.value(seen_m)}`;
  const estimate = estimate_m === null ? '' : `${strip.value(estimate_m)}${spread}`;
  const place = estimate && seen ? `${estimate}, ${seen},` : estimate || seen;
  return `${place} mm ${when}${setpoint_m === null ? '' : `, setpoint ${strip.value(setpoint_m)}`}`;
}
