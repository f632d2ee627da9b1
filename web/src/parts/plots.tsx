// The strip charts of a robot on one time axis: what arrives now, and before it what the station has recorded.
//
// A stretch that is held stands in the address (`from`, `to`), so that a link shows the same.

import { signal, useSignal, type Signal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { kAxis_px } from '../chart';
import { plus_minus } from '../format';
import { Deck } from '../plots/deck';
import { Marks } from '../plots/marks';
import { Past } from '../plots/past';
import { PlotBar, type PlotState } from '../plots/plot_bar';
import { PlotHand } from '../plots/plot_hand';
import { chosen_strips, columns_of, has_band, plot_settings, type Strip } from '../plots/strips';
import { clock_label, day_label, stretch_of, TimeAxis } from '../plots/time_axis';
import type { TraceWindow } from '../plots/trace_window';
import type { Robot } from '../robot';
import { change_query, route } from '../route';
import type { Session } from '../session';
import { ThresholdList } from './threshold_list';

const kRingSamples = 65_536; // ten minutes at 100 Hz
const kSamplesOfTile = 2000;
const kCursor_ms = 100; // between two texts of the cursor while the plots run
const kAddress_ms = 250; // after the last change of the stretch
const kMarksAgain_ms = 20_000;
const kReach_px = 6; // of a mark

const zone_at = (utc_s: number, is_utc: boolean) => (is_utc ? 0 : -60 * new Date(utc_s * 1000).getTimezoneOffset());

// All that lives as long as the plots of one robot do.
class Scene {
  readonly state: Signal<PlotState>;
  readonly note = signal('');
  readonly texts = new Map<string, Signal<string>>(); // of the cursor, by strip
  readonly axis: TimeAxis;
  readonly past: Past;
  readonly marks = new Marks();
  readonly hand: PlotHand;
  line: HTMLElement | null = null; // the cursor's
  private deck: Deck | null = null;
  private strips: Strip[] = [];
  private cursor_px: number | null = null;
  private told_at_ms = 0;
  private timer = 0;

  constructor(
    private readonly session: Session,
    private readonly robot: Robot,
  ) {
    robot.ring.grow(kRingSamples);
    this.axis = new TimeAxis(plot_settings.kept.peek().span_s, () => this.on_axis());
    this.state = signal({ is_live: true, span_s: this.axis.span_s, range: '' });
    const { api } = session;
    const { robot_id } = robot;
    this.past = new Past(
      {
        samples: (from_us, to_us) => api.robot_samples(robot_id, from_us, to_us, kSamplesOfTile),
        overview: (from_us, to_us, points) => api.robot_overview(robot_id, from_us, to_us, points),
        now_s: () => Date.now() / 1000,
      },
      () => this.deck?.mark_dirty(),
    );
    this.hand = new PlotHand({
      pan: (by_px) => this.axis.pan((-by_px / this.width_px()) * this.axis.span_s, this.now_s),
      zoom: (factor, at_px) => this.axis.zoom(factor, this.deck?.time_at(at_px) ?? 0, this.now_s),
      point: (at_px) => this.point(at_px),
      run: () => this.run(),
      middle_px: () => kAxis_px + this.width_px() / 2,
      width_px: () => this.width_px(),
    });
  }

  get now_s(): number {
    return this.deck?.now_s ?? Date.now() / 1000;
  }
  private readonly width_px = () => this.deck?.width_px ?? 1;
  private readonly zone_s = () => zone_at(this.axis.view(this.now_s).to_s, plot_settings.kept.peek().is_utc);

  build(host: HTMLElement, strips: Strip[]): () => void {
    const { robot, session } = this;
    this.strips = strips;
    const page_utc_s = () => (Date.now() - performance.now()) / 1000;
    const source = {
      ring: robot.ring,
      past: this.past,
      marks: this.marks,
      shift_s: () => robot.utc_shift_s(session.store.utc_minus_steady_us, page_utc_s()),
      zone_s: this.zone_s,
    };
    const deck = new Deck(host, this.axis, source, columns_of(strips), () => this.on_drawn());
    const hosts = host.querySelectorAll<HTMLElement>('.plot');
    strips.forEach((strip, at) => {
      const band = { low: 'estimate_low_m', high: 'estimate_high_m', colour: '--spread' } as const;
      deck.add(
        hosts[at] as HTMLElement,
        has_band(strip) ? { ...strip, band } : strip,
        at === 0,
        at === strips.length - 1,
      );
    });
    this.deck = deck;
    const theme = matchMedia('(prefers-color-scheme: light)');
    const restyle = () => deck.restyle();
    theme.addEventListener('change', restyle);
    void document.fonts.ready.then(restyle); // numerals are drawn on the canvas, so the charts wait for their font
    return () => {
      theme.removeEventListener('change', restyle);
      deck.destroy();
      this.deck = null;
    };
  }

  follow(query: Record<string, string>): void {
    const asked = stretch_of(query);
    const now = this.axis.address();
    if (asked && (now?.from !== query['from'] || now?.to !== query['to'])) this.axis.hold(asked.from_s, asked.to_s);
    else if (!asked && now && !this.timer) this.run();
  }

  run(): void {
    if (!this.axis.is_live) this.axis.span_s = plot_settings.kept.peek().span_s;
    this.axis.run();
  }

  choose_span(span_s: number): void {
    plot_settings.change({ span_s });
    this.axis.choose_span(span_s, this.now_s);
  }

  redraw(): void {
    this.show_state();
    this.deck?.mark_dirty();
  }

  async load_marks(): Promise<void> {
    const { api } = this.session;
    const { robot_id } = this.robot;
    const [events, commands, runs] = await Promise.all([
      api.robot_events(robot_id),
      api.robot_commands(robot_id),
      api.robot_runs(robot_id),
    ]);
    this.marks.take_events(events);
    this.marks.take_commands(commands);
    this.marks.set_runs(runs);
    for (let after = 0, full = true; full;) {
      const markers = await api.robot_markers(robot_id, after);
      this.marks.take_markers(markers);
      after = markers.at(-1)?.marker_id ?? after;
      full = markers.length === 1000;
    }
    this.deck?.mark_dirty();
  }

  close(): void {
    this.past.close();
    clearTimeout(this.timer);
  }

  private on_axis(): void {
    this.show_state();
    this.deck?.mark_dirty();
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      change_query(this.axis.address() ?? { from: '', to: '' });
    }, kAddress_ms);
  }

  private show_state(): void {
    const { is_live, span_s } = this.axis;
    const { from_s, to_s } = this.axis.view(this.now_s);
    const zone_s = this.zone_s();
    const time = (at_s: number) => clock_label(at_s, span_s < 20 ? 0.01 : 1, zone_s);
    const range = is_live ? '' : `${day_label(from_s, zone_s)}, ${time(from_s)} \u2013 ${time(to_s)}`;
    this.state.value = { is_live, span_s, range };
  }

  private on_drawn(): void {
    this.place_line();
    const now_ms = performance.now();
    if (now_ms - this.told_at_ms < kCursor_ms) return;
    this.told_at_ms = now_ms;
    this.tell();
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

  private tell(): void {
    const { deck, cursor_px, past } = this;
    const at_s = deck && cursor_px !== null ? deck.time_at(cursor_px) : null;
    const row = deck && at_s !== null ? deck.window.row_at(at_s) : null;
    const time = at_s === null ? '' : clock_label(at_s, this.axis.span_s > 7200 ? 1 : 0.01, this.zone_s());
    this.strips.forEach((strip, at) => {
      const text = this.texts.get(strip.name);
      if (text) text.value = at_s === null || !deck ? '' : cursor_text(strip, deck.window, row, at === 0 ? time : '');
    });
    const reach_s = (kReach_px / this.width_px()) * this.axis.span_s;
    const mark = at_s === null ? null : this.marks.near(at_s, reach_s);
    this.note.value = mark
      ? `${clock_label(mark.at_s, 0.01, this.zone_s())} ${mark.text}`
      : past.problem
        ? `The past is not complete: ${past.problem}`
        : past.is_loading
          ? 'Asking the station …'
          : '';
  }
}

