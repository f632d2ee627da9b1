// The station's HTTP API as the page uses it: one function for each thing that is asked, errors as sentences.
//
// The types are generated from server/api/openapi.yaml (npm run types), so that a difference is a compile error.

import type { components } from './api_types';
import { millimetres, percent } from './format';
import { kReasons } from './reasons';
import { outcome_of, type StopOutcome } from './stop_outcome';
import { kSampleFields } from './telemetry_fields';

type Schemas = components['schemas'];
export type Fluid = Schemas['Fluid'];
export type RobotModel = Schemas['RobotModel'];
export type RobotState = Schemas['Robot'] & { retired?: boolean };
export type CommandRecord = Schemas['Command'];
export type CommandBody = Schemas['CommandBody'];
export type Control = Schemas['Control'];
export type ControlBody = Schemas['ControlBody'];
export type EventRecord = Schemas['Event'];
export type RunRecord = Schemas['Run'];
export type MarkerRecord = Schemas['Marker'];
export type Overview = Schemas['Overview'];
export type ParametersInForce = Schemas['ParametersInForce'];
export type ControllerInForce = Schemas['ControllerInForce'];
export type Station = Schemas['Station'];
export type StoredSample = Schemas['StoredSample'];
export type Recording = Schemas['Recording'];
export type Me = Schemas['Me'];
export type User = Schemas['User'];
export type Token = Schemas['Token'];
export type PageSession = Schemas['PageSession'];
export type Enrolment = Schemas['Enrolment'] & { retired_at_us?: number | null; retired_by?: string };
export type SamplesMessage = Schemas['LiveSamples'];
export type LiveMessage = Schemas['LiveServerMessage'];
export type ClientMessage = Schemas['LiveClientMessage'];
type Problem = Schemas['Problem'];

// What the station says of a stop of every robot; one of an older version says only what became of each command.
export interface StopSummary {
  robots: number; // the sum of the five below
  acknowledged: number;
  unanswered: number;
  failed: number;
  kept: number;
  left_out: number;
  not_acknowledged: { robot_id: string; outcome: 'failed' | 'unanswered' | 'kept' }[];
  not_named: number;
}
interface StopOfAll {
  summary?: StopSummary;
  commands: CommandRecord[];
}

// A refusal or failure. `message` is a sentence for the operator; `reason` the station's identifier, "" when unknown.
export class ApiError extends Error {
  constructor(
    message: string,
    readonly status: number, // 0: no answer at all
    readonly reason = '',
    readonly detail = '', // what the station says beyond the sentence
    readonly content: unknown = null, // all that it answered
  ) {
    super(message);
  }
}

// Whether the station itself has dealt with what it was asked. A proxy in front of it answers without a `reason`; a station
// that is too busy, or not ready, has not looked at it. Its own 504 has one: the command was sent, and the robot is silent.
export const is_answer_of_station = (error: unknown): boolean =>
  error instanceof ApiError && error.reason !== '' && ![0, 429, 502, 503].includes(error.status);

export type Fetch = (path: string, options: RequestInit) => Promise<Response>;

const kOverviewChannels = [
  ...kSampleFields,
  'setpoint_m',
  'disturbance_m',
  'position_sd_m',
  'estimated_position_m',
].join(',');
const kPatience_ms = 6000;
// For what is computed from many samples, and for changes that move nothing: the station makes a hash of a password, or
// writes a back-up, and a page that gives up early says of what was done that it was not answered.
const kLongPatience_ms = 30_000;

export class Api {
  // `stamp_us`: the latest of the live link, null while it is down; a command is worth as little as what its operator saw
  // was old.
  constructor(
    private readonly fetch: Fetch,
    private readonly stamp_us?: () => number | null,
  ) {}

  set_manual = (robot_id: string) => this.command(robot_id, { kind: 'set_mode', mode: 'manual' });
  set_auto = (robot_id: string, setpoint_m: number) =>
    this.command(robot_id, { kind: 'set_mode', mode: 'auto', setpoint_m });
  set_setpoint = (robot_id: string, setpoint_m: number) => this.command(robot_id, { kind: 'set_setpoint', setpoint_m });
  set_duty = (robot_id: string, duty: number) => this.command(robot_id, { kind: 'set_duty', duty });
  inject_disturbance = (robot_id: string, disturbance_m: number) =>
    this.command(robot_id, { kind: 'inject_disturbance', disturbance_m });
  zero_position = (robot_id: string) => this.command(robot_id, { kind: 'zero_position' });
  clear_emergency = (robot_id: string, emergency_id: string) =>
    this.command(robot_id, { kind: 'clear_emergency', emergency_id });

  change_control = async (robot_id: string, body: ControlBody) => {
    const begins = body.action === 'take' || body.action === 'force';
    const said = begins ? { ...body, stamp_us: this.latest_stamp('control was not taken') } : body;
    return this.ask<{ control: Control | null }>('POST', `/robots/${encodeURIComponent(robot_id)}/control`, said);
  };

