// The latch of a robot, named by its time and cause, and the guarded way out of it.

import { age } from '../format';
import { shows_past } from '../past_guard';
import type { Robot } from '../robot';
import { format, route } from '../route';
import type { Session } from '../session';
import { GuardedButton } from './hold_button';
import { useKeptFocus } from './kept_focus';
import { OutcomeLine, useAsking } from './request';

// SAFETY: only the actor in control may clear, and only on a picture that is current; the station checks it again.
export function may_clear(session: Session, robot: Robot): boolean {
  const { control, link } = robot.state.value;
  const me = session.me.value;
  const is_free_or_mine = control === null || control.holder === session.store.actor.value;
  return (
    session.store.is_current.value && link === 'connected' && me !== null && me.role !== 'viewer' && is_free_or_mine
  );
}

export function Latch({ session, robot }: { session: Session; robot: Robot }) {
  const asking = useAsking();
  const root = useKeptFocus();
  const { robot_id, emergency_cause, pending_stop, link } = robot.state.value;
  const { emergency_id, mode, stale, sample_age_ms } = robot.readout.value;
  const known_id = emergency_id ?? robot.state.value.emergency_id;
  if (mode !== 'emergency' && pending_stop === null) {
    return asking.outcome.value.phase === 'idle' ? null : <OutcomeLine asking={asking} />;
  }
  const name = known_id === null ? '' : session.store.latches.name(known_id, emergency_cause);
  const clear = async (id: string) => {
    const press = session.emergency.newest_press;
    const is_cleared = await asking.ask(`Clear “${name}”`, () => session.api.clear_emergency(robot_id, id));
    if (is_cleared) session.emergency.cleared(robot_id, press);
  };
  return (
    <div class="latch" id="latch" ref={root} data-emergency-id={known_id ?? ''}>
      <h2>{mode === 'emergency' ? 'Latched: the motor stays off' : 'Stop not acknowledged yet'}</h2>
      <p class="latch-name">
        <b>{robot_id}</b> {mode === 'emergency' ? name || 'cause not known yet' : 'operator'}
      </p>
      {pending_stop !== null && (
        <p>
          {link === 'connected'
            ? 'Sent; waiting for the robot.'
            : 'Kept: will be delivered first when the robot returns.'}
        </p>
      )}
      {stale && Number.isFinite(sample_age_ms) && <p>Last sample {age(sample_age_ms)} ago.</p>}
      {known_id !== null && pending_stop === null && shows_past(route.value) && (
        <p class="may-clear">
          A replay is shown. <a href={format({ view: 'robot', parts: [robot_id] })}>Open {robot_id}</a> to clear it.
        </p>
      )}
      {/* SAFETY: beside a replay there is no control of a robot but the stop. */}
      {known_id !== null && pending_stop === null && !shows_past(route.value) && (
        <>
          <WhoMayClear session={session} robot={robot} />
          {/* SAFETY: of another emergency it is another button: a hold that began before it clears nothing. */}
          <GuardedButton
            key={known_id}
            id="clear-emergency"
            disabled={!may_clear(session, robot) || asking.pending}
            on_held={() => void clear(known_id)}
          >
            Hold 1 s to clear: {name}
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