export function Plots({ session, robot }: { session: Session; robot: Robot }) {
  const scene = useMemo(() => new Scene(session, robot), [robot]);
  const host = useRef<HTMLDivElement>(null);
  const is_dragging = useSignal(false);
  const { traces, is_utc } = plot_settings.kept.value;
  const strips = useMemo(() => chosen_strips(traces), [traces]);
  const phase = session.phase.value;
  const query = route.value.query;

  useEffect(() => () => scene.close(), [scene]);
  useEffect(() => scene.build(host.current as HTMLDivElement, strips), [scene, strips]);
  useEffect(() => scene.follow(query), [scene, query['from'], query['to']]);
  useEffect(() => scene.redraw(), [scene, is_utc]);
  const log = session.store.log.value;
  useEffect(() => {
    scene.marks.take_log(log, robot.robot_id);
    scene.redraw();
  }, [scene, log]);
  const runs = session.store.runs.value;
  useEffect(() => {
    const load = () => phase === 'live' && void scene.load_marks().catch(() => undefined);
    load();
    const timer = setInterval(load, kMarksAgain_ms);
    return () => clearInterval(timer);
  }, [scene, phase, runs]);
  useEffect(() => {
    const strips_host = host.current as HTMLDivElement;
    const wheel = (event: WheelEvent) => {
      if (event.ctrlKey && event.deltaY === 0) return;
      event.preventDefault(); // which a passive listener may not
      scene.hand.wheel(event, x_in(event, strips_host));
    };
    strips_host.addEventListener('wheel', wheel, { passive: false });
    return () => strips_host.removeEventListener('wheel', wheel);
  }, [scene]);

  const up = (event: PointerEvent) => {
    scene.hand.up(event.pointerId);
    is_dragging.value = false;
  };
  return (
    <section class={`plots ${scene.state.value.is_live ? 'running' : 'held'}`} aria-label="Plots">
      <PlotBar
        state={scene.state}
        note={scene.note}
        settings={plot_settings}
        on_live={() => scene.run()}
        on_span={(span_s) => scene.choose_span(span_s)}
      >
        <ThresholdList />
      </PlotBar>
      <div
        class={`strips ${is_dragging.value ? 'dragging' : ''}`}
        ref={host}
        tabIndex={0}
        role="group"
        aria-label="Time axis: arrow keys move, plus and minus zoom, End goes back to live"
        onPointerDown={(event) => {
          if (event.button !== 0) return;
          event.currentTarget.setPointerCapture(event.pointerId);
          scene.hand.down(event.pointerId, x_in(event, event.currentTarget));
        }}
        onPointerMove={(event) => {
          scene.hand.move(event.pointerId, x_in(event, event.currentTarget));
          is_dragging.value = scene.hand.is_dragging;
        }}
        onPointerUp={up}
        onPointerCancel={up}
        onPointerLeave={() => scene.hand.leave()}
        onKeyDown={(event) => scene.hand.key(event) && event.preventDefault()}
      >
        {strips.map((strip, at) => (
          <StripFigure key={strip.name} strip={strip} at={at} is_last={at === strips.length - 1} scene={scene} />
        ))}
        <div class="cursor-line" hidden ref={(line) => void (scene.line = line)} />
      </div>
    </section>
  );
}

