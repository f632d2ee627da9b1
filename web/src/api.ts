// The station's HTTP API as the page uses it: one function for each thing that is asked, errors as sentences.
//
// The types are generated from server/api/openapi.yaml (npm run types), so that a difference is a compile error.

import type { components } from './api_types';
import { millimetres, percent } from './format';

type Schemas = components['schemas'];
export type RobotState = Schemas['Robot'];
export type CommandRecord = Schemas['Command'];
export type CommandBody = Schemas['CommandBody'];
export type Control = Schemas['Control'];
export type ControlBody = Schemas['ControlBody'];
export type EventRecord = Schemas['Event'];
export type RunRecord = Schemas['Run'];
export type Station = Schemas['Station'];
export type Me = Schemas['Me'];
export type User = Schemas['User'];
export type Token = Schemas['Token'];
export type PageSession = Schemas['PageSession'];
export type Enrolment = Schemas['Enrolment'];
export type SamplesMessage = Schemas['LiveSamples'];
export type LiveMessage = Schemas['LiveServerMessage'];
export type ClientMessage = Schemas['LiveClientMessage'];
type Problem = Schemas['Problem'];

// A refusal or failure. `message` is a sentence for the operator; `reason` the station's identifier, "" when unknown.
export class ApiError extends Error {
  constructor(
    message: string,
    readonly status: number, // 0: no answer at all
    readonly reason = '',
    readonly detail = '', // what the station says beyond the sentence
  ) {
    super(message);
  }
}

const kReasons: Record<string, string> = {
  malformed: 'The command was malformed.',
  not_finite: 'That is not a finite number.',
  out_of_range: 'Outside the range that is allowed.',
  step_too_large: 'The step is larger than is allowed.',
  too_long_at_power: 'The motor has run at power for as long as is allowed.',
  stop_pending: 'An emergency stop is still on its way to the robot. Clear it when it has arrived.',
  wrong_mode: 'Not possible in this mode.',
  latched: 'The emergency stop is latched. Clear it first.',
  other_emergency: 'Another emergency is in force than the one you meant to clear. Look again.',
  cause_stands: 'The cause of the emergency still stands.',
  life_too_long: 'The command would have lived too long.',
  nothing_to_renew: 'The duty had ended already.',
  motor_on: 'Not while the motor runs.',
  outward: 'Outside the position limit: only motion inward is accepted.',
  busy: 'Too many commands wait.',
  unsupported: 'This firmware does not have it.',
  not_connected: 'The robot is not connected.',
  expired: 'It arrived too late and was discarded.',
  superseded: 'Another command took its place.',
  by_emergency_stop: 'An emergency stop took its place.',
  by_an_emergency: 'An emergency took its place.',
  by_a_newer_command: 'A newer command took its place.',
  not_seen_in_telemetry: 'The robot accepted it, and telemetry does not show it.',
  too_old_on_arrival: 'It arrived too late and was discarded.',
  stopped_by_a_later_stop: 'A later stop was answered first.',
  stale: 'What this page showed was too old. Look again.',
  timed_out: 'The robot did not answer in time.',
  no_answer: 'The robot did not answer in time.',
  not_sent_in_time: 'It could not be sent in time and was discarded.',
  unknown_robot: 'The station does not know this robot.',
  link_lost: 'The link to the robot broke before it answered.',
  other_boot: 'The robot restarted in between.',
  not_permitted: 'Your role does not allow that.',
  wrong_credentials: 'The user or the password is wrong.',
  no_credential: 'This page is signed out.',
};

// An identifier of a refusal as a sentence.
export const sentence = (reason: string) => kReasons[reason] ?? reason.replaceAll('_', ' ');

export type Fetch = (path: string, options: RequestInit) => Promise<Response>;

