// What became of the model of the robot's fluid, in words, and a button to send it (again).

import type { RobotModel } from '../api';
import { fluid_text, percent } from '../format';
import type { Robot } from '../robot';
import type { Session } from '../session';

interface ModelLineProps {
  session: Session;
  robot: Robot;
  pending: boolean;
  on_send(fluid: string): void; // by naming the fluid once more
}

export function ModelLine({ session, robot, pending, on_send }: ModelLineProps) {
  const { fluid, model, link, control } = robot.state.value;
  const is_free_or_mine = control === null || control.holder === session.store.actor.value;
  const has_model = session.fluids.value?.some((each) => each.fluid === fluid && each.model !== null) ?? false;
  const text = model_notice(model, fluid, has_model);
  if (text === '') return null;
  const may_send =
    fluid !== null && (has_model || model.fluid === fluid) && model.state !== 'confirmed' && model.state !== 'sending';
  return (
    <div class="model-line" id="model-line" role="status">
      <p class={model.state === 'failed' ? 'failed' : 'quiet'}>{text}</p>
      {may_send && (
        <button
          type="button"
          id="send-model"
          disabled={pending || link !== 'connected' || !is_free_or_mine}
          onClick={() => on_send(fluid)}
        >
          Send the model
        </button>
      )}
    </div>
  );
}

// Empty when there is nothing to say: no model, and none was tried.
export function model_notice(model: RobotModel, fluid: string | null, has_model: boolean): string {
  const name = fluid_text(model.fluid ?? '');
  const because = model.reason === '' ? '.' : `: ${model.reason}.`;
  switch (model.state) {
    case 'sending':
      return name ? `The model of ${name} is being sent.` : 'The confirmation of the model before is being taken back.';
    case 'confirmed':
      return name ? `The model of ${name} is in force, fit error ${percent(model.fit_error, 2)} %${because}` : '';
    case 'failed':
      return name ? `The model of ${name} could not be sent${because}` : `The model${because}`;
    case 'assumed':
      return fluid !== null && (has_model || model.fit_error !== null)
        ? `The model of ${fluid_text(fluid)} is not in force${because}`
        : '';
  }
}
