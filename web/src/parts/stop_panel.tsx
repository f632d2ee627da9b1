// The stop: one action, always in reach, with the way that it would take now; below it the guarded way out of a latch, and
// what became of the stop.

import { stop_button_keys } from '../keys';
import type { Session } from '../session';
import { words_of_all } from '../stop_outcome';
import { latency_text, readiness_of } from '../stop_path';
import { Latch } from './latch';
import { StopNote } from './stop_note';

export function StopPanel({ session }: { session: Session }) {
  const robot = session.store.selected.value;
  const readiness = readiness_of(
    session.stop_path.hindrance.value,
    session.vitals.now.value.page_ms,
    robot && robot.state.value,
  );
  const who = robot ? robot.robot_id : 'every robot';
  return (
    <section class="stop-panel" aria-label="Stop">
      {/* SAFETY: acts when it goes down, not when it comes up again; Enter or a tool acts too, Space does not. It is never
          disabled: what cannot be sent now is sent when it can. */}
      <button
        type="button"
        id="emergency-stop"
        class={`emergency-stop ${readiness.works ? '' : 'hindered'}`}
        aria-keyshortcuts="Escape"
        aria-describedby="stop-path"
        data-works={readiness.works}
        {...stop_button_keys}
        onPointerDown={(event) => event.button === 0 && session.stop_selected()}
        onClick={(event) => event.detail === 0 && session.stop_selected()}
      >
        <b>Stop</b>
        <span class="whom">
          stops {who} <kbd>Esc</kbd>
        </span>
        <span class="path" id="stop-path" title={readiness.why || readiness.parts}>
          {readiness.works ? latency_text(readiness) : readiness.text}
        </span>
      </button>
      <div class="stop-below">
        {robot && <Latch session={session} robot={robot} key={robot.robot_id} />}
        <StopLine session={session} />
        <StopNote why={readiness.why} parts={readiness.parts} />
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

const kKept = 'It goes again by itself when the station answers.';

function stop_text(session: Session): string {
  const { phase, robot_id, answered_after_ms, outcome, problem, is_kept } = session.stop_state.value;
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
      return `${may_not} ${outcome?.reason ?? problem} ${is_kept ? `${kKept} ` : ''}${what_to_do}`;
  }
}
