// The model goes to the estimator of the robot: what it knows of its position then rests on what was found on it.

import type { RobotModel } from '../../api';
import { fluid_text, percent } from '../../format';
import { may_command, useActs, useAsked } from '../experiments/acts';
import { RunsApi, type Run } from '../runs/runs_api';
import { estimator_of } from './design_api';
import type { StepProps } from './parts';

export function SendModel({ session, work, model }: Pick<StepProps, 'session' | 'work' | 'model'>) {
  const { store } = session;
  const robot = store.selected.value;
  const { pending, problem, act } = useActs();
  const kept = model !== null && typeof model !== 'string' ? model : null;
  const origin = useAsked(session, async () => {
    const api = new RunsApi(session.api);
    return Promise.all((kept?.runs ?? []).map(({ run_id }) => api.run(run_id)));
  }, [kept?.design_id]);
  const found = kept && estimator_of(kept);
  if (!kept || !found || !robot) return null;
  const { robot_id } = robot;
  const { fluid, model: held } = robot.state.value;
  const blocked =
    'refused' in found
      ? `The robot’s estimator cannot take ${kept.name}: ${found.refused}. The robot’s position stays as uncertain.`
      : (other_origin(origin.answer, fluid, robot_id) ??
        (!store.is_current.value
          ? 'Cut off from the station: nothing can be sent.'
          : !may_command(session)
            ? 'Your role may look and stop. To send needs the role operator.'
            : robot.is_away.value
              ? `${robot_id} is not connected.`
              : ''));
  const send = () =>
    act('model', async () => {
      if (!store.is_current.peek() || store.selected_id.peek() !== robot_id || 'refused' in found) return;
      await work.api.send_model(robot_id, fluid!, found);
    });
  return (
    <div class="design-send">
      <button
        type="button"
        id="design-send-model"
        disabled={blocked !== '' || pending.value !== '' || held.state === 'sending'}
        aria-describedby="design-model-note"
        onClick={() => void send()}
      >
        Send the model{fluid !== null && ` of ${fluid_text(fluid)}`} to {robot_id}, too
      </button>
      <p class="quiet design-note" id="design-model-note">
        {blocked || held_text(robot_id, held)}
      </p>
      <p class="problem" role="alert">
        {problem.value}
      </p>
    </div>
  );
}

// Why a model that was found from these runs (null: they are not read yet) is not sent to this robot; null: it may be.
export function other_origin(
  runs: Pick<Run, 'run_id' | 'fluid' | 'robot_id'>[] | null,
  fluid: string | null,
  robot_id: string,
): string | null {
  if (fluid === null) return 'Say first which fluid the robot is in: a model is of one fluid.';
  if (runs === null) return 'The runs from which it was found are being read…';
  if (runs.length === 0) return 'It was not found from runs of this station, so nobody can say of which fluid it is.';
  const other = runs.find((run) => run.fluid !== fluid || run.robot_id !== robot_id);
  if (!other) return null;
  const of = other.fluid === '' ? 'a fluid that nobody has named' : fluid_text(other.fluid);
  return `It was found from run ${other.run_id}, of ${other.robot_id} in ${of}; ${robot_id} is in ${fluid_text(fluid)}.`;
}

export function held_text(robot_id: string, model: RobotModel): string {
  const why = model.reason === '' ? '' : `: ${model.reason}`;
  if (model.state === 'sending') return `A model is on its way to ${robot_id}.`;
  // Only a model that the station has sent has a fit error and a fluid.
  if (model.fit_error === null || model.fluid === null) return `The model of ${robot_id} is ${model.state}${why}.`;
  const name = `the model of ${fluid_text(model.fluid)} (fit error ${percent(model.fit_error, 2)} %)`;
  if (model.state === 'failed') return `${robot_id} could not be sent ${name}${why}.`;
  return model.state === 'confirmed'
    ? `${robot_id} holds ${name}, read back bit for bit${why}.`
    : `${robot_id} assumes ${name}${why}.`;
}
