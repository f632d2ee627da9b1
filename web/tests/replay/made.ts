// Recorded samples for the tests of a replay: 100 a second, the position is their number in millimetres.
import type { StoredSample } from '../../src/api';

export const kOrigin_us = 1_764_000_000_000_000;
export const kPeriod_us = 10_000;

export function sample(seq: number, change: Partial<StoredSample> = {}): StoredSample {
  return {
    span: 0,
    boot_id: '11',
    seq,
    robot_time_us: seq * kPeriod_us,
    utc_us: kOrigin_us + seq * kPeriod_us,
    clock_uncertainty_us: 300,
    first_received_at_us: 0,
    received_at_us: 0,
    mode: 'auto',
    sub_state: 'navigating',
    setpoint_m: 0.05,
    disturbance_m: -0.02,
    position_sd_m: 0.001,
    controller_id: 1,
    emergency_id: null,
    emergency_cause: 'none',
    flags: 0,
    unknown_values: null,
    position_m: seq / 1000,
    velocity_m_s: 0.1,
    acceleration_m_s2: 0,
    duty: 0.5,
    impedance_mv: 175,
    reference_m: 0.05,
    ...change,
  } as StoredSample;
}

// Samples `first` to `last` without those of a gap.
export const samples = (first: number, last: number, gap: [number, number] = [0, 0]) =>
  Array.from({ length: last - first }, (_, at) => first + at)
    .filter((seq) => seq < gap[0] || seq >= gap[1])
    .map((seq) => sample(seq));

export const at = (seq: number) => kOrigin_us + seq * kPeriod_us;
