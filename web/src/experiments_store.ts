// What the page knows of experiments: what /live reports of each, and what was asked for, the newest of both.
//
// A summary says everything of an experiment but its runs. What has ended stays ended, whatever an older answer says.

import { signal } from '@preact/signals';
import type { components } from './api_types';

// `place` in the queue: of a station that reports it.
export type ExperimentSummary = components['schemas']['ExperimentSummary'] & { place?: number };
export type ExperimentState = ExperimentSummary['state'];

export const kOpenStates: readonly ExperimentState[] = ['running', 'paused', 'aborting', 'waiting'];
export const has_ended = (experiment: Pick<ExperimentSummary, 'state'>) => !kOpenStates.includes(experiment.state);

// After an interruption, before it goes on by itself.
export const counts_down = ({ progress }: Pick<ExperimentSummary, 'progress'>) =>
  typeof progress?.goes_on_in_s === 'number';

// Whether a page, or a script, holds the experiment, by its actor and its id.
export const is_in_hands_of = (
  experiment: Pick<ExperimentSummary, 'acts_for' | 'client'>,
  actor: string,
  client: string,
) => actor !== '' && experiment.acts_for === actor && (experiment.client ?? '') === client;

const kMostKept = 200; // in one sign of life
const kMostEnded = 200; // that are kept beside those that go on

export class ExperimentsStore {
  readonly known = signal<ReadonlyMap<number, ExperimentSummary>>(new Map());
  private reports = 0; // of /live, so far
  private readonly reported = new Map<number, number>(); // of each experiment: the number of its latest report
  private readonly places = new Map<number, number>(); // of those that were moved on this page

  // A message of /live.
  take(experiment: ExperimentSummary): void {
    this.reports += 1;
    this.reported.set(experiment.experiment_id, this.reports);
    this.keep([experiment]);
  }

  // To be had before a request, and given back with its answer: what /live has reported since is newer than the answer.
  mark(): number {
    return this.reports;
  }

  take_answer(experiments: readonly ExperimentSummary[], asked_at: number): void {
    this.keep(experiments.filter(({ experiment_id }) => (this.reported.get(experiment_id) ?? 0) <= asked_at));
  }

  // All that go on, as the station has listed them: of others that went on here the page does not know the end.
  take_open(experiments: readonly ExperimentSummary[], asked_at: number): void {
    const listed = new Set(experiments.map(({ experiment_id }) => experiment_id));
    const kept = [...this.known.peek()].filter(
      ([id, known]) => has_ended(known) || listed.has(id) || (this.reported.get(id) ?? 0) > asked_at,
    );
    this.known.value = new Map(kept);
    this.take_answer(experiments, asked_at);
  }

  find(experiment_id: number): ExperimentSummary | undefined {
    return this.known.value.get(experiment_id);
  }

  // What moves the robot now, or is about to let go of it.
  at_work_on(robot_id: string): ExperimentSummary | undefined {
    return [...this.known.value.values()].find(
      (each) => each.robot_id === robot_id && !has_ended(each) && each.state !== 'waiting',
    );
  }

  // What waits for a robot, in the order in which it begins: the highest priority first, then by place.
  queue_of(robot_id: string): ExperimentSummary[] {
    return [...this.known.value.values()]
      .filter((each) => each.robot_id === robot_id && each.state === 'waiting')
      .sort((a, b) => b.priority - a.priority || this.place_of(a) - this.place_of(b));
  }

  // As the station does it: the places stay, and what stands in them changes. `before` null: behind all the others.
  note_move(moved: ExperimentSummary, before: number | null): void {
    const queue = this.queue_of(moved.robot_id).filter((each) => each.experiment_id !== moved.experiment_id);
    const places = [...queue, moved].map((each) => this.place_of(each)).sort((a, b) => a - b);
    const at = queue.findIndex((each) => each.experiment_id === before);
    queue.splice(at < 0 ? queue.length : at, 0, moved);
    queue.forEach((each, index) => this.places.set(each.experiment_id, places[index] as number));
    this.keep([moved]);
  }

  // SAFETY: the station lets a robot go on only while the page in whose hands its experiment is is there. A page says so
  // for what it has begun or taken over, and for nothing else, not even of another tab of its session.
  kept_by(actor: string, client: string): number[] {
    return [...this.known.peek().values()]
      .filter((each) => is_in_hands_of(each, actor, client) && !has_ended(each))
      .map(({ experiment_id }) => experiment_id)
      .slice(-kMostKept);
  }

  private place_of({ experiment_id, place }: ExperimentSummary): number {
    return place ?? this.places.get(experiment_id) ?? experiment_id;
  }

  private keep(experiments: readonly ExperimentSummary[]): void {
    const next = new Map(this.known.peek());
    for (const experiment of experiments) {
      const known = next.get(experiment.experiment_id);
      if (known && has_ended(known) && !has_ended(experiment)) continue;
      next.set(experiment.experiment_id, experiment);
    }
    const ended = [...next.values()].filter(has_ended).sort((a, b) => b.experiment_id - a.experiment_id);
    for (const { experiment_id } of ended.slice(kMostEnded)) next.delete(experiment_id);
    this.known.value = next;
  }
}
