// The station's HTTP API as the page uses it: one function for each thing that is asked, errors as sentences.

export interface Status {
  supply_mv: number;
  rssi_dbm: number;
  free_memory_bytes: number;
  worst_tick_us: number;
  missed_ticks: number;
  ring_fill: number;
  imu_calibration: number;
  bad_frames: number;
  lost_samples: number;
  lost_events: number;
}

export interface RobotState {
  id: string;
  link: 'connected' | 'disconnected';
  boot_id: string | null;
  firmware_version: string;
  sample_period_us: number;
  ring_capacity: number;
  mode: string;
  sub_state: string;
  setpoint_m: number | null;
  position_sd_m: number;
  emergency_id: string | null;
  emergency_cause: string;
  next_seq: number;
  durable_next_seq: number;
  status: Status | null;
  clock: { valid: boolean; uncertainty_us: number; round_trip_us: number; drift_ppm: number } | null;
  pending_stop: string | null;
}

export interface CommandRecord {
  id: string;
  robot_id: string;
  kind: string;
  arguments: Record<string, unknown>;
  actor: string;
  state: string;
  reason: string;
  submitted_at_us: number;
  ended_at_us: number | null;
  emergency_id: string | null;
}

export interface EventRecord {
  robot_id: string;
  boot_id: string | null;
  event_seq: number | null;
  kind: string;
  cause: string;
  mode: string;
  sub_state: string;
  position_m: number;
  value: number;
  emergency_id: string | null;
  received_at_us: number;
}

export interface RunRecord {
  id: string;
  name: string;
  fluid: string;
  robot_id: string;
  started_at_ms: number;
  ended_at_ms: number | null;
}

// A refusal or failure. `message` is a sentence for the operator; `reason` the station's identifier, "" when unknown.
export class ApiError extends Error {
  constructor(
    message: string,
    readonly status: number, // 0: no answer at all
    readonly reason = '',
  ) {
    super(message);
  }
}

const kReasons: Record<string, string> = {
  malformed: 'The command was malformed.',
  not_finite: 'That is not a finite number.',
  out_of_range: 'Outside the range that is allowed.',
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
  superseded: 'A newer command took its place.',
  link_lost: 'The link to the robot broke before it answered.',
  other_boot: 'The robot restarted in between.',
};

// An identifier of a refusal as a sentence.
export function sentence(reason: string, otherwise = ''): string {
  return kReasons[reason] ?? (otherwise || reason.replaceAll('_', ' '));
}

export type Fetch = (path: string, options: RequestInit) => Promise<Response>;

const kPatience_ms = 6000;

export class Api {
  constructor(private readonly fetch: Fetch) {}

  set_manual = (robot_id: string) => this.command(robot_id, { kind: 'set_mode', mode: 'manual' });
  set_auto = (robot_id: string, setpoint_m: number) =>
    this.command(robot_id, { kind: 'set_mode', mode: 'auto', setpoint_m });
  set_setpoint = (robot_id: string, setpoint_m: number) => this.command(robot_id, { kind: 'set_setpoint', setpoint_m });
  set_duty = (robot_id: string, duty: number) => this.command(robot_id, { kind: 'set_duty', duty });
  zero_position = (robot_id: string) => this.command(robot_id, { kind: 'zero_position' });
  clear_emergency = (robot_id: string, emergency_id: string) =>
    this.command(robot_id, { kind: 'clear_emergency', emergency_id });

  async emergency_stop(robot_id: string): Promise<CommandRecord[]> {
    return [(await this.send('POST', `/robots/${robot_id}/emergency-stop`, {})) as CommandRecord];
  }
  async emergency_stop_all(): Promise<CommandRecord[]> {
    return (await this.send('POST', '/emergency-stop', {})) as CommandRecord[];
  }
  start_run = (robot_id: string, name: string, fluid: string) =>
    this.send('POST', '/runs', { robot_id, name, fluid }) as Promise<RunRecord>;
  end_run = (run_id: string) => this.send('POST', `/runs/${run_id}/end`, {}) as Promise<RunRecord>;

  // True when the station answers that this page may not speak to it.
  async is_signed_out(): Promise<boolean> {
    return (await this.fetch('/api/v1/robots', { method: 'GET' })).status === 401;
  }

  // A command's end; anything but "acknowledged" is an error in words.
  private async command(robot_id: string, body: object): Promise<CommandRecord> {
    const record = (await this.send('POST', `/robots/${robot_id}/commands`, body)) as CommandRecord;
    if (record.state === 'acknowledged') return record;
    throw new ApiError(sentence(record.reason || record.state, record.state), 200, record.reason || record.state);
  }

  private async send(method: string, path: string, body: object): Promise<unknown> {
    const headers = { 'Content-Type': 'application/json' };
    const options = { method, headers, body: JSON.stringify(body), signal: AbortSignal.timeout(kPatience_ms) };
    const answer = await this.fetch(`/api/v1${path}`, options).catch(() => {
      throw new ApiError('The station did not answer.', 0);
    });
    const content = (await answer.json().catch(() => null)) as { title?: string; detail?: string; reason?: string } | null;
    if (answer.ok) return content;
    const reason = content?.reason ?? '';
    throw new ApiError(content?.detail || sentence(reason, content?.title ?? `The station answered ${answer.status}.`), answer.status, reason);
  }
}
