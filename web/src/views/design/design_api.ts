// What the view Design asks of the station, and what its jobs answer, as far as the page reads it.

import type { Api, CommandRecord, RobotModel } from '../../api';
import type { components } from '../../api_types';
import type { Controller } from '../../experiments_api';
import type { RunMetrics } from '../runs/runs_api';
import type { Discretised } from './control_law';
import type { Law, Plant, Specification } from './frequency';
import type { Job, JobBody, JobsApi } from './jobs';

type Schemas = components['schemas'];
export type StoredDesign = Schemas['Design'];
export type StoredDesignWithDocument = Schemas['DesignWithDocument'];
export type DesignComparison = Schemas['DesignComparison'];
export type ControllerInForce = Schemas['ControllerInForce'];
export type SamplePage = Schemas['SamplePage'];

export const kParameters = ['kp', 'b1', 'b2', 'alpha', 'beta'] as const;
export type Parameter = (typeof kParameters)[number];

export interface Quality {
  fit_percent: number | null;
  residual_sd: number | null;
  residuals_are_white?: boolean;
  whiteness_p_value?: number | null;
  drift_factor?: number;
}

export interface Fit extends Quality {
  structure: 'first_order' | 'second_order' | 'fractional';
  parameters: Plant;
  one_sigma: Record<Parameter, number | null>;
  dead_time_s: number;
  dead_time_sigma_s: number | null;
  aic: number;
  end: string;
}

export interface Residuals {
  position_m: (number | null)[];
  velocity_m_s: (number | null)[];
  acceleration_m_s2: (number | null)[];
}

export interface FitOfRun extends Quality {
  run_id: number;
  channels: string[];
  warnings?: string[];
  residuals?: Residuals;
}

export interface Identified extends Fit {
  warnings: string[];
  doubts?: { code: string; parameter?: string }[];
  compared: Fit[];
  channels: string[];
  channels_reason?: string;
  residuals?: Residuals;
  run_id?: number;
  runs?: FitOfRun[];
  validation: (Quality & { run_id: number }) | null;
  model_in_use: (Quality & { fluid: string; parameters: Plant; runs?: FitOfRun[] }) | null;
}

export interface Achieved {
  gain_crossover_rad_s: number;
  phase_margin_deg: number;
  phase_slope_deg_per_rad_s: number;
  ms: number;
  mt: number;
  gain_margin_db: number | null;
  is_closed_loop_stable: boolean;
  phase_slope_sigma_deg_per_rad_s?: number | null;
  phase_margin_sigma_deg?: number | null; // by the sigmas of the model's fit; null: not known
  crossover_sigma_rad_s?: number | null;
}

export interface Measures {
  settling_s: number | null;
  overshoot_percent: number | null;
  rise_10_90_s: number | null;
  steady_state_error_m: number | null;
}

export interface Predicted {
  fluid: string | null; // null: the plant that was tuned for
  step: Measures;
  disturbance: Measures;
  clipped_fraction: number;
  is_diverging: boolean;
  experiment: {
    setpoint_m: number;
    disturbance_m: number;
    disturbance_at_s: number;
    duration_s: number;
    duty_min: number;
    duty_max: number;
  };
  plant: Plant;
}

export interface Near extends Law, Specification {
  name: string;
  achieved: Achieved;
  sampled: Achieved; // as the robot runs it, which holds its duty for a period
}

export interface RobustnessRow {
  name: string;
  step: Measures;
  disturbance: Measures;
  duty_min: number;
  duty_max: number;
  is_stable: boolean;
  is_diverging: boolean;
}

export interface Tuned extends Law {
  feasible: boolean;
  reason?: string;
  achieved: Achieved;
  sampled: Achieved;
  nearest_all: Near[];
  relaxed: Near[];
  asked: Specification;
  plant: Plant;
  warnings?: string[]; // about a controller that is found
  discretised: Discretised | null;
  robustness: { rows: RobustnessRow[]; duty_sd_per_noise_sd: number } | null;
  plant_doubts_text?: string; // a line for people; empty: nothing is in doubt
  predicted: Predicted[];
}

export interface MapPoint {
  crossover_rad_s: number;
  ranges_deg: [number, number][];
  reason: string;
  phase_fall: number;
}
export interface TuningMap {
  points: MapPoint[];
  plant: Plant;
}

export interface Pushed {
  design_id: number;
  verified: boolean;
  command: CommandRecord;
  in_force: ControllerInForce;
}

const kPushPatience_ms = 20_000; // the station discretises, sends, and waits 5 s for what the robot reports
const robot_path = (robot_id: string) => `/robots/${encodeURIComponent(robot_id)}`;

