// Auto: the setpoint in millimetres, and the key that engages it.

import { why_no_command } from '../command_reason';
import { draft_of } from '../drafts';
import { m_to_millimetres, millimetres, millimetres_to_m, parse_millimetres } from '../format';
import type { Session } from '../session';
import type { Robot } from '../robot';
import { OutcomeLine, useAsking } from './request';

const kSteps_mm = [-10, -1, 1, 10];

export function AutoControl({ session, robot }: { session: Session; robot: Robot }) {
  const { robot_id } = robot.state.value;
  const { mode, setpoint_m } = robot.readout.value;
  const draft = draft_of(session, robot_id, 'setpoint');
  const asking = useAsking();
  const in_auto = mode === 'auto';
  const reason = why_no_command(session, robot);
  const possible = reason === '' && mode !== 'emergency';
  // Until something is typed: the setpoint in force, if there is one.
  const typed = draft.value ?? (in_auto && setpoint_m !== null ? millimetres(setpoint_m) : '100.0');
  const wanted_m = parse_millimetres(typed);

  const send = () => {
    if (!possible) return;
    if (wanted_m === null) return asking.fail(`“${typed}” is not a length in millimetres.`);
    const text = `${millimetres(wanted_m)} mm`;
    void (in_auto
      ? asking.ask(`Setpoint ${text}`, () => session.api.set_setpoint(robot_id, wanted_m))
      : asking.ask(`Auto at ${text}`, () => session.api.set_auto(robot_id, wanted_m)));
  };
  const step = (step_mm: number) => {
    const from_m = wanted_m ?? setpoint_m ?? 0;
    draft.value = millimetres(millimetres_to_m(m_to_millimetres(from_m) + step_mm));
    asking.clear();
  };
  const step_button = (step_mm: number) => (
    <button
      type="button"
      class="step"
      key={step_mm}
      onClick={() => step(step_mm)}
      aria-label={`${step_mm} millimetres`}
    >
      {step_mm > 0 ? `+${step_mm}` : `\u2212${-step_mm}`}
    </button>
  );
  return (
    <fieldset class={`control auto ${in_auto ? 'engaged' : ''}`}>
      <legend>Auto</legend>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          send();
        }}
      >
        <label for="setpoint-entry">Setpoint</label>
        <div class="entry">
          {kSteps_mm.slice(0, 2).map(step_button)}
          <span class="field">
            <input
              id="setpoint-entry"
              inputMode="decimal"
              autoComplete="off"
              value={typed}
              aria-describedby="setpoint-outcome"
              aria-invalid={wanted_m === null}
              onInput={(event) => {
                draft.value = event.currentTarget.value;
                asking.clear();
              }}
            />
            <span class="unit">mm</span>
          </span>
          {kSteps_mm.slice(2).map(step_button)}
        </div>
        <button
          type="submit"
          class="primary"
          id="send-setpoint"
          disabled={!possible || asking.pending}
          title={reason}
          aria-describedby={reason === '' ? undefined : 'setpoint-reason'}
        >
          {in_auto ? 'Send setpoint' : 'Engage auto at this setpoint'}
        </button>
      </form>
      {reason !== '' && (
        <p class="quiet" id="setpoint-reason">
          {reason}
        </p>
      )}
      <OutcomeLine asking={asking} id="setpoint-outcome" />
    </fieldset>
  );
}
