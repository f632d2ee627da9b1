// Step 5: the robot shows what the controller does. What it measured stands beside what was predicted.

import { Choice } from '../../parts/choice';
import { format } from '../../route';
import { millimetres, plus_minus } from '../../format';
import { useAsked } from '../experiments/acts';
import type { Step as StepMeasures } from '../runs/runs_api';
import { change_design } from './address';
import type { Measures, Predicted, Tuned } from './design_api';
import type { StepProps } from './parts';
import { Step } from './step';
import { VerifyPlots } from './verify_plot';
import { fixed_text, type StepState } from './words';

const kSameSize = 0.05; // relative
const kMostPlots = 4;

// The prediction that a measured step belongs to: by its cause and its size, as `rheonaut autotune` does.
export function predicted_for(
  step: Pick<StepMeasures, 'cause' | 'start_m' | 'target_m'>,
  predicted: Predicted | undefined,
): Measures | null {
  if (!predicted) return null;
  const moved_m = step.target_m - step.start_m;
  const is_of_size = (size_m: number) => Math.abs(moved_m - size_m) <= kSameSize * Math.abs(size_m);
  const { setpoint_m, disturbance_m } = predicted.experiment;
  if (step.cause === 'setpoint' && is_of_size(setpoint_m)) return predicted.step;
  // After a disturbance the robot comes back from where it seems to be.
  return step.cause === 'disturbance' && is_of_size(-disturbance_m) ? predicted.disturbance : null;
}

// Whether a run was made with a kept controller, as the station says; empty: it was. What the robot runs now does not say.
export function controller_note(run_id: number, runs_made_with: readonly number[]): string {
  if (runs_made_with.includes(run_id)) return '';
  if (runs_made_with.length === 0)
    return 'No run is known that was made with this controller: send it, and run the experiment.';
  return `The run is not known to be made with this controller; made with it: run ${runs_made_with.slice(0, 3).join(', ')}.`;
}

export function VerifyStep({ session, work, design, runs, tune }: StepProps) {
  const robot_id = session.store.selected_id.value ?? '';
  const own = (runs.answer?.runs ?? []).filter(
    (run) => run.state !== 'open' && (run.robot_id === robot_id || run.run_id === design.verified),
  );
  const metrics = useAsked(
    session,
    async () =>
      design.verified === null ? null : { id: design.verified, found: await work.api.metrics(design.verified) },
    [design.verified],
  );
  const found = metrics.answer?.id === design.verified ? (metrics.answer?.found ?? null) : null;
  const tuned = work.tuning.answer_to(tune?.key)?.result ?? null;
  const controller = useAsked(
    session,
    async () => (design.controller === null ? null : work.api.design(design.controller)),
    [design.controller, design.verified],
  );
  const is_asked = controller.answer?.design_id === design.controller && design.controller !== null;
  const made_with = is_asked ? controller.answer!.runs_made_with : null;
  const note =
    design.verified === null
      ? ''
      : design.controller === null
        ? 'Whether the run was made with this controller is not known: it is not kept.'
        : made_with !== null
          ? controller_note(design.verified, made_with)
          : '';
  return (
    <Step
      work={work}
      number={5}
      name="verify"
      title="Run and compare"
      state={verify_state(design, robot_id, metrics.problem, found?.steps ?? [])}
    >
      <div class="design-columns">
        <div>
          <p>
            <a class="button" id="design-verify-link" href={experiment_link(robot_id)}>
              Figure 7 on {robot_id || 'a robot'}
            </a>
          </p>
          <p class="quiet design-note">
            To 0.1 m, and after 20 s a disturbance of −50 mm: 40 s. Nothing moves before “Start” there. Then choose its
            run here.
          </p>
          <span class="design-label">Compare with</span>
          <Choice
            id="design-verified"
            label="Run to compare with the prediction"
            options={[
              { value: '', text: 'no run' },
              ...own.map(({ run_id, name }) => ({ value: String(run_id), text: `run ${run_id}: ${name}` })),
            ]}
            value={String(design.verified ?? '')}
            on_choose={(value) => change_design({ ...design, verified: value === '' ? null : Number(value) })}
          />
          {(note || controller.problem) && (
            <p class="design-note design-caution" id="design-made-with">
              {note || controller.problem}
            </p>
          )}
        </div>
        <div>
          {found === null ? (
            <p class="quiet design-empty">
              {metrics.problem !== ''
                ? metrics.problem
                : 'What the robot did is shown here, beside what was predicted.'}
            </p>
          ) : found.steps.length === 0 ? (
            <p class="quiet design-empty">Run {design.verified} has no step in auto to compare.</p>
          ) : (
            <Compared session={session} work={work} steps={found.steps} tuned={tuned} run_id={design.verified!} />
          )}
        </div>
      </div>
    </Step>
  );
}

