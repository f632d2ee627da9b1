// Three lamps, as on a flight deck: manual, auto with its sub-state, emergency with its cause. One is lit.

import { words } from '../format';
import type { Robot } from '../robot';

export function ModeAnnunciator({ robot, is_current }: { robot: Robot; is_current: boolean }) {
  const { robot_id, link, emergency_cause, firmware_version } = robot.state.value;
  const { mode, sub_state, stale } = robot.readout.value;
  const cell = (name: string, title: string, detail: string) => (
    <span class={`cell ${name} ${mode === name ? 'lit' : ''}`}>
      <b>{title}</b>
      {mode === name && detail && <i>{detail}</i>}
    </span>
  );
  const spoken = `${robot_id}: ${mode} ${mode === 'auto' ? words(sub_state) : mode === 'emergency' ? words(emergency_cause) : ''}`;
  return (
    <div class={`annunciator ${stale || !is_current ? 'stale' : ''}`} data-mode={mode}>
      <h1>
        {robot_id}
        <small>
          {!is_current ? 'cut off' : link === 'connected' ? `firmware ${firmware_version || '–'}` : 'not connected'}
        </small>
      </h1>
      <div class="cells" aria-hidden="true">
        {cell('manual', 'Manual', '')}
        {cell('auto', 'Auto', words(sub_state))}
        {cell('emergency', 'Emergency', words(emergency_cause))}
      </div>
      <span class="unseen" role="status" aria-live="assertive">
        {spoken}
      </span>
    </div>
  );
}
