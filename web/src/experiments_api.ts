// What the page asks the station about experiments, their profiles, and reservations of robots.

import type { Fluid, Overview, RunRecord, StoredSample } from './api';
import type { components } from './api_types';
import { kOpenStates, type ExperimentSummary } from './experiments_store';

type Schemas = components['schemas'];
export type Experiment = Schemas['ExperimentWithProfile'];
export type ExperimentRun = Schemas['ExperimentRun'];
export type Knowledge = Schemas['ExperimentKnowledge'];
export type Prediction = Schemas['ExperimentPrediction'];
export type ExperimentBody = Schemas['ExperimentBody'];
export type ProfileEntry = Schemas['ExperimentProfileList']['profiles'][number];
export type Reservation = Schemas['Reservation'];
export type ReservationBody = Schemas['ReservationBody'];
export type Controller = Schemas['Controller'];
export type Parameter = Schemas['Parameter'];
export type CommandLimits = Schemas['CommandLimits'];
export interface FluidsInForce {
  fluids: Fluid[];
  limits_where_unknown: CommandLimits;
}

export type Ask = <Answer>(method: string, path: string, body?: object) => Promise<Answer>;

const kPage = 50; // of history and of reservations
const kMostOpen = 1000;
const robot_path = (robot_id: string) => `/robots/${encodeURIComponent(robot_id)}`;
const query_of = (members: Record<string, string | number | null>) =>
  new URLSearchParams(
    Object.entries(members).flatMap(([name, value]) => (value === null || value === '' ? [] : [[name, `${value}`]])),
  ).toString();

export class ExperimentsApi {
  constructor(private readonly ask: Ask) {}

  profiles = async () => (await this.ask<{ profiles: ProfileEntry[] }>('GET', '/experiment-profiles')).profiles;
  profile = async (name: string) =>
    (await this.ask<{ document: string }>('GET', `/experiment-profiles/${encodeURIComponent(name)}`)).document;

  // Everything that has not ended, of all robots.
  open = async (): Promise<ExperimentSummary[]> => {
    const lists = await Promise.all(
      kOpenStates.map((state) =>
        this.ask<{ experiments: ExperimentSummary[] }>('GET', `/experiments?${query_of({ state, limit: kMostOpen })}`),
      ),
    );
    return lists.flatMap(({ experiments }) => experiments);
  };
  // Newest first; `before` null: from the newest on.
  page = async (robot_id: string, before: number | null) => {
    const path = `/experiments?${query_of({ robot_id, before, limit: kPage })}`;
    const { experiments, next } = await this.ask<Schemas['ExperimentList']>('GET', path);
    return { experiments, is_last: next === null };
  };
  one = (experiment_id: number) => this.ask<Experiment>('GET', `/experiments/${experiment_id}`);
  prediction = (experiment_id: number, run: number) =>
    this.ask<Prediction>('GET', `/experiments/${experiment_id}/runs/${run}/prediction`);

  // What the plots of a robot ask for.
  predictions_of = (robot_id: string) => ({
    experiments: async () => (await this.page(robot_id, null)).experiments,
    one: this.one,
    prediction: this.prediction,
    first_sample: this.first_sample,
    first_wait_us: this.first_wait_us,
  });
  first_sample = async (run_id: number) =>
    (await this.ask<{ samples: StoredSample[] }>('GET', `/runs/${run_id}/samples?limit=1`)).samples[0] ?? null;
  // The robot's clock where a run was interrupted first, and the line of its prediction stood still; null: it was not.
  first_wait_us = async (run_id: number) =>
    (await this.ask<RunRecord>('GET', `/runs/${run_id}`)).interrupted[0]?.from_robot_time_us ?? null;
  // Where the robot believed that it was in a run, from a moment on.
  estimate_in = (run_id: number, from_us: number, points: number) => {
    const channels = 'estimated_position_m,position_sd_m';
    return this.ask<Overview>('GET', `/runs/${run_id}/overview?${query_of({ from_us, points, channels })}`);
  };

  begin = (body: ExperimentBody) => this.ask<Experiment>('POST', '/experiments', body);
  pause = (experiment_id: number) => this.act(experiment_id, 'pause');
  resume = (experiment_id: number) => this.act(experiment_id, 'resume');
  abort = (experiment_id: number) => this.act(experiment_id, 'abort');
  take_over = (experiment_id: number) => this.act(experiment_id, 'take-over');
  move_before = (experiment_id: number, before: number) => this.act(experiment_id, 'move', { before });

  controller = async (robot_id: string) =>
    (await this.ask<{ controller: Controller | null }>('GET', `${robot_path(robot_id)}/controller`)).controller;
  fluids = () => this.ask<FluidsInForce>('GET', '/fluids');
  newest_run = async (robot_id: string) =>
    (await this.ask<{ runs: RunRecord[] }>('GET', `/runs?${query_of({ robot_id, limit: 1 })}`)).runs[0] ?? null;

  // Those that are not over, the next one first.
  reservations = async () => {
    const path = `/reservations?${query_of({ over: 'false', limit: kMostOpen })}`;
    const { reservations } = await this.ask<{ reservations: Reservation[] }>('GET', path);
    return reservations.sort((a, b) => a.from_us - b.from_us);
  };
  past_reservations = async (before: number | null) => {
    const path = `/reservations?${query_of({ over: 'true', before, limit: kPage })}`;
    const { reservations, next } = await this.ask<Schemas['ReservationList']>('GET', path);
    return { reservations, is_last: next === null };
  };
  reserve = (robot_id: string, body: ReservationBody) =>
    this.ask<Reservation>('POST', `${robot_path(robot_id)}/reservations`, body);
  cancel_reservation = (reservation_id: number) =>
    this.ask<Reservation>('POST', `/reservations/${reservation_id}/cancel`);

  private act(experiment_id: number, what: string, body?: object): Promise<ExperimentSummary> {
    return this.ask<ExperimentSummary>('POST', `/experiments/${experiment_id}/${what}`, body);
  }
}

// The account that an actor belongs to: a user with all their pages and tokens, a token, or the page of a one-time link.
export const account_of = (actor: string) => (actor.startsWith('user:') ? actor.split('/')[0]! : actor);