  emergency_stop = async (robot_id: string, key: string): Promise<StopOutcome> =>
    outcome_of([
      await this.ask<CommandRecord>('POST', `/robots/${encodeURIComponent(robot_id)}/emergency-stop`, undefined, key),
    ]);

  // A stop that failed for some robots is an error whose content says what became of all of them.
  emergency_stop_all = async (key: string): Promise<StopOutcome> => {
    const answer = await this.ask<StopOfAll>('POST', '/emergency-stop', undefined, key).catch((error: unknown) => {
      const content = error instanceof ApiError ? (error.content as Partial<StopOfAll> | null) : null;
      if (content?.summary) return { summary: content.summary, commands: content.commands ?? [] };
      throw error;
    });
    const outcome = outcome_of(answer.commands);
    return answer.summary ? { ...outcome, summary: answer.summary } : outcome;
  };

  station = () => this.ask<Station>('GET', '/station');
  recording = () => this.ask<Recording>('GET', '/recording');
  acknowledge_losses = () => this.ask<object>('POST', '/recording/losses/acknowledge');
  events = async (robot_id: string) =>
    (await this.ask<{ events: EventRecord[] }>('GET', `/robots/${encodeURIComponent(robot_id)}/events?limit=200`))
      .events;
  // The newest of each for a log, which has no line for a renewal of a lease.
  newest_events = async (robot_id: string, limit: number) =>
    (await this.ask<{ events: EventRecord[] }>('GET', past(robot_id, 'events', { limit }))).events;
  newest_commands = async (robot_id: string, limit: number) =>
    (await this.ask<{ commands: CommandRecord[] }>('GET', past(robot_id, 'commands', { limit, renewals: 'false' })))
      .commands;
  open_runs = async () => (await this.ask<{ runs: RunRecord[] }>('GET', '/runs?state=open&limit=1000')).runs;
  // null: the station has no list; then a fluid belongs to a run alone.
  fluids = async (): Promise<Fluid[] | null> => {
    const list = await this.ask<{ fluids: Fluid[] }>('GET', '/fluids').catch((error: unknown) => {
      if (error instanceof ApiError && error.status === 404) return null;
      throw error;
    });
    return list && list.fluids;
  };
  set_fluid = (robot_id: string, fluid: string | null) =>
    this.ask<object>('POST', `/robots/${encodeURIComponent(robot_id)}/fluid`, { fluid });
  newest_run = async (robot_id: string) =>
    (await this.ask<{ runs: RunRecord[] }>('GET', `/runs?robot_id=${encodeURIComponent(robot_id)}&limit=1`)).runs[0] ??
    null;
  start_run = (robot_id: string, name: string, fluid: string) =>
    this.ask<RunRecord>('POST', '/runs', { robot_id, name, ...(fluid === '' ? {} : { fluid }) }); // '': not known
  end_run = (run_id: number) => this.ask<RunRecord>('POST', `/runs/${run_id}/end`);

  // A robot's past. Times are UTC; `limit` and `points` bound what comes in one answer.
  robot_samples = async (robot_id: string, from_us: number, to_us: number, limit: number) =>
    (await this.ask<{ samples: StoredSample[] }>('GET', past(robot_id, 'samples', { from_us, to_us, limit }))).samples;
  robot_overview = (robot_id: string, from_us: number, to_us: number, points: number) =>
    this.ask<Overview>('GET', past(robot_id, 'overview', { from_us, to_us, points, channels: kOverviewChannels }));
  robot_events = async (robot_id: string) =>
    (await this.ask<{ events: EventRecord[] }>('GET', past(robot_id, 'events', { limit: 1000 }))).events;
  // The newest 1000. Of renewals of leases those that stand for many, no single ones: an older station kept ten a second.
  robot_commands = async (robot_id: string, within: Record<string, number> = {}) => {
    const path = past(robot_id, 'commands', { ...within, limit: 1000, renewals: 'counted' });
    return (await this.ask<{ commands: CommandRecord[] }>('GET', path)).commands;
  };
  // A page; `after` null: the first.
  robot_markers = (robot_id: string, after: number | null) =>
    this.ask<{ markers: MarkerRecord[]; next: number | null }>(
      'GET',
      past(robot_id, 'markers', after === null ? { limit: 1000 } : { after, limit: 1000 }),
    );
  robot_runs = async (robot_id: string) =>
    (await this.ask<{ runs: RunRecord[] }>('GET', `/runs?robot_id=${encodeURIComponent(robot_id)}&limit=200`)).runs;
  robot_parameters = (robot_id: string) => this.ask<ParametersInForce>('GET', past(robot_id, 'parameters', {}));
  robot_controller = (robot_id: string) => this.ask<ControllerInForce>('GET', past(robot_id, 'controller', {}));

