// One experiment: how far it is, why it waits or has ended, what may be done with it, its runs and what was predicted.

import { useComputed } from '@preact/signals';
import { useLayoutEffect, useMemo, useRef } from 'preact/hooks';
import type { Experiment, ExperimentRun, Prediction } from '../../experiments_api';
import { counts_down, has_ended, is_in_hands_of, type ExperimentSummary } from '../../experiments_store';
import { millimetres } from '../../format';
import { format } from '../../route';
import type { Session } from '../../session';
import { useActs, useAsked } from './acts';
import { ActsOfOne, Presence } from './acts_of_one';
import { KnowledgePanel } from './knowledge';
import { measured_in, measured_of, ring_now_s, RunBegin, type Measured } from './measured';
import type { Track } from './preview';
import { RunsTable } from './runs_table';
import { moment_text } from './slot_time';
import { TrackPlot } from './track_plot';
import { how_long, kStates, progress_text, sentence_of, situation, who } from './words';

const kMostPoints = 2000; // of a recorded run beside its prediction

interface OneExperimentProps {
  session: Session;
  id: number;
  asked_run: number | null; // the one whose plot was asked for
}

export function OneExperiment({ session, id, asked_run }: OneExperimentProps) {
  const { store, experiments } = session;
  const known = useComputed(() => store.experiments.find(id)).value;
  // Its runs come with an answer of their own: again whenever /live says that something of them has changed.
  const change = known
    ? [known.state, JSON.stringify(known.run_counts), known.activity, known.progress?.run].join()
    : '';
  const asked = useAsked(session, async () => {
    const asked_at = store.experiments.mark();
    const found = await experiments.one(id);
    store.experiments.take_answer([found], asked_at);
    return found;
  }, [id, change]);
  const whole = asked.answer?.experiment_id === id ? asked.answer : null;
  const summary = known ?? whole;
  // SAFETY: Escape is for the robot that is looked at. An experiment that goes on, and that the page knows, selects it in the
  // call in which it is opened; one that has to be asked for does not move the name on the stop button: see StopNote.
  useLayoutEffect(() => {
    const opened = store.experiments.find(id);
    if (opened && !has_ended(opened) && store.find(opened.robot_id)) store.select(opened.robot_id);
  }, [id]);

  if (!summary) {
    return asked.problem === '' ? (
      <p class="quiet empty">Asking the station…</p>
    ) : (
      <div class="waiting">
        <h2>There is no experiment {id} to be seen</h2>
        <p role="alert">{asked.problem}</p>
        <p>
          <a href={format({ view: 'experiments' })}>All experiments</a>
        </p>
      </div>
    );
  }
  const plotted = whole && plotted_run(whole, asked_run);
  return (
    <div class="one">
      <StopNote session={session} robot_id={summary.robot_id} is_over={has_ended(summary)} />
      <Head session={session} experiment={summary} />
      {whole && (
        <>
          <div class="one-plot">
            <RunPlot session={session} experiment={whole} summary={summary} run={plotted} />
            <KnowledgePanel runs={whole.runs} />
          </div>
          <section aria-label="Runs">
            <h2>Runs</h2>
            <RunsTable session={session} experiment={whole} plotted={plotted?.number ?? null} />
          </section>
          <details class="document">
            <summary>The profile as it is stored</summary>
            <pre tabIndex={0}>{whole.profile}</pre>
          </details>
        </>
      )}
    </div>
  );
}

function StopNote({ session, robot_id, is_over }: { session: Session; robot_id: string; is_over: boolean }) {
  const { store } = session;
  const selected_id = store.selected_id.value;
  if (is_over || selected_id === robot_id || !store.find(robot_id)) return null;
  return (
    <p class="stop-elsewhere" id="stop-elsewhere" role="alert">
      The stop button stops {selected_id ?? 'all robots'}; this experiment moves {robot_id}.{' '}
      <button type="button" onClick={() => store.select(robot_id)}>
        Let it stop {robot_id}
      </button>
    </p>
  );
}

