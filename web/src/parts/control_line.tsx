// Who is in control of the robot, for everybody who looks; for operators the ways to take, to ask for and to give it.

import { useSignal } from '@preact/signals';
import type { ControlBody } from '../api';
import { useCloseOnEscape } from '../keys';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { GuardedButton } from './hold_button';
import { useKeptFocus } from './kept_focus';
import { OutcomeLine, useAsking } from './request';

export function ControlLine({ session, robot }: { session: Session; robot: Robot }) {
  const asking = useAsking();
  const root = useKeptFocus();
  const { robot_id, control } = robot.state.value;
  const me = session.store.actor.value;
  const is_current = session.store.is_current.value;
  const is_mine = is_current && control !== null && control.holder === me;
  const may_command = session.me.value?.role !== 'viewer';
  const change = (action: ControlBody['action'], what: string) =>
    void asking.ask(what, () => session.api.change_control(robot_id, { action }));
  const key = (id: string, text: string, action: ControlBody['action'], what: string, is_asked = false) => (
    <button
      type="button"
      id={id}
      disabled={!is_current || asking.pending || is_asked}
      onClick={() => change(action, what)}
    >
      {text}
    </button>
  );
  return (
    <div
      class={`control-line ${is_mine ? 'mine' : control && is_current ? 'other' : 'free'}`}
      id="control-line"
      ref={root}
      role="group"
      aria-label="Who is in control"
      data-holder={is_current ? (control?.holder ?? '') : ''}
    >
      <p>
        {is_current
          ? who(control?.holder ?? null, is_mine, may_command, robot.readout.value.mode === 'auto')
          : 'Cut off from the station: who controls the robot is not known.'}
      </p>
      {may_command && is_mine && control?.wished_by && (
        <>
          <p class="wish">{control.wished_by} asks for control.</p>
          {key('hand-over', 'Hand over', 'hand_over', 'Hand over')}
        </>
      )}
      {may_command && is_mine && key('release-control', 'Release', 'release', 'Release')}
      {may_command && is_current && control === null && key('take-control', 'Take control', 'take', 'Take control')}
      {may_command &&
        is_current &&
        control !== null &&
        !is_mine &&
        key(
          'ask-for-control',
          control.wished_by === me ? 'Asked' : 'Ask for control',
          'request',
          'Ask',
          control.wished_by === me,
        )}
      {session.me.value?.role === 'admin' && is_current && control !== null && !is_mine && (
        <Force
          key={control.holder}
          pending={asking.pending}
          on_force={(reason) =>
            void asking.ask('Take by force', () => session.api.change_control(robot_id, { action: 'force', reason }))
          }
        />
      )}
      <OutcomeLine asking={asking} />
    </div>
  );
}

// What is held belongs to one holder: of the next it is another button.
function Force({ pending, on_force }: { pending: boolean; on_force(reason: string): void }) {
  const open = useSignal(false);
  const reason = useSignal('');
  useCloseOnEscape(() => (open.value = false));
  const said = reason.value.trim();
  return (
    <>
      <button
        type="button"
        id="force-control"
        aria-expanded={open.value}
        aria-controls="force-form"
        onClick={() => (open.value = !open.value)}
      >
        By force…
      </button>
      {open.value && (
        <div class="force" id="force-form">
          <label for="force-reason">Reason, which is stored</label>
          <input
            id="force-reason"
            autoComplete="off"
            maxLength={200}
            value={reason.value}
            onInput={(event) => (reason.value = event.currentTarget.value)}
          />
          <GuardedButton id="force-now" disabled={said === '' || pending} on_held={() => on_force(said)}>
            Hold 1 s to take control by force
          </GuardedButton>
        </div>
      )}
    </>
  );
}

function who(holder: string | null, is_mine: boolean, may_command: boolean, is_auto: boolean): string {
  if (is_mine) return 'You are in control.';
  if (holder !== null) return `${holder} is in control. You may watch, and stop.`;
  if (is_auto) return 'Unattended: in auto, and nobody is in control.';
  return may_command
    ? 'Nobody is in control; your next command takes it.'
    : 'Nobody is in control. You may watch, and stop.';
}