const x_in = (event: MouseEvent, host: Element) => event.clientX - host.getBoundingClientRect().left;

function StripFigure({ strip, at, is_last, scene }: { strip: Strip; at: number; is_last: boolean; scene: Scene }) {
  const text = useSignal('');
  scene.texts.set(strip.name, text);
  const keys = strip.traces.length > 1 || strip.name === 'position' ? [...strip.traces].reverse() : [];
  return (
    <figure class={`strip strip-${at} of-${strip.name} ${strip.is_large ? 'large' : ''} ${is_last ? 'last' : ''}`}>
      <figcaption>
        <b>{strip.title}</b> <span class="unit">{strip.unit}</span>
        <span class="key">
          {keys.map((key) => (
            <span key={key.name} class={`swatch ${key.swatch}`}>
              {key.text}
            </span>
          ))}
        </span>
        <output class="cursor">{text}</output>
      </figcaption>
      <div class="plot" />
    </figure>
  );
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
  const high_m = window.value_at('estimate_high_m', row);
  const spread = estimate_m === null || high_m === null ? '' : ` ${plus_minus((high_m - estimate_m) / 2)}`;
  if (estimate_m === null && seen_m === null) return `\u2013 ${when}`;
  const seen = seen_m === null || seen_m === estimate_m ? '' : `seen ${strip.value(seen_m)}`;
  const estimate = estimate_m === null ? '' : `${strip.value(estimate_m)}${spread}`;
  const place = estimate && seen ? `${estimate}, ${seen},` : estimate || seen;
  return `${place} mm ${when}${setpoint_m === null ? '' : `, setpoint ${strip.value(setpoint_m)}`}`;
}