function Head({ session, experiment }: { session: Session; experiment: ExperimentSummary }) {
  const acts = useActs();
  const is_current = session.store.is_current.value;
  const { state, progress, detail, waits_for_detail, robot_id, experiment_id } = experiment;
  const me = session.store.actor.value;
  const { what, todo } = situation(experiment);
  const own_words = state === 'waiting' ? waits_for_detail : detail;
  const is_over = has_ended(experiment);
  const stale = !is_current && !is_over;
  return (
    <section class={`one-head ${stale ? 'stale' : ''}`} aria-label="State">
      <div class="one-title">
        <span class={`state lamp-like ${state}`} id="experiment-state" data-state={stale ? '' : state}>
          {stale ? `Was: ${kStates[state]}` : kStates[state]}
        </span>
        <h2>{experiment.name}</h2>
        <span class="quiet">
          experiment {experiment_id} on <a href={format({ view: 'robot', parts: [robot_id] })}>{robot_id}</a>
        </span>
        <ActsOfOne session={session} experiment={experiment} acts={acts} />
      </div>
      {stale && (
        <p class="problem" role="status">
          Cut off from the station: what the robot does now is not known. Cut off for 3 s, what acts in the name of this
          page comes to rest, and ends 10 s later.
        </p>
      )}
      {progress && !is_over && (
        <div class="one-progress">
          <progress
            max={progress.duration_s}
            value={Math.min(progress.elapsed_s, progress.duration_s)}
            aria-label="Of this run"
          />
          <output id="experiment-progress">{progress_text(experiment)}</output>
        </div>
      )}
      {(what !== '' || own_words) && (
        <p class="situation" id="situation">
          {what} {todo !== '' && !is_over && <b>{todo}</b>}
          {own_words && own_words !== experiment.activity && <span class="quiet"> {sentence_of(own_words)}</span>}
          {counts_down(experiment) && is_in_hands_of(experiment, me, session.store.client.value) && (
            <b> Any key or press pauses it.</b>
          )}
          {state === 'waiting' && <WaitsSince experiment={experiment} session={session} />}
        </p>
      )}
      <Presence session={session} experiment={experiment} />
      <p class="problem" role="alert" id="act-problem">
        {acts.problem.value}
      </p>
      <dl class="one-figures">
        <Figure name="Begun by">{who(experiment.owner, me)}</Figure>
        <Figure name="Acts for">{who(experiment.acts_for, me)}</Figure>
        <Figure name="Asked">{moment_text(experiment.created_at_us)}</Figure>
        {experiment.started_at_us !== null && <Figure name="Begun">{moment_text(experiment.started_at_us)}</Figure>}
        {experiment.ended_at_us !== null && <Figure name="Ended">{moment_text(experiment.ended_at_us)}</Figure>}
        <Figure name="Takes">{how_long(experiment.duration_s)}</Figure>
        <Figure name="Priority">{`${experiment.priority}`.replace('-', '−')}</Figure>
        {experiment.notes !== '' && <Figure name="Notes">{experiment.notes}</Figure>}
      </dl>
    </section>
  );
}

function Figure({ name, children }: { name: string; children: preact.ComponentChildren }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{children}</dd>
    </div>
  );
}

function WaitsSince({ session, experiment }: { session: Session; experiment: ExperimentSummary }) {
  void session.store.now_ms.value;
  const waited_s = Math.floor((session.utc_us() - experiment.created_at_us) / 1e6);
  return <span class="quiet"> Waits for {how_long(Math.max(0, waited_s))}.</span>;
}

interface RunPlotProps {
  session: Session;
  experiment: Experiment;
  summary: ExperimentSummary;
  run: ExperimentRun | null;
}

// The one that is asked for, or else the run that goes on, or the last one that has a prediction.
function plotted_run({ runs }: Experiment, asked: number | null): ExperimentRun | null {
  const predicted = runs.filter((run) => run.has_prediction);
  return predicted.find((run) => run.number === asked) ?? predicted.at(-1) ?? null;
}

