// One experiment as a station reports it, for the tests.
import type { ExperimentSummary } from '../../src/experiments_store';

export const experiment = (experiment_id: number, change: Partial<ExperimentSummary> = {}): ExperimentSummary => ({
  experiment_id,
  robot_id: 'sim-1',
  name: `Experiment ${experiment_id}`,
  state: 'waiting',
  reason: null,
  detail: null,
  waits_for: null,
  waits_for_detail: null,
  held: false,
  priority: 0,
  unattended: false,
  notes: '',
  owner: 'session:1',
  acts_for: 'session:1',
  client: null,
  runs_planned: 1,
  duration_s: 40,
  created_at_us: experiment_id * 1000,
  started_at_us: null,
  ended_at_us: null,
  run_counts: {},
  progress: null,
  activity: null,
  ...change,
});
