// The plots of a run on one axis of time: dragging over one shows that stretch in all, finer.

import { signal, type Signal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { band_cut_text, clock_time, count } from '../../format';
import { go_to, type Route } from '../../route';
import type { Window } from './runs_api';
import type { RunPage } from './run_page';
import { RunPlot, type PlotOptions } from './run_plot';
import { content_of, cursor_text, kStrips, lines_of } from './strips';
import { clock_label, since_text, time_of_day_s, time_splits, time_step_s } from './time_axis';
import { largest_spread_m, range_of } from './traces';
import { inside, moved, parse_window, window_query, zoomed } from './windows';

const kPixelsOfALabel = 96;

export function RunPlots({ page, route }: { page: RunPage; route: Route }) {
  const hosts = useRef<(HTMLDivElement | null)[]>([]);
  const plots = useRef<RunPlot[]>([]);
  const cursors = useRef(kStrips.map(() => signal(''))).current;
  const cursor_time = useRef(signal('')).current;
  const cut = useRef(signal('')).current; // what is said of a band that is cut
  const is_clock = route.query['time'] === 'clock';
  const bounds = page.bounds;
  const window = parse_window(route.query);
  const shown = window ?? bounds;
  const view: [number, number] = shown
    ? [(shown.from_us - page.origin_us) / 1e6, (shown.to_us - page.origin_us) / 1e6]
    : [0, 1];

  const show = (next: Window | null) => go_to({ ...route, query: { ...route.query, ...window_query(next) } });
  const show_seconds = (from_s: number, to_s: number) => {
    if (!bounds) return;
    const [from_us, to_us] = [from_s, to_s].map((time_s) => page.origin_us + time_s * 1e6) as [number, number];
    show(inside({ from_us, to_us }, bounds));
  };
  const cursor_s = useRef<number | null>(null);
  const write_cursor = (at_s: number | null) => {
    cursor_s.current = at_s;
    const traces = page.traces.peek();
    kStrips.forEach(
      (strip, at) => ((cursors[at] as Signal<string>).value = traces ? cursor_text(strip, traces, at_s) : ''),
    );
    cursor_time.value =
      at_s === null ? '' : `${since_text(at_s)} · ${clock_time(Math.round(page.origin_us / 1000 + at_s * 1000))}`;
  };
  const latest = useRef({ show_seconds, write_cursor, is_clock });
  latest.current = { show_seconds, write_cursor, is_clock };

  const options_of = (at: number): PlotOptions => {
    const { label, fixed_range, splits, least_span } = kStrips[at] as (typeof kStrips)[number];
    return {
      group: 'run',
      label,
      fixed_range,
      splits,
      least_span,
      shows_x: at === 0 || at === kStrips.length - 1,
      x_splits: (from, to, width_px) => {
        const step_s = time_step_s(to - from, Math.max(2, width_px / kPixelsOfALabel));
        return time_splits(from, to, step_s, latest.current.is_clock ? time_of_day_s(page.origin_us / 1000) : 0);
      },
      x_label: (at_s, step_s) =>
        latest.current.is_clock ? clock_label(page.origin_us / 1000 + at_s * 1000, step_s) : since_text(at_s),
      on_select: (from_s, to_s) => latest.current.show_seconds(from_s, to_s),
      on_cursor: (at_s) => latest.current.write_cursor(at_s),
      on_pick: (at_s) => (page.picked_s.value = at_s),
    };
  };
  useEffect(() => {
    plots.current = kStrips.map((_, at) => new RunPlot(hosts.current[at] as HTMLDivElement, options_of(at)));
    const restyle = () => plots.current.forEach((plot) => plot.restyle());
    const theme = matchMedia('(prefers-color-scheme: light)');
    theme.addEventListener('change', restyle);
    void document.fonts.ready.then(restyle); // numerals are drawn on the canvas
    return () => {
      theme.removeEventListener('change', restyle);
      plots.current.forEach((plot) => plot.destroy());
      plots.current = [];
    };
  }, [page]);
  const traces = page.traces.value;
  const moments = page.moments.value;
  const waits_s = page.waits_s.value;
  const picked_s = page.picked_s.value;
  useEffect(() => {
    if (!traces) return;
    plots.current.forEach((plot, at) => {
      const strip = kStrips[at] as (typeof kStrips)[number];
      const columns = strip.traces.map((trace) => trace.column);
      const lines = lines_of(moments, page.origin_us, picked_s, at === 0);
      const extents = {
        traces: range_of(traces, columns, ...view),
        bands: strip.has_band ? range_of(traces, ['low_m', 'high_m'], ...view) : null,
      };
      const is_cut = plot.show(content_of(strip, traces, lines, waits_s), view, extents, options_of(at));
      if (strip.has_band) cut.value = is_cut ? band_cut_text(largest_spread_m(traces, ...view)) : '';
    });
    write_cursor(cursor_s.current); // of the values that are drawn now
  }, [traces, moments, waits_s, picked_s, is_clock, view[0], view[1]]);
  useEffect(() => {
    const width_px = hosts.current[0]?.clientWidth ?? 1000;
    void page.look(window, Math.min(2000, Math.max(300, width_px)));
  }, [page, window?.from_us, window?.to_us]);

  const on_key = (event: KeyboardEvent) => {
    if (!bounds || !shown || event.ctrlKey || event.metaKey || event.altKey || event.target !== event.currentTarget)
      return;
    const next = {
      ArrowLeft: () => moved(shown, -0.25, bounds),
      ArrowRight: () => moved(shown, 0.25, bounds),
      '+': () => zoomed(shown, 0.5, bounds),
      '-': () => zoomed(shown, 2, bounds),
      Home: () => null,
    }[event.key];
    if (!next) return;
    event.preventDefault();
    show(next());
  };
  return (
    <section class="run-plots" aria-label="Plots">
      <Toolbar
        page={page}
        shown={shown}
        is_whole={window === null}
        is_clock={is_clock}
        cursor_time={cursor_time}
        on_show={show}
        on_time={(time) => go_to({ ...route, query: { ...route.query, time } }, true)}
      />
      <div
        class="run-strips"
        tabIndex={0}
        role="group"
        aria-label="Plots over time: arrow keys move, plus and minus zoom, Home shows the whole run"
        onKeyDown={on_key}
      >
        {kStrips.map(({ name, title, unit }, at) => (
          <figure class={`strip ${name}`} key={name}>
            <figcaption>
              <b>{title}</b> <span class="unit">{unit}</span>
              {name === 'position' && <PositionKey />}
              {name === 'position' && <span class="band-cut">{cut}</span>}
              <output class="cursor">{cursors[at]}</output>
            </figcaption>
            <div class="plot" ref={(host) => void (hosts.current[at] = host)} />
          </figure>
        ))}
      </div>
    </section>
  );
}

interface ToolbarProps {
  page: RunPage;
  shown: Window | null;
  is_whole: boolean;
  is_clock: boolean;
  cursor_time: Signal<string>;
  on_show(window: Window | null): void;
  on_time(time: string): void;
}

function Toolbar({ page, shown, is_whole, is_clock, cursor_time, on_show, on_time }: ToolbarProps) {
  const bounds = page.bounds;
  const text = shown ? window_text(shown, page.origin_us, is_clock) : '';
  const samples = page.samples_in_point.value;
  const step = (title: string, sign: string, id: string, next: () => Window | null) => (
    <button type="button" id={id} aria-label={title} title={title} disabled={!bounds} onClick={() => on_show(next())}>
      {sign}
    </button>
  );
  return (
    <div class="plot-tools" role="toolbar" aria-label="What the plots show">
      <span class="steps">
        {step('Earlier', '‹', 'earlier', () => shown && bounds && moved(shown, -0.5, bounds))}
        {step('Later', '›', 'later', () => shown && bounds && moved(shown, 0.5, bounds))}
        {step('Shorter', '+', 'zoom-in', () => shown && bounds && zoomed(shown, 0.5, bounds))}
        {step('Longer', '\u2212', 'zoom-out', () => shown && bounds && zoomed(shown, 2, bounds))}
        <button type="button" id="whole-run" disabled={is_whole} onClick={() => on_show(null)}>
          Whole run
        </button>
      </span>
      <span class="window" id="plot-window" role="status">
        {text}
      </span>
      <output class="cursor-time">{cursor_time}</output>
      <span class="quiet" id="plot-source">
        {page.is_loading.value
          ? 'finer values are on their way'
          : samples > 1
            ? `up to ${count(samples)} samples a point: least and largest`
            : samples === 1
              ? 'every sample'
              : ''}
      </span>
      <span class="steps times" role="group" aria-label="Times">
        <button type="button" id="time-since" aria-pressed={!is_clock} onClick={() => on_time('')}>
          Since start
        </button>
        <button type="button" id="time-clock" aria-pressed={is_clock} onClick={() => on_time('clock')}>
          Clock
        </button>
      </span>
      {page.traces_problem.value && (
        <p class="problem" role="alert">
          {page.traces_problem.value}
        </p>
      )}
    </div>
  );
}

const PositionKey = () => (
  <span class="key">
    <span class="swatch measured">estimated ± 2 sd</span>
    <span class="swatch seen">seen by controller</span>
    <span class="swatch commanded">setpoint</span>
    <span class="swatch reference">reference</span>
  </span>
);

function window_text({ from_us, to_us }: Window, origin_us: number, is_clock: boolean): string {
  const text = (utc_us: number) =>
    is_clock ? clock_time(Math.round(utc_us / 1000)).slice(0, 10) : since_text((utc_us - origin_us) / 1e6, 1);
  return `${text(from_us)} to ${text(to_us)}`;
}
