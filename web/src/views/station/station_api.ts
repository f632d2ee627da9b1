// What the view of the station asks and changes, with the types of the API.

import { ApiError, type Api, type Enrolment, type Fluid, type Token, type User } from '../../api';
import type { components } from '../../api_types';
import { Metrics } from './metrics';

type Schemas = components['schemas'];
export type AuditEntry = Schemas['AuditEntry'];
export type AuditPage = Schemas['AuditPage'];
export type Backup = Schemas['Backup'];
export type CommandLimits = Schemas['CommandLimits'];
export type FluidList = { fluids: Fluid[]; limits_where_unknown: CommandLimits };
export type LoginLink = Schemas['LoginLink'];
export type NewToken = Token & { secret: string };
export type NewEnrolment = Enrolment & { secret: string };
export type UserBody = Schemas['UserBody'];
export type UserChange = Schemas['UserChange'];
export type TokenBody = Schemas['TokenBody'];

export interface AuditFilter {
  actor: string;
  action: string;
  robot_id: string;
}

const kPatience_ms = 6000;
export const kAuditPage = 100;

export class StationApi {
  constructor(
    private readonly api: Pick<Api, 'read' | 'change'>,
    private readonly fetch: (path: string, options: RequestInit) => Promise<Response>,
  ) {}

  backups = async () => (await this.api.read<{ backups: Backup[] }>('/backups')).backups;
  make_backup = (name: string) => this.api.change<Backup>('/backups', { name });
  fluids = () => this.api.read<FluidList>('/fluids');

  add_user = (body: UserBody) => this.api.change<User>('/users', body);
  change_user = (name: string, change: UserChange) =>
    this.api.change<User>(`/users/${encodeURIComponent(name)}/change`, change);
  add_token = (body: TokenBody) => this.api.change<NewToken>('/tokens', body);
  enrol = (robot_id: string) => this.api.change<NewEnrolment>('/enrolments', { robot_id });
  make_login_link = () => this.api.change<LoginLink>('/login-links', {});

  // Newest first; `before` null: from the newest on.
  audit = ({ actor, action, robot_id }: AuditFilter, before: number | null) => {
    const members = Object.entries({ actor, action, robot_id, before: before === null ? '' : String(before) });
    const query = new URLSearchParams([...members.filter(([, value]) => value !== ''), ['limit', String(kAuditPage)]]);
    return this.api.read<AuditPage>(`/audit?${query.toString()}`);
  };

  metrics = async (): Promise<Metrics> => {
    const options = { signal: AbortSignal.timeout(kPatience_ms) };
    const answer = await this.fetch('/metrics', options).catch(() => {
      throw new ApiError('The station did not answer.', 0);
    });
    if (!answer.ok) throw new ApiError(`The station answered ${answer.status} to /metrics.`, answer.status);
    return new Metrics(await answer.text());
  };
}

// Left out where a field is empty: `days` for a token that does not run out.
export function token_body(name: string, scopes: readonly string[], days: string): TokenBody | string {
  if (!/^[a-z0-9._-]{1,31}$/.test(name)) return name_problem('name', name);
  if (scopes.length === 0) return 'scopes: choose at least one.';
  if (days.trim() !== '' && !(/^\d+$/.test(days.trim()) && Number(days) >= 1 && Number(days) <= 3650))
    return `days = “${days.trim()}” is not a whole number from 1 to 3650. Leave it empty for a token that does not run out.`;
  return { name, scopes: scopes.join(','), ...(days.trim() === '' ? {} : { days: Number(days) }) };
}

export function user_body(name: string, role: UserBody['role'], password: string): UserBody | string {
  if (!/^[a-z0-9._-]{1,31}$/.test(name)) return name_problem('name', name);
  return password_problem(password) || { name, role, password };
}

export function password_problem(password: string): string {
  if (password.length < 8) return `password: ${password.length} characters are too few, it needs 8 to 200.`;
  return password.length > 200 ? `password: ${password.length} characters are too many, it may have 200.` : '';
}

export function robot_problem(robot_id: string): string {
  return /^[a-z0-9_-]{1,31}$/.test(robot_id)
    ? ''
    : `robot = “${robot_id}” is not 1 to 31 characters of a-z, 0-9, _ and -. Write it as it is in the robot’s firmware.`;
}

export function backup_problem(name: string): string {
  return /^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$/.test(name)
    ? ''
    : `name = “${name}” is not 1 to 64 characters of A-Z, a-z, 0-9, ., _ and -, beginning with a letter or digit.`;
}

const name_problem = (what: string, name: string) =>
  `${what} = “${name}” is not 1 to 31 characters of a-z, 0-9, ., _ and -.`;

// One that nobody has to invent, without letters that are taken for each other.
const kLetters = 'abcdefghijkmnpqrstuvwxyz23456789';
export function made_password(random: (into: Uint8Array) => Uint8Array): string {
  const letters = [...random(new Uint8Array(16))].map((byte) => kLetters[byte % kLetters.length] ?? '');
  return [0, 4, 8, 12].map((at) => letters.slice(at, at + 4).join('')).join('-');
}
