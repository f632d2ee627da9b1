// The emergency stop: one action, always in reach; below it what became of it, and the guarded way out of a latch.

import { age, words } from '../format';
import type { Session } from '../session';
import type { Robot } from '../store';
import { GuardedButton } from './hold_button';
import { OutcomeLine, useAsking } from './request';

export function StopPanel({ session }: { session: Session }) {
  const robot = session.store.selected.value;
  return (
    <section class="stop-panel" aria-label="Emergency stop">
      {/* SAFETY: acts when it goes down, not when it comes up again; a click by keyboard or by a tool acts too. */}
      <button
        type="button"
        id="emergency-stop"
        class="emergency-stop"
        aria-keyshortcuts="Escape"
        onPointerDown={(event) => event.button === 0 && session.stop_selected()}
        onClick={(event) => event.detail === 0 && session.stop_selected()}
      >
        <b>Emergency stop</b>
        <span>
          {robot ? `stops ${robot.state.value.robot_id}` : 'stops every robot'} <kbd>Esc</kbd>
        </span>
      </button>
      <div class="stop-below">
        <StopLine session={session} />
        {robot && <Latch session={session} robot={robot} key={robot.state.value.robot_id} />}
      </div>
    </section>
  );
}

function StopLine({ session }: { session: Session }) {
  const { phase, robot_id, answered_after_ms, detail } = session.stop_state.value;
  const who = robot_id ?? 'every robot';
  const ms = answered_after_ms === null ? '' : `${Math.round(answered_after_ms)} ms`;
  const text = {
    idle: '',
    sent: `Stop sent to ${who}…`,
    stopped: `Stopped ${detail} in ${ms}, from press to the robot's answer.`,
    kept: `Kept: will be delivered first when ${detail} returns.`,
    unanswered: `Sent, but ${detail} has not answered yet. It is kept and sent first until it does.`,
    failed: `The stop may not have arrived: ${detail} Press again, or cut the robot's power.`,
  }[phase];
  return (
    <p class={`stop-line ${phase}`} role="status" aria-live="assertive" id="stop-line" data-phase={phase}>
      {text}
    </p>
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
    asking.ask(`Clear ${id}`, () => session.api.clear_emergency(robot_id, id)).then((cleared) => cleared && session.emergency.forget());
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
        <p>{link === 'connected' ? 'Sent; waiting for the robot.' : 'Kept: will be delivered first when the robot returns.'}</p>
      )}
      {stale && Number.isFinite(sample_age_ms) && <p>Last sample {age(sample_age_ms)} ago.</p>}
      {known_id !== null && pending_stop === null && (
        <GuardedButton id="clear-emergency" disabled={link !== 'connected' || asking.pending} on_held={() => void clear(known_id)}>
          Hold 1 s to clear {known_id.slice(-6).padStart(7, '…')}
        </GuardedButton>
      )}
      <OutcomeLine asking={asking} />
    </div>
  );
}