const experiment_link = (robot_id: string) =>
  format({ view: 'experiments', parts: ['new'], query: { profile: 'figure_7', robot: robot_id } });

export function verify_state(
  design: StepProps['design'],
  robot_id: string,
  problem: string,
  steps: Pick<StepMeasures, 'position_doubt' | 'position_source'>[],
): StepState {
  if (problem !== '') return { kind: 'failed', text: `failed: ${problem}` };
  // A loop on the robot's estimate settles in its belief, whether or not the robot does.
  const is_belief = steps.some((step) => step.position_doubt && step.position_source === 'estimate');
  if (design.verified !== null)
    return {
      kind: 'done',
      text: `run ${design.verified}${is_belief ? ', which does not tell where the robot was' : ''}`,
    };
  if (robot_id === '') return { kind: 'needs', text: 'needs a robot' };
  return { kind: 'ready', text: 'ready' };
}

interface ComparedProps extends Pick<StepProps, 'session' | 'work'> {
  steps: StepMeasures[];
  tuned: Tuned | null;
  run_id: number;
}

function Compared({ session, work, steps, tuned, run_id }: ComparedProps) {
  const predicted = tuned?.feasible ? tuned.predicted[0] : undefined;
  const compared = steps.flatMap((step) => {
    const of_step = predicted_for(step, predicted);
    return of_step ? [{ step, predicted: of_step }] : [];
  });
  return (
    <>
      <div class="design-scroll-x">
        <table class="design-table" id="design-compared">
          <caption>each step, and below it what the model predicts of it</caption>
          <thead>
            <tr>
              <th scope="col">Step</th>
              <th scope="col" class="number">
                Settling, s
              </th>
              <th scope="col" class="number">
                Overshoot, %
              </th>
              <th scope="col" class="number">
                Rise, s
              </th>
              <th scope="col" class="number">
                Error, mm
              </th>
              <th scope="col">Position by</th>
            </tr>
          </thead>
          <tbody>
            {steps.map((step, at) => (
              <Pair key={at} step={step} predicted={predicted_for(step, predicted)} />
            ))}
          </tbody>
        </table>
      </div>
      <PositionDoubts steps={steps} />
      {tuned?.feasible && (
        <VerifyPlots
          session={session}
          work={work}
          run_id={run_id}
          tuned={tuned}
          compared={compared.slice(0, kMostPlots)}
        />
      )}
      <p class="quiet design-note">
        A position by the robot’s own estimate says what the robot believed, not where it was.{' '}
        <a href={format({ view: 'runs', parts: [String(run_id)] })}>Run {run_id} in full</a>
      </p>
    </>
  );
}

// Nothing where the positions are known within the settling band.
function PositionDoubts({ steps }: { steps: StepMeasures[] }) {
  const doubted = steps.filter(({ position_doubt }) => position_doubt);
  if (doubted.length === 0) return null;
  return (
    <ul class="design-sentences design-caution" id="design-position-doubts">
      {doubted.map((step, at) => (
        <li key={at}>
          {step_name(step)}: {step.position_doubt}.
        </li>
      ))}
    </ul>
  );
}

const step_name = (step: StepMeasures) =>
  `${step.cause}, ${millimetres(step.start_m, 0)} to ${millimetres(step.target_m, 0)} mm`;

function Pair({ step, predicted }: { step: StepMeasures; predicted: Measures | null }) {
  const source =
    step.position_source === 'outside' ? 'outside' : step.position_source === 'known' ? 'known' : 'estimate';
  return (
    <>
      <tr>
        <th scope="row">{step_name(step)}</th>
        <Numbers measures={step} />
        <td>
          {source} {source !== 'known' && `${plus_minus(step.position_sd_m)} mm`}
        </td>
      </tr>
      <tr class="design-predicted-row">
        <th scope="row">predicted</th>
        {predicted ? <Numbers measures={predicted} /> : <td colSpan={4}>of another size than the prediction</td>}
        <td>{predicted ? 'model' : ''}</td>
      </tr>
    </>
  );
}

function Numbers({ measures }: { measures: { [name in keyof Measures]?: number | null } }) {
  return (
    <>
      <td class="number">{fixed_text(measures.settling_s, 2)}</td>
      <td class="number">{fixed_text(measures.overshoot_percent, 1)}</td>
      <td class="number">{fixed_text(measures.rise_10_90_s, 2)}</td>
      <td class="number">{millimetres(measures.steady_state_error_m, 2)}</td>
    </>
  );
}
