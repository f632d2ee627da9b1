// All that the page knows of one run, as signals, and the part of its recording that is looked at.

import { computed, signal } from '@preact/signals';
import type { EventRecord } from '../../api';
import { kGapless, Knots, step_bounds_us, wanted_moments } from './knots';
import { interrupted_stretches, moments_of } from './moments';
import type { Certificate, Marker, Overview, Run, RunMetrics, RunsApi, StoredSample, Window } from './runs_api';
import { period_us_of, traces_of, type Traces } from './traces';

export class RunPage {
  readonly run = signal<Run | null>(null);
  readonly problem = signal(''); // that there is no such run, or that it cannot be read
  readonly certificate = signal<Certificate | null>(null);
  readonly metrics = signal<RunMetrics | null>(null);
  readonly metrics_problem = signal('');
  readonly markers = signal<Marker[]>([]);
  readonly events = signal<EventRecord[]>([]);
  readonly are_events_whole = signal(true); // false: older ones than these are left out
  readonly unread = signal(''); // why it is not known what happened in it
  readonly whole = signal<Overview | null>(null);
  readonly traces = signal<Traces | null>(null); // of the window that is looked at
  readonly samples_in_point = signal(0); // the most
  readonly traces_problem = signal('');
  readonly is_loading = signal(false);
  readonly picked_s = signal<number | null>(null); // a moment that somebody clicked on
  readonly moments = computed(() => {
    const run = this.run.value;
    void this.traces.value; // knots came with them
    if (!run) return [];
    const steps = this.metrics.value?.steps ?? [];
    return moments_of(run, this.markers.value, this.events.value, steps, this.span_starts_us, this.knots);
  });
  readonly waits_s = computed(() => {
    const run = this.run.value;
    void this.traces.value; // knots came with them
    return run ? interrupted_stretches(run, this.origin_us, this.knots) : [];
  });
  // The stretches of the whole run where samples are missing, since its first one.
  readonly gaps_s = computed(() => {
    const whole = this.whole.value;
    return whole ? traces_of(whole, this.origin_us, new Knots(period_us_of(whole))).gaps_s : [];
  });
  span_starts_us: number[] = [];
  private knots = new Knots(10_000);
  private window: Window | null = null;
  private shown: Overview | null = null;
  private points = 1000;
  private turn = 0;
  private cancel = new AbortController();

  constructor(
    private readonly api: RunsApi,
    readonly run_id: number,
  ) {}

  // The first sample of the run; 0 while it is not known.
  get origin_us(): number {
    return this.whole.value?.first_utc_us[0] ?? 0;
  }
  // From the first sample to just after the last one.
  get bounds(): Window | null {
    const whole = this.whole.value;
    const from_us = whole?.first_utc_us[0];
    const to_us = whole?.last_utc_us.at(-1);
    return from_us === undefined || to_us === undefined ? null : { from_us, to_us: to_us + this.knots.period_us };
  }

  async load(): Promise<void> {
    try {
      this.run.value = await this.api.run(this.run_id);
      this.problem.value = '';
    } catch (error) {
      this.problem.value = said(error);
      return;
    }
    // Each stands alone: a run without metrics still has its plots.
    await Promise.all([
      this.api.certificate(this.run_id).then(
        (certificate) => (this.certificate.value = certificate),
        () => undefined, // the page says nothing of losses then
      ),
      this.load_what_happened(),
      this.load_metrics(),
      this.load_whole(),
    ]);
    await this.load_knots();
  }

  // Shows a window; null is the whole run. What is known of it is shown at once, and finer as soon as it has come.
  async look(window: Window | null, points: number): Promise<void> {
    this.window = window;
    this.points = points;
    if (!this.whole.peek()) return; // load() looks when it is there
    await this.load_window();
  }

  async load_what_happened(): Promise<void> {
    const run = this.run.peek() as Run;
    const asked = await Promise.allSettled([
      this.api.markers(this.run_id).then((markers) => (this.markers.value = markers)),
      this.api.events(run).then(({ events, is_whole }) => {
        this.events.value = events;
        this.are_events_whole.value = is_whole;
      }),
    ]);
    const failed = asked.find((each) => each.status === 'rejected');
    this.unread.value = failed ? said(failed.reason) : '';
  }

  losses = () => this.api.losses(this.run_id);

  stop(): void {
    this.turn += 1;
    this.cancel.abort();
  }

  // Those of an open run are computed anew for each request, so they are asked for once, and again when it has ended.
  private async load_metrics(): Promise<void> {
    if (this.run.peek()?.state === 'open' && this.metrics.peek()) return;
    try {
      this.metrics.value = await this.api.metrics(this.run_id);
      this.metrics_problem.value = '';
    } catch (error) {
      this.metrics_problem.value = said(error);
    }
  }

  private async load_whole(): Promise<void> {
    try {
      const whole = await this.api.overview(this.run_id, null, this.points);
      const period_us = period_us_of(whole);
      if (period_us !== this.knots.period_us) {
        const knots = new Knots(period_us);
        knots.add(this.knots.all);
        this.knots = knots;
      }
      this.whole.value = whole;
      await this.load_span_starts();
      if (this.window) await this.load_window();
      else this.show(whole);
    } catch (error) {
      this.traces_problem.value = said(error);
    }
  }

  // Where each span begins in UTC: of the first one the overview says it.
  private async load_span_starts(): Promise<void> {
    const { spans } = this.run.peek() as Run;
    const starts_us = [this.origin_us];
    for (let at = 1; at < spans.length; ++at) {
      const before = spans[at - 1];
      const first = await this.api.first_after(this.run_id, `${at - 1}-${before?.last_seq ?? 0}`);
      if (first?.span === at) starts_us[at] = first.utc_us;
    }
    this.span_starts_us = starts_us;
  }

  private async load_window(): Promise<void> {
    const turn = ++this.turn;
    this.cancel.abort();
    this.cancel = new AbortController();
    const { signal } = this.cancel;
    if (!this.window && this.whole.peek()) this.show(this.whole.peek() as Overview);
    this.is_loading.value = true;
    try {
      const overview = await this.api.overview(this.run_id, this.window, this.points, signal);
      if (turn !== this.turn) return;
      this.show(overview);
      await this.load_knots();
    } catch (error) {
      if (turn === this.turn) this.traces_problem.value = said(error);
    } finally {
      if (turn === this.turn) this.is_loading.value = false;
    }
  }

  private async load_knots(): Promise<void> {
    const { turn, cancel } = this;
    const window = this.window ?? this.bounds;
    const run = this.run.peek();
    if (!window || !run) return;
    const { period_us } = this.knots;
    const steps_us = step_bounds_us(this.metrics.peek()?.steps ?? [], this.span_starts_us, period_us);
    const sample_at = (from_us: number): Promise<StoredSample | null> =>
      turn === this.turn ? this.api.sample_at(run.robot_id, from_us, cancel.signal) : Promise.resolve(null);
    try {
      await this.knots.ask(wanted_moments(window, steps_us, period_us), kGapless * period_us, sample_at);
      if (turn === this.turn && this.shown) this.show(this.shown);
    } catch (error) {
      if (turn === this.turn) this.traces_problem.value = said(error);
    }
  }

  private show(overview: Overview): void {
    this.shown = overview;
    this.traces_problem.value = '';
    this.samples_in_point.value = overview.samples.reduce((most, samples) => Math.max(most, samples), 0);
    this.traces.value = traces_of(overview, this.origin_us, this.knots);
  }
}

export const said = (error: unknown) => (error instanceof Error ? error.message : String(error));