// Predicted, and measured as far as it is recorded.
function RunPlot({ session, experiment, summary, run }: RunPlotProps) {
  const number = run?.number ?? 0;
  const id = `${experiment.experiment_id}-${number}`;
  const asked = useAsked<{ id: string; prediction: Prediction | null }>(
    session,
    async () => ({
      id,
      prediction: number === 0 ? null : await session.experiments.prediction(experiment.experiment_id, number),
    }),
    [id],
  );
  const answer = asked.answer?.id === id ? asked.answer.prediction : null; // not that of the run before
  const is_now = run !== null && summary.progress?.run === number && run.ended_at_us === null;
  const elapsed_s = is_now ? (summary.progress?.elapsed_s ?? null) : null;
  const track = useMemo(() => track_of_prediction(answer), [answer]);
  const live = useMeasured(session, summary.robot_id, id, elapsed_s);
  const recorded = useRecorded(session, run, track?.t_s.length ?? 0);
  const measured = live ?? recorded;
  if (!run) return null;
  if (answer?.error)
    return (
      <p class="quiet">
        There is no prediction of run {number}: {answer.error}
      </p>
    );
  if (!track || !answer) return <p class="quiet empty">Asking for the prediction…</p>;
  const has_band = (answer.position_sd_m ?? null) !== null;
  return (
    <section aria-label="Prediction and measurement" id="run-plot">
      <h2>Run {number}</h2>
      <TrackPlot
        track={track}
        measured={measured}
        at_s={elapsed_s}
        label={`Run ${number}: predicted from ${millimetres(answer.position_min_m ?? null, 0)} to ${millimetres(answer.position_max_m ?? null, 0)} mm`}
      />
      <p class="track-legend">
        {measured && <span class="track-key measured">position, estimated ± 2 sd</span>}{' '}
        <span class="track-key predicted">predicted{has_band ? ' ± 2 sd' : ''}</span>{' '}
        <span class="track-key setpoint">setpoint</span> <span class="track-key duty">duty, predicted</span>
        <span class="quiet">
          {' '}
          On the model {answer.model_of}, stored before the run
          {has_band ? '; its band is of the position that the robot measures' : '; how sure it is, is not known'}
          {answer.ignores_flow ? '; without the flow of the pump' : ''}.
          {measured && Number.isFinite(measured.until_s)
            ? ` Measured up to ${measured.until_s.toFixed(1)} s, where the run was interrupted; what came later was not predicted.`
            : ''}
        </span>
      </p>
      {(answer.problems ?? []).map((problem) => (
        <p key={problem} class="plan-problem">
          {sentence_of(problem)}
        </p>
      ))}
    </section>
  );
}

function track_of_prediction(prediction: Prediction | null): Track | null {
  if (!prediction?.t_s) return null;
  const { t_s, position_m = [], duty = [], setpoint_m = [], position_sd_m = null } = prediction;
  return { t_s, position_m, duty, setpoint_m, position_sd_m };
}

// Where the robot believed that it was in a run that has ended: the robot's clock at its first step is when its
// prediction begins, laid on UTC as the first sample of the run is.
function useRecorded(session: Session, run: ExperimentRun | null, points: number): Measured | null {
  const run_id = run !== null && run.ended_at_us !== null && points > 0 ? run.run_id : null;
  const begun_us = run?.steps[0]?.robot_time_us ?? null;
  const asked = useAsked<{ run_id: number; measured: Measured } | null>(session, async () => {
    if (run_id === null || begun_us === null) return null;
    const first = await session.experiments.first_sample(run_id);
    if (!first) return null;
    const zero_us = first.utc_us + begun_us - first.robot_time_us;
    const [overview, wait_us] = await Promise.all([
      session.experiments.estimate_in(run_id, zero_us, Math.min(points, kMostPoints)),
      session.experiments.first_wait_us(run_id),
    ]);
    const until_s = wait_us === null ? Infinity : (wait_us - begun_us) / 1e6;
    return { run_id, measured: measured_in(overview, zero_us, until_s) };
  }, [run_id, begun_us, points]);
  return asked.answer !== null && asked.answer.run_id === run_id ? asked.answer.measured : null;
}

// Where the robot believed that it was since the run began, as far as this page has received it.
function useMeasured(session: Session, robot_id: string, id: string, elapsed_s: number | null): Measured | null {
  const begin = useRef(new RunBegin()).current;
  const { store, path } = session;
  const robot = store.find(robot_id);
  return useMemo(() => {
    if (!robot || elapsed_s === null) return null;
    const page_ms = performance.now();
    const now_s = ring_now_s(robot, store.utc_minus_steady_us, path.utc_s(page_ms), page_ms / 1000);
    return measured_of(robot.ring, begin.of(id, elapsed_s, now_s), elapsed_s);
  }, [robot, id, elapsed_s]);
}
