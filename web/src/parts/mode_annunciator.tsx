// Three lamps, as on a flight deck: manual, auto with its sub-state, emergency with its cause. One is lit.

import type { ComponentChildren } from 'preact';
import { words } from '../format';
import type { Robot } from '../robot';

export function ModeAnnunciator({ robot, is_current }: { robot: Robot; is_current: boolean }) {
  const { robot_id, link, emergency_cause, firmware_version } = robot.state.value;
  const { mode, sub_state, stale } = robot.readout.value;
  const note = !is_current ? 'cut off' : link === 'connected' ? `firmware ${firmware_version || '–'}` : 'not connected';
  const spoken = `${robot_id}: ${mode} ${mode === 'auto' ? words(sub_state) : mode === 'emergency' ? words(emergency_cause) : ''}`;
  return (
    <Annunciator
      name={robot_id}
      note={note}
      lamps={{ mode, sub_state, emergency_cause }}
      is_stale={stale || !is_current}
    >
      <span class="unseen" role="status" aria-live="assertive">
        {spoken}
      </span>
    </Annunciator>
  );
}

interface AnnunciatorProps {
  name: string;
  note: string;
  lamps: { mode: string; sub_state: string; emergency_cause: string };
  is_stale: boolean;
  children: ComponentChildren; // the same for a screen reader
}

export function Annunciator({ name, note, lamps, is_stale, children }: AnnunciatorProps) {
  const { mode, sub_state, emergency_cause } = lamps;
  const cell = (sort: string, title: string, detail: string) => (
    <span class={`cell ${sort} ${mode === sort ? 'lit' : ''}`}>
      <b>{title}</b>
      {mode === sort && detail && <i>{detail}</i>}
    </span>
  );
  return (
    <div class={`annunciator ${is_stale ? 'stale' : ''}`} data-mode={mode}>
      <h1>
        {name}
        <small>{note}</small>
      </h1>
      <div class="cells" aria-hidden="true">
        {cell('manual', 'Manual', '')}
        {cell('auto', 'Auto', words(sub_state))}
        {cell('emergency', 'Emergency', words(emergency_cause))}
      </div>
      {children}
    </div>
  );
}
