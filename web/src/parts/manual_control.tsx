// Manual: a duty that runs while the key is held, the way back from auto, and zeroing of the position.

import { why_no_command } from '../command_reason';
import { draft_of } from '../drafts';
import { percent, percent_to_duty } from '../format';
import type { Session } from '../session';
import type { Robot } from '../robot';
import { GamepadLine } from './gamepad_line';
import { HeldButton } from './hold_button';
import { OutcomeLine, useAsking } from './request';

export function ManualControl({ session, robot }: { session: Session; robot: Robot }) {
  const { robot_id, link } = robot.state.value;
  const { mode, duty } = robot.readout.value;
  const draft = draft_of(session, robot_id, 'duty');
  const duty_percent = Number(draft.value ?? 20);
  const asking = useAsking();
  const in_manual = mode === 'manual';
  const connected = link === 'connected';
  const reason = why_no_command(session, robot);
  const held = session.held.value;
  const running = held.robot_id === robot_id;
  // A duty that runs is ended by its own rules (session.hold), not by a button that is disabled under the hand because the
  // page was late for a moment.
  const drivable = connected && in_manual && session.phase.value === 'live';
  const may_hold = drivable && (running || reason === '');

  return (
    <fieldset class={`control manual ${in_manual ? 'engaged' : ''}`}>
      <legend>Manual</legend>
      {mode === 'auto' && (
        <button
          type="button"
          class="primary"
          id="to-manual"
          disabled={reason !== '' || asking.pending}
          title={reason}
          onClick={() => void asking.ask('Manual', () => session.api.set_manual(robot_id))}
        >
          Switch to manual, motor off
        </button>
      )}
      <label for="duty-entry">
        Duty <output class="figure">{percent(percent_to_duty(duty_percent), 0)} %</output>
      </label>
      <input
        id="duty-entry"
        class="duty-slider"
        type="range"
        min={-100}
        max={100}
        step={1}
        value={duty_percent}
        onInput={(event) => {
          draft.value = event.currentTarget.value;
          session.hold.change(percent_to_duty(event.currentTarget.valueAsNumber));
        }}
        onDblClick={() => (draft.value = '0')}
      />
      <span class="duty-marks" aria-hidden="true">
        <i />
        <i />
        <i />
      </span>
      <div class="pair">
        <HeldButton
          id="hold-to-run"
          class={`hold-to-run ${running ? 'running' : ''}`}
          disabled={!may_hold}
          title={reason}
          described_by="hold-outcome"
          on_press={() => session.hold.press(robot_id, percent_to_duty(duty_percent))}
          on_release={() => session.hold.release()}
        >
          {running ? 'Running: let go to stop' : 'Hold to run'}
        </HeldButton>
        <button
          type="button"
          id="zero-position"
          disabled={!drivable || reason !== '' || duty !== 0 || asking.pending}
          title={reason || 'Only at duty 0'}
          onClick={() => void asking.ask('Zero position', () => session.api.zero_position(robot_id))}
        >
          Zero position
        </button>
      </div>
      <GamepadLine
        session={session}
        robot_id={robot_id}
        why_not={may_hold ? '' : connected && !in_manual ? 'it acts in manual.' : 'the robot cannot be driven now.'}
        full_duty={percent_to_duty(duty_percent)}
      />
      {(held.error || held.lapsed) && (
        <p class="outcome failed" id="hold-outcome" role="alert">
          {held.error || 'The link was too slow to keep the motor running. Let go, then press again.'}
        </p>
      )}
      <OutcomeLine asking={asking} />
    </fieldset>
  );
}
