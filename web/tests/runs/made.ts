// Runs, overviews and samples as the station would say them, with what a test is about filled in.

import type { Overview, Run, StoredSample } from '../../src/views/runs/runs_api';

export const made_run = (said: Partial<Run> = {}): Run => ({
  run_id: 1,
  robot_id: 'sim-1',
  state: 'ended',
  made_afterwards: false,
  made_by: 'token:local',
  name: 'a run',
  fluid: 'water',
  pump_profile: '',
  mean_flow_m_s: null,
  tube: '',
  operator_name: '',
  profile: '',
  notes: '',
  verdict: '',
  firmware_version: 'sim-0.1.0',
  controller_id: 1,
  controller_checksum: 1,
  parameters_checksum: 1,
  started_at_us: 1_000_000,
  ended_at_us: 2_000_000,
  spans: [{ boot_id: '7', first_seq: 0, last_seq: 99 }],
  samples_expected: 100,
  samples_stored: 100,
  samples_lost: 0,
  missed_ticks: 0,
  longest_missed_ticks: 0,
  experiment: null,
  interrupted: [],
  ...said,
});

// Points of one channel; `samples` of each, 10 ms apart, from a time on.
export function made_overview(points: { at_us: number; samples: number; min: number; max: number }[]): Overview {
  const column = { min: points.map(({ min }) => min), max: points.map(({ max }) => max) };
  return {
    source: 'rows',
    first_utc_us: points.map(({ at_us }) => at_us),
    last_utc_us: points.map(({ at_us, samples }) => at_us + (samples - 1) * 10_000),
    samples: points.map(({ samples }) => samples),
    position_m: column,
    duty: column,
    gaps: [],
    gaps_next: null,
  };
}

export const made_sample = (utc_us: number, said: Partial<StoredSample> = {}): StoredSample =>
  ({
    utc_us,
    robot_time_us: utc_us - 500_000,
    boot_id: '7',
    position_sd_m: 0.001,
    setpoint_m: null,
    disturbance_m: 0,
    ...said,
  }) as StoredSample;
