// The large numerals.
//
// Two positions stand side by side, always: where the robot believes that it is, and what its controller sees, which a
// disturbance moves away from that. Each has its "±" and its own distance to the setpoint.

import { age, millimetres, millimetres_per_s, millivolts, percent, plus_minus } from '../format';
import type { Robot } from '../robot';
import type { Channel } from '../thresholds';
import { alerts_of } from './threshold_list';

// Of a robot that is looked at, or of a run that is replayed.
export function Readouts({ robot, label = 'Measured now' }: { robot: Pick<Robot, 'readout'>; label?: string }) {
  const now = robot.readout.value;
  const beyond = (channel: Channel) =>
    !now.stale && alerts_of(robot).alerts.value.some((alert) => alert.channel === channel && alert.is_beyond);
  const silent = Number.isFinite(now.sample_age_ms) ? `no sample for ${age(now.sample_age_ms)}` : 'no sample yet';
  return (
    <section class={`readouts ${now.stale ? 'stale' : ''}`} aria-label={label}>
      <Numeral
        name="Position, estimated"
        unit="mm"
        value={millimetres(now.estimate_m)}
        kind="main"
        id="position"
        is_beyond={beyond('estimate_m')}
      >
        <span>
          {[`${plus_minus(now.position_sd_m)} mm (2 sd)`, now.stale ? '' : off_by(now.estimate_m, now.setpoint_m)]
            .filter(Boolean)
            .join(', ')}
        </span>
        {now.stale ? <span class="silent">{silent}</span> : <span>{now.model}</span>}
      </Numeral>
      <Numeral name="Controller sees" unit="mm" value={millimetres(now.position_m)} kind="seen" id="seen">
        <span>
          {[plus_minus(now.position_sd_m), now.stale ? '' : off_by(now.position_m, now.setpoint_m)]
            .filter(Boolean)
            .join(', ')}
        </span>
        <span class={now.disturbance_m ? 'disturbed' : ''} id="disturbance">
          disturbance {millimetres(now.disturbance_m)} mm
        </span>
      </Numeral>
      <Numeral name="Setpoint" unit="mm" value={millimetres(now.setpoint_m)} kind="setpoint" id="setpoint">
        {now.setpoint_m === null ? 'none in force' : ''}
      </Numeral>
      <Numeral name="Duty" unit="%" value={percent(now.duty)} kind="duty" id="duty" is_beyond={beyond('duty')}>
        <DutyBar duty={now.duty} />
      </Numeral>
      <div class="numeral-pair">
        <Numeral
          name="Velocity"
          unit="mm/s"
          value={millimetres_per_s(now.velocity_m_s)}
          kind="small"
          id="velocity"
          is_beyond={beyond('velocity_m_s')}
        />
        <Numeral
          name="Impedance"
          unit="mV"
          value={millivolts(now.impedance_mv)}
          kind="small"
          id="impedance"
          is_beyond={beyond('impedance_mv')}
        />
      </div>
    </section>
  );
}

const off_by = (position_m: number | null, setpoint_m: number | null) =>
  position_m === null || setpoint_m === null ? '' : `off by ${millimetres(position_m - setpoint_m)}`;

interface NumeralProps {
  name: string;
  unit: string;
  value: string;
  id: string;
  kind?: 'main' | 'seen' | 'setpoint' | 'duty' | 'small';
  is_beyond?: boolean; // a threshold of this browser
  children?: preact.ComponentChildren;
}

function Numeral({ name, unit, value, id, kind, is_beyond = false, children }: NumeralProps) {
  return (
    <div class={`numeral ${kind ?? ''} ${is_beyond ? 'beyond' : ''}`} id={`numeral-${id}`}>
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
