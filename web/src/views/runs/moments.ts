// What happened in a run, in order: its markers, its events, what was commanded.

import type { EventRecord } from '../../api';
import { millimetres, millivolts, words } from '../../format';
import type { Knots } from './knots';
import type { Marker, Run, Step } from './runs_api';

export interface Moment {
  key: string;
  utc_us: number;
  kind: 'marker' | 'command' | 'event' | 'alarm';
  text: string;
  by: string;
}

const kCommanded = [
  'setpoint_changed',
  'disturbance',
  'mode_changed',
  'position_zeroed',
  'parameter_changed',
  'controller_changed',
];
const kOfTheStation = /^(control_|fluid_|connected|connection_|disconnected|enrol)/; // said of the robot, not by it

export function moments_of(
  run: Run,
  markers: readonly Marker[],
  events: readonly EventRecord[],
  steps: readonly Step[],
  span_starts_us: readonly number[],
  knots: Knots,
): Moment[] {
  const found: Moment[] = [];
  for (const marker of markers) {
    if (marker.utc_us === null) continue;
    found.push({
      key: `m${marker.marker_id}`,
      utc_us: marker.utc_us,
      kind: 'marker',
      text: marker.text,
      by: marker.actor,
    });
  }
  const of_run = events.filter((event) => is_in_run(run, event) && !kOfTheStation.test(event.kind));
  for (const event of of_run) {
    const utc_us =
      event.boot_id !== null && event.robot_time_us !== null ? knots.utc_of(event.boot_id, event.robot_time_us) : null;
    const kind = event.kind === 'emergency' ? 'alarm' : kCommanded.includes(event.kind) ? 'command' : 'event';
    const key = `e${event.boot_id}-${event.event_seq}`;
    found.push({ key, utc_us: utc_us ?? event.received_at_us, kind, text: event_text(event), by: '' });
  }
  for (const part of run.interrupted) {
    const boot_id = run.spans[part.span]?.boot_id;
    const utc_us = boot_id === undefined ? null : knots.utc_of(boot_id, part.from_robot_time_us);
    if (utc_us === null) continue;
    found.push({
      key: `i${part.span}-${part.from_robot_time_us}`,
      utc_us,
      kind: 'event',
      text: waited_text(part),
      by: '',
    });
  }
  // The station lists a robot's newest events only: of an older run its steps say what was commanded in auto mode.
  const knows_commands = of_run.some((event) => kCommanded.includes(event.kind));
  for (const step of knows_commands ? [] : steps) {
    const start_us = span_starts_us[step.span];
    if (start_us === undefined) continue;
    const text = step.cause === 'setpoint' ? `setpoint ${millimetres(step.target_m, 0)} mm` : 'disturbance changed';
    found.push({
      key: `s${step.span}-${step.first_seq}`,
      utc_us: start_us + step.at_s * 1e6,
      kind: 'command',
      text,
      by: '',
    });
  }
  return found.sort((a, b) => a.utc_us - b.utc_us);
}

type InterruptedPart = Run['interrupted'][number];

const waited_s = (part: InterruptedPart) => (part.to_robot_time_us - part.from_robot_time_us) / 1e6;
const waited_text = (part: InterruptedPart) => `interrupted for ${waited_s(part).toFixed(1)} s (${words(part.reason)})`;

// Where the robot waited at rest, in seconds since the run's first sample.
export function interrupted_stretches(run: Run, origin_us: number, knots: Knots): [number, number][] {
  return run.interrupted.flatMap((part): [number, number][] => {
    const boot_id = run.spans[part.span]?.boot_id;
    const utc_us = boot_id === undefined ? null : knots.utc_of(boot_id, part.from_robot_time_us);
    if (utc_us === null) return [];
    const from_s = (utc_us - origin_us) / 1e6;
    return [[from_s, from_s + waited_s(part)]];
  });
}

// How often and how long the run was interrupted; empty: it was not.
export function interruptions_text({ interrupted }: Pick<Run, 'interrupted'>): string {
  if (interrupted.length === 0) return '';
  const all_s = interrupted.reduce((sum, part) => sum + waited_s(part), 0);
  const times = interrupted.length === 1 ? 'once' : `${interrupted.length} times`;
  return `Interrupted ${times}, ${all_s.toFixed(1)} s in all: the robot waited at rest (shaded), and a fit leaves that out.`;
}

function is_in_run({ spans, robot_id }: Run, { robot_id: of, boot_id, sample_seq }: EventRecord): boolean {
  if (of !== robot_id || sample_seq === null) return false;
  return spans.some(
    (span) => span.boot_id === boot_id && sample_seq >= span.first_seq && sample_seq <= (span.last_seq ?? Infinity),
  );
}

export function event_text(event: EventRecord): string {
  const cause = [event.emergency_cause, event.cause].find((said) => said && said !== 'none');
  const because = cause ? ` (${words(cause)})` : '';
  switch (event.kind) {
    case 'setpoint_changed':
      return `setpoint ${millimetres(event.value, 0)} mm`;
    case 'disturbance':
      return `disturbance ${millimetres(event.value, 0)} mm`;
    case 'mode_changed':
      return `mode ${event.mode}${because}`;
    case 'sub_state_changed':
      return event.sub_state === 'none' ? 'leaves auto' : `${event.sub_state}`;
    case 'detection':
    case 'delivery_started':
      return `${words(event.kind)} at ${millivolts(event.value)} mV`;
    case 'delivery_ended':
      return `delivery ended after ${event.value?.toFixed(1) ?? '–'} s`;
    case 'emergency':
      return `emergency stop${because}`;
    default:
      return words(event.kind) + because;
  }
}