const kPatience_ms = 6000;

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
  zero_position = (robot_id: string) => this.command(robot_id, { kind: 'zero_position' });
  clear_emergency = (robot_id: string, emergency_id: string) =>
    this.command(robot_id, { kind: 'clear_emergency', emergency_id });

  change_control = async (robot_id: string, body: ControlBody) => {
    const begins = body.action === 'take' || body.action === 'force';
    const said = begins ? { ...body, stamp_us: this.latest_stamp('control was not taken') } : body;
    return this.ask<{ control: Control | null }>('POST', `/robots/${encodeURIComponent(robot_id)}/control`, said);
  };

  emergency_stop = async (robot_id: string, key: string) => [
    await this.ask<CommandRecord>('POST', `/robots/${encodeURIComponent(robot_id)}/emergency-stop`, undefined, key),
  ];
  emergency_stop_all = async (key: string) =>
    (await this.ask<{ commands: CommandRecord[] }>('POST', '/emergency-stop', undefined, key)).commands;

  station = () => this.ask<Station>('GET', '/station');
  open_run = async (robot_id: string) => {
    const path = `/runs?robot_id=${encodeURIComponent(robot_id)}&limit=1`;
    const { runs } = await this.ask<{ runs: RunRecord[] }>('GET', path);
    return runs.find((run) => run.ended_at_us === null) ?? null;
  };
  start_run = (robot_id: string, name: string, fluid: string) =>
    this.ask<RunRecord>('POST', '/runs', { robot_id, name, fluid });
  end_run = (run_id: number) => this.ask<RunRecord>('POST', `/runs/${run_id}/end`);

  log_in = (user: string, password: string) => this.ask<Me>('POST', '/login', { user, password });
  log_out = () => this.ask<object>('POST', '/logout');
  me = () => this.ask<Me>('GET', '/me');
  users = async () => (await this.ask<{ users: User[] }>('GET', '/users')).users;
  remove_user = (name: string) => this.ask<object>('POST', `/users/${encodeURIComponent(name)}/remove`);
  tokens = async () => (await this.ask<{ tokens: Token[] }>('GET', '/tokens')).tokens;
  revoke_token = (name: string) => this.ask<Token>('POST', `/tokens/${encodeURIComponent(name)}/revoke`);
  sessions = async () => (await this.ask<{ sessions: PageSession[] }>('GET', '/sessions')).sessions;
  revoke_session = (session: number) => this.ask<object>('POST', `/sessions/${session}/revoke`);
  enrolments = async () => (await this.ask<{ enrolments: Enrolment[] }>('GET', '/enrolments')).enrolments;
  revoke_robot = (robot_id: string) => this.ask<Enrolment>('POST', `/enrolments/${encodeURIComponent(robot_id)}/revoke`);

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

  private async ask<Answer>(method: string, path: string, body?: object, key?: string): Promise<Answer> {
    const headers: Record<string, string> = {};
    const options: RequestInit = { method, headers, signal: AbortSignal.timeout(kPatience_ms) };
    if (key) headers['Idempotency-Key'] = key;
    if (body) {
      headers['Content-Type'] = 'application/json';
      options.body = JSON.stringify(body);
    }
    const answer = await this.fetch(`/api/v1${path}`, options).catch(() => {
      throw new ApiError('The station did not answer.', 0);
    });
    const content = (await answer.json().catch(() => null)) as unknown;
    if (answer.ok && content !== null) return content as Answer;
    throw error_of(answer.status, content as Partial<Problem> | null, Number(answer.headers?.get('Retry-After') ?? 0));
  }
}

function error_of(status: number, problem: Partial<Problem> | null, retry_after_s: number): ApiError {
  const reason = problem?.reason ?? '';
  if (status === 429) return new ApiError(`Too many attempts. Try again in ${retry_after_s} s.`, status, reason);
  const known = allowed_range(problem?.detail ?? '') ?? kReasons[reason];
  const otherwise = problem?.detail || problem?.title || `The station answered ${status} without a reason.`;
  return new ApiError(known ?? otherwise, status, reason, known ? (problem?.detail ?? '') : '');
}

// "setpoint_m = 99 is outside -1 to 1" in the unit that the operator typed.
function allowed_range(detail: string): string | undefined {
  const [, name, low, high] = /^(\w+) = \S+ is outside (\S+) to ([^\s.]\S*)$/.exec(detail) ?? [];
  if (name === 'setpoint_m') return `Allowed is ${millimetres(Number(low), 0)} to ${millimetres(Number(high), 0)} mm.`;
  if (name === 'duty') return `Allowed is ${percent(Number(low), 0)} to ${percent(Number(high), 0)} %.`;
  return undefined;
}
