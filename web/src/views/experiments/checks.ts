// What the station would wait for before it begins, shown before somebody presses Start: it decides, this only looks ahead.

import type { RobotState, RunRecord } from '../../api';
import { account_of, type Reservation } from '../../experiments_api';
import type { ExperimentSummary } from '../../experiments_store';
import { fluid_text } from '../../format';
import type { Profile } from './profile';
import { who } from './words';

export interface Check {
  key: 'connected' | 'rest' | 'control' | 'reservation' | 'queue' | 'fluid' | 'pump';
  state: 'ok' | 'waits' | 'unknown'; // unknown: nothing is known of it, or not yet
  text: string;
  todo: string;
}

export interface Outlook {
  robot: RobotState;
  profile: Profile | null; // null: its document cannot be read
  duration_s: number; // of all runs
  me: string; // this page, as an actor
  now_us: number; // UTC
  reservations: readonly Reservation[] | null; // of this robot, not over; null: not known
  at_work: ExperimentSummary | undefined;
  queue: readonly ExperimentSummary[];
  priority: number;
  newest_run: RunRecord | null | undefined; // null: it has none; undefined: not known
}

const kRestBefore_us = 5_000_000; // the robot is at rest when the slot of somebody else begins

export function checks_of(outlook: Outlook): Check[] {
  const checks = [connected(outlook), at_rest(outlook), control(outlook), reservation(outlook), queue(outlook)];
  return outlook.profile ? [...checks, fluid(outlook, outlook.profile), pump(outlook, outlook.profile)] : checks;
}

function check(key: Check['key'], state: Check['state'], text: string, todo = ''): Check {
  return { key, state, text, todo };
}

function connected({ robot }: Outlook): Check {
  return robot.link === 'connected'
    ? check('connected', 'ok', 'The robot is connected.')
    : check('connected', 'waits', 'The robot is not connected.', 'Switch it on; it connects by itself.');
}

function at_rest({ robot }: Outlook): Check {
  const duty = robot.sample?.duty;
  if (robot.link !== 'connected') return check('rest', 'unknown', 'Whether the robot is at rest is not known.');
  if (robot.mode === 'emergency' || robot.emergency_id !== null) {
    return check('rest', 'waits', 'The robot is in emergency.', 'Look at the robot, then clear the latch.');
  }
  if (robot.mode === 'manual' && duty === undefined) {
    return check('rest', 'unknown', 'Whether the robot is at rest is not known: no sample of it has come yet.');
  }
  if (robot.mode === 'manual' && duty === 0) return check('rest', 'ok', 'The robot is at rest.');
  const todo = robot.mode === 'manual' ? 'End the duty on the robot’s page.' : 'Set it to manual on the robot’s page.';
  return check('rest', 'waits', 'The robot is not at rest.', todo);
}

function control({ robot, me }: Outlook): Check {
  const holder = robot.control?.holder ?? '';
  if (holder === '') return check('control', 'ok', 'Nobody controls the robot; the experiment takes control.');
  if (holder === me) return check('control', 'ok', 'You control the robot.');
  return check('control', 'waits', `${who(holder)} controls the robot.`, 'Ask for control on the robot’s page.');
}

function reservation({ reservations, me, now_us, duration_s }: Outlook): Check {
  if (reservations === null) return check('reservation', 'unknown', 'Whether it is reserved is not known yet.');
  const mine = account_of(me);
  const ends_us = now_us + duration_s * 1e6 + kRestBefore_us;
  const others = reservations.filter((each) => each.holder !== mine && each.cancelled_at_us === null);
  const slot = others.find((each) => each.until_us > now_us && each.from_us <= ends_us);
  if (!slot) {
    const own = reservations.find((each) => each.holder === mine && each.from_us <= now_us && now_us < each.until_us);
    return check('reservation', 'ok', own ? 'The robot is reserved for you.' : 'Nobody else has reserved the robot.');
  }
  const until = clock(slot.until_us);
  return slot.from_us <= now_us
    ? check('reservation', 'waits', `The robot is reserved for ${who(slot.holder)} until ${until}.`, 'It begins then.')
    : check(
        'reservation',
        'waits',
        `It would run into the reservation of ${who(slot.holder)} at ${clock(slot.from_us)}.`,
        `It begins at ${until}, when that is over.`,
      );
}

function queue({ at_work, queue, priority }: Outlook): Check {
  const before = queue.filter((each) => !each.held && each.priority >= priority).length + (at_work ? 1 : 0);
  if (before === 0) return check('queue', 'ok', 'Nothing is before it in the queue.');
  const them = before === 1 ? 'One experiment is' : `${before} experiments are`;
  return check('queue', 'waits', `${them} before it.`, 'It begins after them; a higher priority begins first.');
}

// A robot of which the fluid is not known is taken for what the profile says.
function fluid({ robot }: Outlook, { fluid: of_all, fluids }: Profile): Check {
  const needed = fluids[0] ?? of_all;
  const now = robot.fluid;
  if (needed === '') return check('fluid', 'ok', 'It is for any fluid.');
  const then = fluids.length > 1 ? ' It pauses before the next fluid until you have changed it.' : '';
  if (now === null) {
    return check('fluid', 'unknown', `The first run says that the robot is in ${fluid_text(needed)}.${then}`);
  }
  if (now === needed) return check('fluid', 'ok', `The robot is in ${fluid_text(needed)}.${then}`);
  const text = `The robot is in ${fluid_text(now)}, the first run is in ${fluid_text(needed)}.`;
  return check('fluid', 'waits', text, 'Put it there, and say so.');
}

// The newest run that states a flow says what the pump drives; without one it counts as off.
function pump({ newest_run }: Outlook, profile: Profile): Check {
  if (newest_run === undefined) return check('pump', 'unknown', 'What the pump drives is not known yet.');
  const now = newest_run?.pump_profile ?? '';
  const is_off = now === '' || now === 'off';
  const is_same = profile.pump === now && (newest_run?.mean_flow_m_s ?? 0) === profile.mean_flow_m_s;
  if (profile.pump === 'off') {
    if (is_off) return check('pump', 'ok', 'The pump is off.');
    return check(
      'pump',
      'waits',
      `The pump was set to ${now}.`,
      'It pauses before its first run: switch the pump off.',
    );
  }
  const flow = `${profile.pump}, mean ${profile.mean_flow_m_s} m/s`;
  if (is_same) return check('pump', 'ok', `The pump is set to ${flow}.`);
  return check(
    'pump',
    'waits',
    `It needs the pump at ${flow}.`,
    'It pauses before its first run until you have set it.',
  );
}

const clock = (at_us: number) =>
  new Date(at_us / 1000).toLocaleString(undefined, {
    weekday: 'short',
    hour: '2-digit',
    minute: '2-digit',
    hourCycle: 'h23',
  });