  log_in = (user: string, password: string) => this.change<Me>('/login', { user, password });
  redeem_link = (code: string) => this.ask<Me>('POST', '/login', { code });
  log_out = () => this.ask<object>('POST', '/logout');
  me = () => this.ask<Me>('GET', '/me');
  users = async () => (await this.ask<{ users: User[] }>('GET', '/users')).users;
  remove_user = (name: string) => this.ask<object>('POST', `/users/${encodeURIComponent(name)}/remove`);
  tokens = async () => (await this.ask<{ tokens: Token[] }>('GET', '/tokens')).tokens;
  revive_token = (name: string) => this.ask<Token>('POST', `/tokens/${encodeURIComponent(name)}/revive`);
  revoke_token = (name: string) => this.ask<Token>('POST', `/tokens/${encodeURIComponent(name)}/revoke`);
  sessions = async () => (await this.ask<{ sessions: PageSession[] }>('GET', '/sessions')).sessions;
  revoke_session = (session: number) => this.ask<object>('POST', `/sessions/${session}/revoke`);
  enrolments = async () => (await this.ask<{ enrolments: Enrolment[] }>('GET', '/enrolments')).enrolments;
  retire_robot = (robot_id: string, retired: boolean) =>
    this.ask<Enrolment>('POST', `/robots/${encodeURIComponent(robot_id)}/retire`, { retired });
  revoke_robot = (robot_id: string) =>
    this.ask<Enrolment>('POST', `/enrolments/${encodeURIComponent(robot_id)}/revoke`);

  // For a view that has functions of its own for its routes. A request whose signal is aborted is cancelled by the station.
  read = <Answer>(path: string, signal?: AbortSignal, patience_ms = kLongPatience_ms) =>
    this.ask<Answer>('GET', path, undefined, undefined, { signal, patience_ms });
  change = <Answer>(path: string, body: object) =>
    this.ask<Answer>('POST', path, body, undefined, { patience_ms: kLongPatience_ms });

  // True when the station answers that this page may not speak to it.
  async is_signed_out(): Promise<boolean> {
    return (await this.fetch('/api/v1/station', { method: 'GET' })).status === 401;
  }

  // SAFETY: without a live link nobody sees the robot, and the request could wait in the network for long: its life would
  // count from its arrival. An emergency stop goes all the same.
  private latest_stamp(otherwise: string): number | undefined {
    const stamp_us = this.stamp_us?.();
    if (stamp_us === null) throw new ApiError(`The live connection is down: ${otherwise}.`, 0);
    return stamp_us;
  }

  private async command(robot_id: string, body: CommandBody): Promise<CommandRecord> {
    const stamp_us = this.latest_stamp('the command was not sent');
    return this.ask<CommandRecord>('POST', `/robots/${encodeURIComponent(robot_id)}/commands`, { ...body, stamp_us });
  }

  async ask<Answer>(
    method: string,
    path: string,
    body?: object,
    key?: string,
    end: { signal?: AbortSignal | undefined; patience_ms?: number } = {},
  ): Promise<Answer> {
    const headers: Record<string, string> = {};
    const timeout = AbortSignal.timeout(end.patience_ms ?? kPatience_ms);
    const signal = end.signal ? AbortSignal.any([end.signal, timeout]) : timeout;
    const options: RequestInit = { method, headers, signal };
    if (key) headers['Idempotency-Key'] = key;
    if (body) {
      headers['Content-Type'] = 'application/json';
      options.body = JSON.stringify(body);
    }
    const answer = await this.fetch(`/api/v1${path}`, options).catch((error: unknown) => {
      if (error instanceof ApiError) throw error; // the page itself has refused it
      throw new ApiError('The station did not answer.', 0);
    });
    const content = (await answer.json().catch(() => null)) as unknown;
    if (answer.ok && content !== null) return content as Answer;
    throw error_of(answer.status, content as Partial<Problem> | null, Number(answer.headers?.get('Retry-After') ?? 0));
  }
}

const past = (robot_id: string, what: string, query: Record<string, number | string>) =>
  `/robots/${encodeURIComponent(robot_id)}/${what}${query_of(query)}`;
const query_of = (query: Record<string, number | string>) => {
  const members = Object.entries(query).map(([name, value]) => `${name}=${value}`);
  return members.length === 0 ? '' : `?${members.join('&')}`;
};

function error_of(status: number, problem: Partial<Problem> | null, retry_after_s: number): ApiError {
  const reason = problem?.reason ?? '';
  if (reason === 'throttled')
    return new ApiError(`Too many attempts. Try again in ${retry_after_s} s.`, status, reason, '', problem);
  const known = allowed_range(problem?.detail ?? '') ?? kReasons[reason];
  const otherwise = problem?.detail || problem?.title || `The station answered ${status} without a reason.`;
  return new ApiError(known ?? otherwise, status, reason, known ? (problem?.detail ?? '') : '', problem);
}

// "setpoint_m = 99 is outside -1 to 1" in the unit that the operator typed.
function allowed_range(detail: string): string | undefined {
  const [, name, low, high] = /^(\w+) = \S+ is outside (\S+) to ([^\s.]\S*)$/.exec(detail) ?? [];
  if (name === 'setpoint_m') return `Allowed is ${millimetres(Number(low), 0)} to ${millimetres(Number(high), 0)} mm.`;
  if (name === 'duty') return `Allowed is ${percent(Number(low), 0)} to ${percent(Number(high), 0)} %.`;
  return undefined;
}
