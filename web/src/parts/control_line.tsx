// Who is in control of the robot, and the ways to take control, to ask for it and to give it.

import type { ControlBody } from '../api';
import type { Session } from '../session';
import type { Robot } from '../store';
import { OutcomeLine, useAsking } from './request';

export function ControlLine({ session, robot }: { session: Session; robot: Robot }) {
  const asking = useAsking();
  const { robot_id, control } = robot.state.value;
  const me = session.store.actor.value;
  const is_mine = control !== null && control.holder === me;
  const change = (action: ControlBody['action'], what: string) =>
    void asking.ask(what, () => session.api.change_control(robot_id, { action }));
  return (
    <div class={`control-line ${is_mine ? 'mine' : control ? 'other' : 'free'}`} id="control-line" data-holder={control?.holder ?? ''}>
      <p>{who(control?.holder ?? null, is_mine, robot.readout.value.mode === 'auto')}</p>
      {is_mine && control.wished_by !== null && (
        <>
          <p class="wish">{control.wished_by} asks for control.</p>
          <button type="button" id="hand-over" disabled={asking.pending} onClick={() => change('hand_over', 'Hand over')}>
            Hand over
          </button>
        </>
      )}
      {is_mine && (
        <button type="button" id="release-control" disabled={asking.pending} onClick={() => change('release', 'Release')}>
          Release
        </button>
      )}
      {control === null && (
        <button type="button" id="take-control" disabled={asking.pending} onClick={() => change('take', 'Take control')}>
          Take control
        </button>
      )}
      {control !== null && !is_mine && (
        <button type="button" id="ask-for-control" disabled={asking.pending || control.wished_by === me} onClick={() => change('request', 'Ask')}>
          {control.wished_by === me ? 'Asked' : 'Ask for control'}
        </button>
      )}
      <OutcomeLine asking={asking} />
    </div>
  );
}

function who(holder: string | null, is_mine: boolean, is_auto: boolean): string {
  if (is_mine) return 'You are in control.';
  if (holder !== null) return `${holder} is in control. You may watch, and stop.`;
  return is_auto ? 'Unattended: in auto, and nobody is in control.' : 'Nobody is in control; your next command takes it.';
}
