// The last events and commands, newest first.

import type { CommandRecord, EventRecord } from '../api';
import { clock_time, count, millimetres, percent, plus_minus, words } from '../format';
import { kWaysOut, sentence } from '../reasons';
import type { Session } from '../session';
import type { LogLine } from '../store';

export const LogStrip = ({ session }: { session: Session }) => <LogLines lines={session.store.log.value} />;

export function LogLines({ lines, none = 'Nothing yet.' }: { lines: readonly LogLine[]; none?: string | undefined }) {
  return (
    <ol tabIndex={0} aria-label="Events and commands">
      {lines.length === 0 && <li class="quiet">{none}</li>}
      {lines.map((line) => (
        <Line key={line.key} line={line} />
      ))}
    </ol>
  );
}

function Line({ line }: { line: LogLine }) {
  const [tone, sort, text] = describe(line);
  return (
    <li class={tone}>
      <time>{clock_time(line.at_ms)}</time>
      <span class="who">{line.robot_id}</span>
      <span class="sort">{sort}</span>
      <span class="text">{text}</span>
    </li>
  );
}

export function describe({ event, command, note, position_sd_m }: LogLine): [tone: string, sort: string, text: string] {
  if (command) {
    const refused = ['rejected', 'expired', 'failed', 'unknown'].includes(command.state);
    const alarm = command.kind === 'emergency_stop';
    const off =
      alarm && command.verified_after_us !== null
        ? ` · motor off after ${(command.verified_after_us / 1000).toFixed(1)} ms`
        : '';
    const end = refused ? `${command.state}: ${sentence(command.reason)}` : command.state;
    return [
      refused ? 'caution' : alarm ? 'alarm' : '',
      'command',
      `${words(command.kind)}${arguments_text(command.arguments)}${renewals_text(command)} · ${end}${off}`,
    ];
  }
  if (event) {
    const alarm = event.kind === 'emergency';
    const where =
      event.kind === 'mode_changed'
        ? ` to ${event.mode}`
        : event.kind === 'sub_state_changed'
          ? ` to ${event.sub_state}`
          : '';
    const of_latch = event.kind === 'emergency' ? event.emergency_cause : null;
    const cause = [of_latch ?? event.cause]
      .filter((said) => said && said !== 'none' && event.kind !== 'time_step') // its only cause is "time"
      .map((said) => ` · ${words(said)}`)
      .join('');
    const detail = event.detail ? ` · ${event.detail}` : '';
    const position = event.position_m === null ? '' : millimetres(event.position_m);
    const is_unknown = position_sd_m === null && event.kind !== 'position_zeroed'; // zeroed: it is 0 by command
    // Where it is on its way, nothing is said of it yet.
    const known = typeof position_sd_m === 'number' ? ` ${plus_minus(position_sd_m)} mm` : ' mm';
    const spread = is_unknown ? ' mm, ± not known' : known;
    const at = position && ` · controller at ${position}${spread}`;
    const way_out = kWaysOut[event.kind] ? ` · ${kWaysOut[event.kind]}` : '';
    const caution = /lost|left_out|fault|limit|lapsed|uncertain|mismatch$/.test(event.kind);
    return [
      alarm ? 'alarm' : caution ? 'caution' : '',
      'event',
      words(event.kind) + much_of(event) + where + cause + detail + at + way_out,
    ];
  }
  return ['quiet', 'page', note ?? ''];
}

// Of a renewal of a lease: those that followed and have no record of their own.
export function renewals_text({ further_renewals, last_renewed_at_us, reason }: CommandRecord): string {
  if (further_renewals === undefined || further_renewals === 0) return '';
  if (further_renewals === null)
    return reason === 'station_restarted' ? ' and an unknown number more' : ' and more, not counted yet';
  const until = last_renewed_at_us ? ` until ${clock_time(last_renewed_at_us / 1000)}` : '';
  return ` and ${count(further_renewals)} more${until}`;
}

// By how much, or to what: docs/protocol.md lists what the value of an event is.
function much_of({ kind, value }: EventRecord): string {
  if (value === null) return '';
  if (kind === 'disturbance') return ` ${millimetres(value)} mm`;
  if (kind === 'setpoint_changed') return ` to ${millimetres(value)} mm`;
  return kind === 'time_step' ? ` of ${value.toFixed(2)} s` : '';
}

export function arguments_text({ execute_at_robot_us: at_us, ...values }: Record<string, unknown>): string {
  const at = at_us === undefined ? '' : ` at ${(Number(at_us) / 1e6).toFixed(3)} s of the robot’s clock`;
  const others = Object.entries(values)
    .map(([name, value]) => {
      if (typeof value === 'number' && name.endsWith('_m')) return ` ${millimetres(value)} mm`;
      if (typeof value === 'number' && name === 'duty') return ` ${percent(value)} %`;
      if (name === 'emergency_id') return ` …${String(value).slice(-6)}`;
      return typeof value === 'object' && value !== null ? nested_text(name, value) : ` ${shortened(String(value))}`;
    })
    .join('');
  return others + at;
}

const kTick_s = 0.01; // of a schedule: docs/api.md
const kLongest = 60; // characters of one value

// A line has room for how much it is, not for all that is in it.
function nested_text(name: string, value: object): string {
  if (!Array.isArray(value)) return ` ${words(name)} ${shortened(JSON.stringify(value))}`;
  const last: unknown = value.at(-1);
  const tick = last !== null && typeof last === 'object' && 'tick' in last ? Number(last.tick) : NaN;
  if (name !== 'schedule' || !Number.isFinite(tick)) return ` ${words(name)}: ${value.length}`;
  return ` ${value.length} ${value.length === 1 ? 'duty' : 'duties'} over ${(tick * kTick_s).toFixed(2)} s`;
}

const shortened = (text: string) => (text.length <= kLongest ? text : `${text.slice(0, kLongest - 1)}…`);
