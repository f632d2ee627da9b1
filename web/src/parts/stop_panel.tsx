// The emergency stop: one action, always in reach; below it the guarded way out of a latch, and what became of the stop.

import { age, words } from '../format';
import { stop_button_keys } from '../keys';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { words_of_all } from '../stop_outcome';
import { GuardedButton } from './hold_button';
import { OutcomeLine, useAsking } from './request';

export function StopPanel({ session }: { session: Session }) {
  const robot = session.store.selected.value;
  return (
    <section class="stop-panel" aria-label="Emergency stop">
      {/* SAFETY: acts when it goes down, not when it comes up again; Enter or a tool acts too, Space does not. */}
      <button
        type="button"
        id="emergency-stop"
        class="emergency-stop"
        aria-keyshortcuts="Escape"
        {...stop_button_keys}
        onPointerDown={(event) => event.button === 0 && session.stop_selected()}
        onClick={(event) => event.detail === 0 && session.stop_selected()}
      >
        <b>Emergency stop</b>
        <span>
          {robot ? `stops ${robot.state.value.robot_id}` : 'stops every robot'} <kbd>Esc</kbd>
        </span>
      </button>
      <div class="stop-below">
        {robot && <Latch session={session} robot={robot} key={robot.state.value.robot_id} />}
        <StopLine session={session} />
      </div>
    </section>
  );
}

function StopLine({ session }: { session: Session }) {
  const { phase } = session.stop_state.value;
  return (
    <p
      class={`stop-line ${phase}`}
      role="status"
      aria-live="assertive"
      id="stop-line"
      data-phase={phase}
      tabIndex={phase === 'idle' ? undefined : 0}
    >
      {stop_text(session)}
    </p>
  );
}

function stop_text(session: Session): string {
  const { phase, robot_id, answered_after_ms, outcome, problem } = session.stop_state.value;
  const who = robot_id ?? 'every robot';
  const ms = `${Math.round(answered_after_ms ?? 0)} ms`;
  const may_not = 'The stop may not have arrived:';
  const what_to_do = 'Press again, or cut the robot’s power.';
  switch (phase) {
    case 'idle':
      return '';
    case 'sent':
      return `Stop sent to ${who}…`;
    case 'late':
      return `${may_not} no answer yet. ${what_to_do}`;
    case 'seen':
      return robot_id === null
        ? 'Stopped: telemetry of every robot shows the latch.'
        : `Stopped: telemetry of ${who} shows the latch.`;
    case 'stopped':
      return robot_id === null && outcome
        ? words_of_all(outcome, ms)
        : `Stopped ${who} in ${ms}, from press to the robot's answer.`;
    case 'kept':
      if (robot_id !== null) return `Kept: will be delivered first when ${who} returns.`;
      return outcome
        ? words_of_all(outcome, ms)
        : 'Stopped all that are connected. Kept for the others: delivered first when they return.';
    case 'unanswered':
      if (robot_id === null && outcome) return words_of_all(outcome, ms);
      return `Sent, but ${who} has not answered yet. It is kept and sent first until it does.`;
    case 'failed':
      if (robot_id === null && outcome) return words_of_all(outcome, ms);
      return `${may_not} ${outcome?.reason ?? problem} ${what_to_do}`;
  }
}

// SAFETY: only whoever is in control may clear, and only on a picture that is current; the station checks it again.
export function may_clear(session: Session, robot: Robot): boolean {
  const { control, link } = robot.state.value;
  const me = session.me.value;
  const is_free_or_mine = control === null || control.holder === session.store.actor.value;
  return (
    session.store.is_current.value && link === 'connected' && me !== null && me.role !== 'viewer' && is_free_or_mine
  );
}

function Latch({ session, robot }: { session: Session; robot: Robot }) {
  const asking = useAsking();
  const { robot_id, emergency_cause, pending_stop, link } = robot.state.value;
  const { emergency_id, mode, stale, sample_age_ms } = robot.readout.value;
  const known_id = emergency_id ?? robot.state.value.emergency_id;
  if (mode !== 'emergency' && pending_stop === null) {
    return asking.outcome.value.phase === 'idle' ? null : <OutcomeLine asking={asking} />;
  }
  const clear = (id: string) =>
    asking
      .ask(`Clear ${id}`, () => session.api.clear_emergency(robot_id, id))
      .then((cleared) => cleared && session.emergency.forget());
  return (
    <div class="latch" id="latch" data-emergency-id={known_id ?? ''}>
      <h2>{mode === 'emergency' ? 'Latched: the motor stays off' : 'Stop not acknowledged yet'}</h2>
      <dl>
        <div>
          <dt>Cause</dt>
          <dd>{mode === 'emergency' ? words(emergency_cause) : 'operator'}</dd>
        </div>
        <div>
          <dt>Emergency</dt>
          <dd class="id">{known_id ?? 'not known yet'}</dd>
        </div>
      </dl>
      {pending_stop !== null && (
        <p>
          {link === 'connected'
            ? 'Sent; waiting for the robot.'
            : 'Kept: will be delivered first when the robot returns.'}
        </p>
      )}
      {stale && Number.isFinite(sample_age_ms) && <p>Last sample {age(sample_age_ms)} ago.</p>}
      {known_id !== null && pending_stop === null && (
        <>
          <WhoMayClear session={session} robot={robot} />
          {/* SAFETY: of another emergency it is another button: a hold that began before it clears nothing. */}
          <GuardedButton
            key={known_id}
            id="clear-emergency"
            disabled={!may_clear(session, robot) || asking.pending}
            on_held={() => void clear(known_id)}
          >
            Hold 1 s to clear {known_id.slice(-6).padStart(7, '…')}
          </GuardedButton>
        </>
      )}
      <OutcomeLine asking={asking} />
    </div>
  );
}

// Why the button below does nothing, if so.
function WhoMayClear({ session, robot }: { session: Session; robot: Robot }) {
  if (may_clear(session, robot)) return null;
  const { control, link } = robot.state.value;
  const { store, me } = session;
  const text = !store.is_current.value
    ? 'Cut off from the station: nothing can be cleared from here.'
    : link !== 'connected'
      ? 'The robot is not connected.'
      : control !== null && control.holder !== store.actor.value
        ? `${control.holder} is in control and may clear it.`
        : me.value?.role === 'viewer'
          ? 'An operator may clear it.'
          : '';
  return <p class="may-clear">{text}</p>;
}
