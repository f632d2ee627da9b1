// The strip charts of a robot on one time axis: what arrives now, and before it what the station has recorded.
//
// A stretch that is held stands in the address (`from`, `to`), so that a link shows the same.

import { useEffect, useMemo } from 'preact/hooks';
import { Past } from '../plots/past';
import { PlotBar } from '../plots/plot_bar';
import { PredictionLoader, RunningZero } from '../plots/prediction_loader';
import { Scene } from '../plots/scene';
import { StripHost } from '../plots/strip_host';
import { plot_settings } from '../plots/strips';
import { clock_label, day_label, stretch_of, TimeAxis } from '../plots/time_axis';
import { XyPlot } from '../plots/xy_plot';
import type { Robot } from '../robot';
import { change_query, route } from '../route';
import type { Session } from '../session';
import { ThresholdList } from './threshold_list';

const kRingSamples = 65_536; // ten minutes at 100 Hz
const kSamplesOfTile = 10_000;
const kAddress_ms = 250; // after the last change of the stretch
const kMarksAgain_ms = 20_000;
const kPredictAgain_ms = 5000;

class LiveScene extends Scene {
  private timer = 0;
  private readonly predicted: PredictionLoader;
  private readonly running_zero = new RunningZero();

  constructor(
    private readonly session: Session,
    private readonly robot: Robot,
  ) {
    const { api, experiments, path } = session;
    const { robot_id, ring } = robot;
    ring.grow(kRingSamples);
    const shift_s = () => {
      const now_ms = performance.now();
      return robot.utc_shift_s(session.store.utc_minus_steady_us, path.utc_s(now_ms) - now_ms / 1000);
    };
    const past = new Past(
      {
        samples: (from_us, to_us) => api.robot_samples(robot_id, from_us, to_us, kSamplesOfTile),
        overview: (from_us, to_us, points) => api.robot_overview(robot_id, from_us, to_us, points),
        now_s: () => path.utc_s(performance.now()),
      },
      () => this.mark_dirty(),
    );
    const source = {
      rows: ring,
      past,
      shift_s,
      edge_s: (page_ms: number) => ring.edge_s(page_ms / 1000) + shift_s(),
      is_still: () => false,
    };
    const axis = new TimeAxis(plot_settings.kept.peek().span_s, () => this.on_axis());
    super(source, axis, plot_settings, (scene) => ({
      pan: (by_px) => axis.pan((-by_px / scene.width_px()) * axis.span_s, scene.now_s),
      zoom: (factor, at_px) => axis.zoom(factor, scene.time_at(at_px), scene.now_s),
      run: () => this.run(),
    }));
    this.predicted = new PredictionLoader(experiments.predictions_of(robot_id), () => {
      this.predictions.predictions = this.predicted.found;
      this.mark_dirty();
    });
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
    let after: number | null = null;
    do {
      const page: Awaited<ReturnType<typeof api.robot_markers>> = await api.robot_markers(robot_id, after);
      this.marks.take_markers(page.markers);
      after = page.next;
    } while (after !== null);
    this.mark_dirty();
  }

  async load_predictions(): Promise<void> {
    const at_work = this.session.store.experiments.at_work_on(this.robot.robot_id);
    const change = at_work ? `${at_work.experiment_id} ${at_work.state} ${JSON.stringify(at_work.run_counts)}` : '';
    const { run, elapsed_s } = at_work?.progress ?? { run: -1, elapsed_s: 0 };
    const utc_s = this.session.path.utc_s(performance.now());
    const zero_s = this.running_zero.of(`${at_work?.experiment_id}/${run}`, elapsed_s, utc_s);
    await this.predicted.look(this.view, zero_s, change);
  }

  override close(): void {
    super.close();
    clearTimeout(this.timer);
  }

  private on_axis(): void {
    this.redraw();
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      change_query(this.axis.address() ?? { from: '', to: '' });
    }, kAddress_ms);
  }

  show_state(): void {
    const { is_live, span_s } = this.axis;
    const { from_s, to_s } = this.view;
    const zone_s = this.zone_s();
    const time = (at_s: number) => clock_label(at_s, span_s < 20 ? 0.01 : 1, zone_s);
    const range = is_live ? '' : `${day_label(from_s, zone_s)}, ${time(from_s)} \u2013 ${time(to_s)}`;
    this.state.value = { is_live, span_s, range };
  }
}

export function Plots({ session, robot }: { session: Session; robot: Robot }) {
  const scene = useMemo(() => new LiveScene(session, robot), [robot]);
  const phase = session.phase.value;
  const query = route.value.query;
  const is_predicted = plot_settings.kept.value.traces.includes('predicted');

  useEffect(() => () => scene.close(), [scene]);
  useEffect(() => scene.follow(query), [scene, query['from'], query['to']]);
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
    if (!is_predicted) return;
    const load = () => phase === 'live' && void scene.load_predictions().catch(() => undefined);
    load();
    const timer = setInterval(load, kPredictAgain_ms);
    return () => clearInterval(timer);
  }, [scene, phase, is_predicted, query['from'], query['to']]);

  return (
    <section class={`plots ${scene.state.value.is_live ? 'running' : 'held'}`} aria-label="Plots">
      <PlotBar
        state={scene.state}
        note={scene.note}
        settings={plot_settings}
        on_live={() => scene.run()}
        on_span={(span_s) => scene.choose_span(span_s)}
      >
        <ThresholdList session={session} />
      </PlotBar>
      <StripHost
        scene={scene}
        label="Time axis: arrow keys move, plus and minus zoom, End goes back to live"
        on_key={(event) => scene.hand.key(event)}
      />
      <XyPlot scene={scene} />
    </section>
  );
}
