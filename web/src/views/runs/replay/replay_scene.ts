// The plots of a replay: they end at the moment that is shown, and run along with it. Dragging them moves the moment.

import type { Session } from '../../../session';
import { Past } from '../../../plots/past';
import { PredictionLoader } from '../../../plots/prediction_loader';
import { Scene } from '../../../plots/scene';
import type { PlotSettings } from '../../../plots/strips';
import { TimeAxis } from '../../../plots/time_axis';
import type { LogLine } from '../../../store';
import { line_at, type Replay } from './replay';

const kLeastShown_s = 1;
const kLongestShown_s = 86_400;

export class ReplayScene extends Scene {
  private readonly predicted: PredictionLoader;

  constructor(
    session: Session,
    readonly replay: Replay,
    robot_id: string,
    settings: PlotSettings,
  ) {
    const { api, experiments, path } = session;
    const { player, reel } = replay;
    // Where the reel has no page the least and the largest values stand in, until it has.
    const past = new Past(
      {
        samples: () => Promise.resolve([]),
        overview: (from_us, to_us, points) => api.robot_overview(robot_id, from_us, to_us, points),
        now_s: () => path.utc_s(performance.now()),
      },
      () => this.mark_dirty(),
      1,
    );
    const source = {
      rows: reel,
      past,
      shift_s: () => 0,
      edge_s: () => replay.at_us.peek() / 1e6,
      is_still: () => !player.is_playing.peek(),
      known: (line: LogLine) => line_at(line, replay.at_us.peek()),
    };
    const length_s = Math.max(kLeastShown_s, replay.length_s.peek());
    const axis = new TimeAxis(Math.min(settings.kept.peek().span_s, round_span_s(length_s)));
    super(source, axis, settings, (scene) => ({
      pan: (by_px) => replay.seek(player.at_s.peek() - (by_px / scene.width_px()) * axis.span_s),
      zoom: (factor) => this.show(axis.span_s * factor),
      run: () => undefined,
    }));
    replay.shown_s = axis.span_s;
    replay.on_change = () => this.mark_dirty();
    this.predicted = new PredictionLoader(experiments.predictions_of(robot_id), () => {
      this.predictions.predictions = this.predicted.found;
      this.mark_dirty();
    });
    this.show_state();
  }

  // How much the plots show; the moment stays at their right edge.
  show(span_s: number): void {
    const { axis } = this;
    axis.span_s = Math.min(kLongestShown_s, Math.max(kLeastShown_s, span_s));
    this.replay.shown_s = axis.span_s;
    this.replay.look();
    this.redraw();
  }

  load_predictions(from_us: number, to_us: number): Promise<void> {
    return this.predicted.look({ from_s: from_us / 1e6, to_s: to_us / 1e6 }, null);
  }

  show_state(): void {
    this.state.value = { is_live: true, span_s: this.axis.span_s, range: '' };
  }
}

const kSpans = [
  { span_s: 10, text: '10 s' },
  { span_s: 60, text: '1 min' },
  { span_s: 600, text: '10 min' },
  { span_s: 3600, text: '1 h' },
];

// A round time that has room for the whole run.
const round_span_s = (length_s: number) =>
  [5, 10, 20, 30, 60].find((span_s) => span_s >= length_s) ?? Math.ceil(length_s / 60) * 60;

// Those that are shorter than the run, and the whole of it.
export function spans_of(length_s: number): { span_s: number; text: string }[] {
  const whole_s = round_span_s(Math.max(kLeastShown_s, length_s));
  return [...kSpans.filter(({ span_s }) => span_s < whole_s), { span_s: whole_s, text: 'Whole run' }];
}
