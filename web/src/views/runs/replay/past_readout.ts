// What the numerals show of a moment of a recorded run: its sample, or that there is none.

import { kNothingRead, model_of, type Readout } from '../../../robot';
import type { Column } from '../../../samples';
import type { Row } from './reel';

// `row`: the sample at or next before the moment. Later than one period after it the moment lies in a gap: then its values
// are those from before the gap, and marked so.
export function readout_at(row: Row | null, utc_us: number, gap_s: number): Readout {
  if (!row) return kNothingRead;
  const { situation } = row;
  const value = (column: Column) => row.value(column);
  const age_s = (utc_us - row.utc_us) / 1e6;
  const position_sd_m = value('position_sd_m');
  return {
    ...kNothingRead,
    estimate_m: value('estimate_m'),
    position_m: value('position_m'),
    position_sd_m,
    model: model_of(situation.flags, position_sd_m),
    setpoint_m: value('setpoint_m'),
    reference_m: value('reference_m'),
    duty: value('duty'),
    velocity_m_s: value('velocity_m_s'),
    impedance_mv: value('impedance_mv'),
    disturbance_m: value('disturbance_m'),
    mode: situation.mode,
    sub_state: situation.sub_state,
    emergency_id: situation.emergency_id,
    sample_age_ms: age_s * 1000,
    stale: age_s > gap_s,
  };
}
