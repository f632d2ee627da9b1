// The large numerals, and a scale that shows position, reference and setpoint as one glance.

import { age, millimetres, millimetres_per_s, millivolts, percent } from '../format';
import type { Robot } from '../store';
import { Tape } from './tape';

export function Readouts({ robot }: { robot: Robot }) {
  const now = robot.readout.value;
  const error_m = now.position_m !== null && now.setpoint_m !== null ? now.position_m - now.setpoint_m : null;
  return (
    <section class={`readouts ${now.stale ? 'stale' : ''}`} aria-label="Measured now">
      <Numeral name="Position" unit="mm" value={millimetres(now.position_m)} kind="main" id="position">
        {now.stale
          ? Number.isFinite(now.sample_age_ms) ? `no sample for ${age(now.sample_age_ms)}` : 'no sample yet'
          : `± ${millimetres(now.position_sd_m)} standard deviation`}
      </Numeral>
      <Numeral name="Setpoint" unit="mm" value={millimetres(now.setpoint_m)} kind="setpoint" id="setpoint">
        {error_m === null ? 'none in force' : `off by ${millimetres(error_m)}`}
      </Numeral>
      <Numeral name="Duty" unit="%" value={percent(now.duty)} kind="duty" id="duty">
        <DutyBar duty={now.duty} />
      </Numeral>
      <Numeral name="Velocity" unit="mm/s" value={millimetres_per_s(now.velocity_m_s)} id="velocity" />
      <Numeral name="Impedance" unit="mV" value={millivolts(now.impedance_mv)} id="impedance" />
      <Tape robot={robot} />
    </section>
  );
}

interface NumeralProps {
  name: string;
  unit: string;
  value: string;
  id: string;
  kind?: 'main' | 'setpoint' | 'duty';
  children?: preact.ComponentChildren;
}

function Numeral({ name, unit, value, id, kind, children }: NumeralProps) {
  return (
    <div class={`numeral ${kind ?? ''}`} id={`numeral-${id}`}>
      <span class="label">{name}</span>
      <span class="value">
        <output>{value}</output>
        <span class="unit">{unit}</span>
      </span>
      <span class="foot">{children}</span>
    </div>
  );
}

// From the middle to the side that the motor pushes to.
function DutyBar({ duty }: { duty: number | null }) {
  const share = Math.max(-1, Math.min(1, duty ?? 0)) * 50;
  return (
    <span class="duty-bar" aria-hidden="true">
      <span style={{ left: `${50 + Math.min(0, share)}%`, width: `${Math.abs(share)}%` }} />
    </span>
  );
}
