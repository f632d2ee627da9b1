// One robot of the fleet as a line, or on a phone as a card; a press leads to it.

import type { Signal } from '@preact/signals';
import { fleet_state_of, kFleetStates, type FleetState } from '../fleet';
import { age, count, duration, kSpread_sd, millimetres, milliseconds, plus_minus, volts_of_mv, words } from '../format';
import type { Robot } from '../robot';
import { format } from '../route';
import type { Session } from '../session';
import { HideButton, is_hidden } from './robot_list';

export type FleetCounts = Record<FleetState, number> & {
  total: number;
  connected: number;
  hidden: number;
  hidden_alarms: number;
};

export function count_by(session: Session): FleetCounts {
  const counts = { total: 0, connected: 0, hidden: 0, hidden_alarms: 0 } as FleetCounts;
  for (const { state } of kFleetStates) counts[state] = 0;
  for (const robot of session.store.robots.value) {
    counts.total += 1;
    if (!robot.is_away.value) counts.connected += 1;
    if (is_hidden(session, robot)) {
      counts.hidden += 1;
      if (robot.is_alarming.value) counts.hidden_alarms += 1;
    } else counts[fleet_state_of(robot)] += 1;
  }
  return counts;
}

interface FleetRowProps {
  session: Session;
  robot: Robot;
  hides: boolean;
  scale: Signal<[number, number]>;
}

export function FleetRow({ session, robot, hides, scale }: FleetRowProps) {
  const { store } = session;
  const { robot_id } = robot;
  const state = robot.state.value;
  const is_current = store.is_current.value;
  const is_away = robot.is_away.value;
  const kind = fleet_state_of(robot);
  const known = is_current && !is_away; // what it says of itself is of now, or of what it last said
  const run = is_current ? store.runs.value.find((each) => each.robot_id === robot_id) : undefined;
  return (
    <li data-robot={robot_id} data-state={kind} class={is_current ? '' : 'unknown'}>
      <a
        class="fleet-row"
        href={format({ view: 'robot', parts: [robot_id] })}
        aria-current={store.selected_id.value === robot_id}
      >
        <span class="robot">
          <span class={`dot ${tone_of(robot, is_current)}`} />
          <b>{robot_id}</b>
        </span>
        <span class={`mode ${kind}`}>{mode_text(robot, is_current)}</span>
        <MiniTape robot={robot} known={known} scale={scale} />
        <Position robot={robot} known={known} />
        <span class={`setpoint figure ${known && state.setpoint_m !== null ? '' : 'unset'}`}>
          {known && state.setpoint_m !== null ? `${millimetres(state.setpoint_m)} mm` : '–'}
        </span>
        <span class="link figure">{known && state.clock ? milliseconds(state.clock.round_trip_us / 1000) : '–'}</span>
        <span class="supply figure">{known && state.status ? `${volts_of_mv(state.status.supply_mv)} V` : '–'}</span>
        <Completeness robot={robot} />
        <span class="run">
          {run && (
            <span class="lamp recording-lamp">
              <span class="run-name">{run.name}</span> <RunTime session={session} started_at_us={run.started_at_us} />
            </span>
          )}
        </span>
      </a>
      {hides && <HideButton session={session} robot_id={robot_id} />}
    </li>
  );
}

// Green says that samples arrive; of a robot whose samples are not asked for nobody here knows that.
export function tone_of(robot: Robot, is_current: boolean): string {
  const { watched, stale } = robot.readout.value;
  if (robot.is_alarming.value) return 'alarm';
  if (robot.is_away.value) return 'off';
  if (!is_current || (watched && stale)) return 'caution';
  return watched ? 'good' : 'unwatched';
}

function mode_text(robot: Robot, is_current: boolean): string {
  const { mode, sub_state, emergency_cause, pending_stop, retired } = robot.state.value;
  if (!is_current) return 'not known: cut off';
  if (robot.is_away.value) return retired ? 'retired' : pending_stop !== null ? 'away, stop kept' : 'not connected';
  if (mode === 'emergency') return `emergency, ${words(emergency_cause)}`;
  if (pending_stop !== null) return 'stop not acknowledged';
  if (robot.is_silent.value) return `silent, was in ${mode}`;
  return mode === 'auto' && sub_state !== 'none' ? `auto, ${words(sub_state)}` : mode;
}

// Only of samples that arrive: a position that is old is grey and says how old; that of a robot nobody watches is not shown.
function Position({ robot, known }: { robot: Robot; known: boolean }) {
  const { watched, estimate_m, position_sd_m, stale, sample_age_ms } = robot.readout.value;
  if (!watched || estimate_m === null || robot.is_away.value) return <span class="position figure">–</span>;
  const is_old = stale || !known;
  return (
    <span class={`position figure ${is_old ? 'stale' : ''}`}>
      {millimetres(estimate_m)} <span class="spread">{plus_minus(position_sd_m)} mm</span>
      {is_old && <span class="old">{age(sample_age_ms)} old</span>}
    </span>
  );
}

// The same as a mark on a line, beside that of its setpoint: of what is present alone.
function MiniTape({ robot, known, scale }: { robot: Robot; known: boolean; scale: Signal<[number, number]> }) {
  const { watched, stale, estimate_m, position_sd_m, setpoint_m } = robot.readout.value;
  const [from, to] = scale.value;
  const share = (value_m: number) => Math.max(0, Math.min(1, (value_m - from) / (to - from))) * 100;
  const place = (value_m: number) => `${share(value_m).toFixed(2)}%`;
  const is_seen = known && watched && !stale && estimate_m !== null;
  const spread_m = kSpread_sd * (position_sd_m ?? 0);
  return (
    <span class="mini-tape" aria-hidden="true">
      <s style={{ left: place(0) }} />
      {is_seen && spread_m > 0 && (
        <u style={{ left: place(estimate_m - spread_m), right: `calc(100% - ${place(estimate_m + spread_m)})` }} />
      )}
      {is_seen && setpoint_m !== null && <b style={{ left: place(setpoint_m) }} />}
      {is_seen && <i style={{ left: place(estimate_m) }} />}
    </span>
  );
}

// What the robot had and the station has not on disk: lost for good, or not yet.
function Completeness({ robot }: { robot: Robot }) {
  const { status, next_seq, durable_next_seq, boot_id } = robot.state.value;
  const lost = status?.lost_samples ?? 0;
  const unsaved = Math.max(0, next_seq - durable_next_seq);
  if (boot_id === null) return <span class="kept quiet">–</span>;
  if (lost > 0) return <span class="kept alarm">{count(lost)} lost</span>;
  if (unsaved > kUnsaved) return <span class="kept caution">{count(unsaved)} unsaved</span>;
  return <span class="kept quiet">nothing lost</span>;
}

const kUnsaved = 300; // samples on their way to the disk; three seconds of one robot

function RunTime({ session, started_at_us }: { session: Session; started_at_us: number }) {
  void session.store.now_ms.value; // ten times a second
  return <time>{duration((session.utc_us() - started_at_us) / 1000)}</time>;
}
