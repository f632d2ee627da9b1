// A disturbance: the robot adds a length to the position that its controller sees, as in Figure 7 of the paper.

import { why_no_command } from '../command_reason';
import { draft_of } from '../drafts';
import { millimetres, parse_millimetres } from '../format';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { OutcomeLine, useAsking } from './request';

export function DisturbanceControl({ session, robot }: { session: Session; robot: Robot }) {
  const { robot_id } = robot.state.value;
  const { mode, disturbance_m } = robot.readout.value;
  const draft = draft_of(session, robot_id, 'disturbance');
  const typed = draft.value ?? '\u221250.0';
  const asking = useAsking();
  const reason = why_no_command(session, robot);
  const possible = reason === '' && mode === 'auto' && !asking.pending;
  const wanted_m = parse_millimetres(typed);
  const is_disturbed = disturbance_m !== null && disturbance_m !== 0;

  const inject = (length_m: number | null) => {
    if (reason !== '' || mode !== 'auto') return;
    if (length_m === null) return asking.fail(`“${typed}” is not a length in millimetres.`);
    const what = length_m === 0 ? 'No disturbance' : `Disturbance of ${millimetres(length_m)} mm`;
    void asking.ask(what, () => session.api.inject_disturbance(robot_id, length_m));
  };
  return (
    <fieldset class="control disturbance">
      <legend>Disturbance</legend>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          inject(wanted_m);
        }}
      >
        <label for="disturbance-entry">Added to what the controller sees</label>
        <div class="entry">
          <span class="field">
            <input
              id="disturbance-entry"
              inputMode="decimal"
              autoComplete="off"
              value={typed}
              aria-describedby="disturbance-outcome"
              aria-invalid={wanted_m === null}
              onInput={(event) => {
                draft.value = event.currentTarget.value;
                asking.clear();
              }}
            />
            <span class="unit">mm</span>
          </span>
          <button type="submit" id="inject-disturbance" disabled={!possible} title={reason}>
            Inject
          </button>
          <button
            type="button"
            id="end-disturbance"
            disabled={!possible || !is_disturbed}
            title={reason}
            onClick={() => inject(0)}
          >
            End it
          </button>
        </div>
      </form>
      {mode !== 'auto' && <p class="quiet">Only in auto.</p>}
      <OutcomeLine asking={asking} id="disturbance-outcome" />
    </fieldset>
  );
}
