// Asks the station for the predictions of a robot's experiments that fall into the time that is shown.

import { has_ended, type ExperimentSummary } from '../experiments_store';
import type { Experiment, ExperimentRun, Prediction } from '../experiments_api';
import type { StoredSample } from '../api';
import type { Predicted } from './predictions';
import type { Stretch } from './time_axis';

export interface PredictionWays {
  experiments(): Promise<ExperimentSummary[]>; // of the robot, the newest first
  one(experiment_id: number): Promise<Experiment>;
  prediction(experiment_id: number, run: number): Promise<Prediction>;
  first_sample(run_id: number): Promise<StoredSample | null>;
  first_wait_us(run_id: number): Promise<number | null>;
}

const kMostAtOnce = 24; // predictions in one stretch; of more the newest
const kListAgain_ms = 60_000; // while nothing is known to have changed
const kBefore_s = 30; // a run is recorded before its first step begins

// When the run that goes on began, in UTC: of what is reported of it, the report that was the least late says best.
export class RunningZero {
  private key = '';
  private zero_s = Infinity;

  // `key`: of the experiment and its run. null: not known yet.
  of(key: string, elapsed_s: number, utc_s: number): number | null {
    if (key !== this.key) [this.key, this.zero_s] = [key, Infinity];
    if (elapsed_s > 0) this.zero_s = Math.min(this.zero_s, utc_s - elapsed_s);
    return Number.isFinite(this.zero_s) ? this.zero_s : null;
  }
}

export class PredictionLoader {
  found: readonly Predicted[] = [];
  private readonly answers = new Map<string, Prediction>(); // by experiment and run; none of them changes
  private readonly zeros_s = new Map<string, number>(); // of runs that have ended
  private readonly experiments = new Map<number, { state: string; experiment: Experiment }>();
  private listed: ExperimentSummary[] = [];
  private listed_at_ms = -Infinity;
  private change = '';
  private is_busy = false;

  constructor(
    private readonly ways: PredictionWays,
    private readonly on_change: () => void,
    private readonly now_ms: () => number = () => performance.now(),
  ) {}

  // `running_zero_s`: when the run that goes on began, in UTC; null where it is not known.
  // `change`: other than before when something of the robot's experiments is known to have changed.
  async look({ from_s, to_s }: Stretch, running_zero_s: number | null, change = ''): Promise<void> {
    if (this.is_busy) return;
    this.is_busy = true;
    try {
      const shown: Predicted[] = [];
      const experiments = (await this.list(change)).filter((each) => overlaps(each, from_s, to_s));
      for (const summary of experiments.slice(0, kMostAtOnce)) {
        const { runs } = await this.one(summary);
        const wanted = runs.filter((run) => run.has_prediction && run_overlaps(run, from_s, to_s)).reverse();
        for (const run of wanted.slice(0, kMostAtOnce - shown.length)) {
          const predicted = await this.predicted_of(summary.experiment_id, run, running_zero_s);
          if (predicted) shown.push(predicted);
        }
      }
      this.found = shown;
      this.on_change();
    } finally {
      this.is_busy = false;
    }
  }

  private async list(change: string): Promise<ExperimentSummary[]> {
    const now_ms = this.now_ms();
    if (change === this.change && now_ms - this.listed_at_ms < kListAgain_ms) return this.listed;
    this.listed = await this.ways.experiments();
    [this.change, this.listed_at_ms] = [change, now_ms];
    return this.listed;
  }

  // Of one that has ended nothing changes any more.
  private async one(summary: ExperimentSummary): Promise<Experiment> {
    const state = `${summary.state} ${JSON.stringify(summary.run_counts)}`;
    const known = this.experiments.get(summary.experiment_id);
    if (known?.state === state) return known.experiment;
    const experiment = await this.ways.one(summary.experiment_id);
    this.experiments.set(summary.experiment_id, { state, experiment });
    return experiment;
  }

  private async predicted_of(
    experiment_id: number,
    run: ExperimentRun,
    running_zero_s: number | null,
  ): Promise<Predicted | null> {
    const key = `${experiment_id}/${run.number}`;
    const zero_s = run.ended_at_us === null ? running_zero_s : await this.zero_of(key, run);
    if (zero_s === null) return null;
    const said = this.answers.get(key) ?? (await this.prediction_of(experiment_id, run));
    if (run.ended_at_us !== null) this.answers.set(key, said);
    const { t_s, position_m, position_sd_m = null } = said;
    return t_s && position_m ? { key, zero_s, t_s, position_m, position_sd_m } : null;
  }

  // As far as the run was not interrupted: what came later, or from another place, was not predicted.
  private async prediction_of(experiment_id: number, { number, steps, run_id, ended_at_us }: ExperimentRun) {
    const said = await this.ways.prediction(experiment_id, number);
    const begun_us = steps[0]?.robot_time_us;
    const wait_us = run_id === null || ended_at_us === null ? null : await this.ways.first_wait_us(run_id);
    if (wait_us === null || begun_us === undefined || !said.t_s) return said;
    const holds_for = said.t_s.filter((time_s) => time_s < (wait_us - begun_us) / 1e6).length;
    return { ...said, t_s: said.t_s.slice(0, holds_for), position_m: said.position_m?.slice(0, holds_for) ?? [] };
  }

  // The robot's clock at the first step, laid on UTC as the first sample of the run is.
  private async zero_of(key: string, { steps, run_id }: ExperimentRun): Promise<number | null> {
    const known_s = this.zeros_s.get(key);
    if (known_s !== undefined) return known_s;
    const [first] = steps;
    if (!first || run_id === null) return null;
    const sample = await this.ways.first_sample(run_id);
    if (!sample) return null;
    const zero_s = (sample.utc_us + first.robot_time_us - sample.robot_time_us) / 1e6;
    this.zeros_s.set(key, zero_s);
    return zero_s;
  }
}

function overlaps(each: ExperimentSummary, from_s: number, to_s: number): boolean {
  if (each.started_at_us === null) return false;
  const end_s = has_ended(each) && each.ended_at_us !== null ? each.ended_at_us / 1e6 : Infinity;
  return each.started_at_us / 1e6 < to_s && end_s > from_s;
}

const run_overlaps = ({ started_at_us, ended_at_us }: ExperimentRun, from_s: number, to_s: number) =>
  started_at_us / 1e6 - kBefore_s < to_s && (ended_at_us ?? Infinity) / 1e6 > from_s;