// `stamp_us`: the latest of the live link; null while it is down.
export class DesignApi implements JobsApi {
  constructor(
    private readonly api: Pick<Api, 'ask' | 'read' | 'change'>,
    private readonly stamp_us: () => number | null,
  ) {}

  begin = (body: JobBody) => this.api.change<Job>('/jobs', body);
  look = (job_id: number, wait_ms: number) => this.api.read<Job>(`/jobs/${job_id}?wait_ms=${wait_ms}`);
  cancel = (job_id: number) => this.api.ask<unknown>('POST', `/jobs/${job_id}/cancel`);
  wait = (time_ms: number) => new Promise<void>((done) => setTimeout(done, time_ms));

  designs = async () => (await this.api.read<{ designs: StoredDesign[] }>('/designs?limit=200')).designs;
  design = (design_id: number) => this.api.read<StoredDesignWithDocument>(`/designs/${design_id}`);
  compare = (ids: number[]) => this.api.read<DesignComparison>(`/design-comparison?ids=${ids.join(',')}`);
  keep = (kind: StoredDesign['kind'], name: string, job_id: number) =>
    this.api.change<StoredDesign>('/designs', { kind, name, job_id });

  in_force = (robot_id: string) => this.api.read<ControllerInForce>(`${robot_path(robot_id)}/controller`);
  metrics = (run_id: number) => this.api.read<RunMetrics>(`/runs/${run_id}/metrics`);
  samples = (run_id: number, after: string | null) =>
    this.api.read<SamplePage>(`/runs/${run_id}/samples?limit=10000${after === null ? '' : `&after=${after}`}`);

  // SAFETY: as every command of this page these carry the latest stamp, so that one that was delayed does nothing.
  push = (robot_id: string, design_id: number, is_confirmed: boolean) =>
    this.api.ask<Pushed>(
      'POST',
      `${robot_path(robot_id)}/controller`,
      { design_id, stamp_us: this.stamp(), ...(is_confirmed ? { confirm: true } : {}) },
      undefined,
      { patience_ms: kPushPatience_ms },
    );
  send_model = (robot_id: string, fluid: string, model: EstimatorBody) =>
    this.api.ask<{ model: RobotModel }>('POST', `${robot_path(robot_id)}/model`, { fluid, model });
  restore = (robot_id: string, is_confirmed: boolean) =>
    this.api.ask<CommandRecord>(
      'POST',
      `${robot_path(robot_id)}/commands?wait=verified`,
      { kind: 'restore_controller', stamp_us: this.stamp(), ...(is_confirmed ? { confirm: true } : {}) },
      undefined,
      { patience_ms: kPushPatience_ms },
    );

  private stamp(): number {
    const stamp_us = this.stamp_us();
    if (stamp_us === null) throw new Error('The live connection is down: the controller was not sent.');
    return stamp_us;
  }
}

// The coefficients of a kept controller, as the robot runs it; null where its document has none.
export function discretised_of(document: unknown): Discretised | null {
  const found = (document as { discretised?: Discretised | null } | null)?.discretised;
  return found?.sections ? found : null;
}

// What a robot's estimator is sent, with the doubts by which the station judges it.
export interface EstimatorBody {
  model_gain_m_s: number[];
  model_time_constant_s: number[];
  fit_error: number;
  plant: Plant | null;
  name: string;
  doubts: unknown[];
}

// Null where a kept model has none: it was typed. Of a fit whose doubts nobody knows none is sent.
export function estimator_of(kept: { name: string; document: unknown }): EstimatorBody | { refused: string } | null {
  const { estimator, doubts } = (kept.document ?? {}) as {
    estimator?: Omit<EstimatorBody, 'plant' | 'name' | 'doubts'> | { refused: string } | null;
    doubts?: unknown[] | null;
  };
  if (!estimator || 'refused' in estimator) return estimator ?? null;
  if (!doubts) return { refused: 'an earlier version found it, and did not keep what is in doubt; identify it again' };
  return { ...estimator, plant: plant_of(kept.document), name: kept.name, doubts };
}

// Doubts about the model that a kept controller was tuned for, in a line; empty: none, or nobody has said.
export function plant_doubts_of(document: unknown): string {
  const text = (document as { plant_doubts_text?: unknown } | null)?.plant_doubts_text;
  return typeof text === 'string' ? text : '';
}

export function plant_of(document: unknown): Plant | null {
  const given = document as Partial<Plant> & { parameters?: Plant };
  const plant = { b3: 1, dead_time_s: 0, ...(given.parameters ?? given) } as Plant;
  return [plant.kp, plant.b1, plant.b2, plant.b3, plant.alpha, plant.beta].every(Number.isFinite) ? plant : null;
}

export type { Controller };
