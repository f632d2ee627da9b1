// How the station does, line by line: what it is, in one word, and what to do where the word is not "good".
//
// Everything here comes from /station, /recording, /metrics and /live. Thresholds: docs/cockpit.md, "Station".

import type { Recording, Station } from '../../api';
import { bytes, count, milliseconds } from '../../format';
import type { Metrics } from './metrics';
import { exact_text, span_text } from './moments';
import { full_in_s, is_within_disk, type Pace } from './pace';

export type Word = 'good' | 'caution' | 'bad' | 'unknown';

export interface HealthLine {
  name: string; // a part of its id
  group: 'Recording' | 'Robots and stop' | 'Station';
  title: string;
  word: Word;
  value: string;
  note: string; // what to do; of what is good, what it means
}

export interface Fleet {
  connected: number;
  known: number;
  silent: number; // connected, and their samples do not come
  unstoppable: number; // connected, and a stop would not reach them now
  unmeasured: number; // connected, and their firmware answers no probes
  samples_per_s: number; // that the connected ones make
  worst_ms: number | null; // round trip
}

export interface HealthInput {
  station: Station | null;
  recording: Recording | null;
  metrics: Metrics | null;
  metrics_problem: string; // why there are none
  pace: Pace | null;
  fleet: Fleet;
  is_page_measured: boolean; // the way from this page to the station
  clock_off_ms: number | null; // the station's clock less this machine's
  now_ms: number; // UTC
  is_current: boolean; // what the station said is what is so now
}

const kBehind_s = 2; // samples that wait for so long
const kFarBehind_s = 8; // a robot keeps about so much
const kSlowLink_ms = 250;
const kClockOff_ms = 1000;
const kWalHeld_s = 10;

type Line = Omit<HealthLine, 'group' | 'name' | 'title'>;
const line = (word: Word, value: string, note: string): Line => ({ word, value, note });
const kNotKnown = line('unknown', '', 'The station has not said it yet.');

// SAFETY: of a page that is cut off no line claims to be good now.
export function judge(input: HealthInput): HealthLine[] {
  const lines = all_lines(input);
  if (input.is_current) return lines;
  return lines.map((each) =>
    each.word === 'unknown' ? each : { ...each, word: 'unknown', note: 'This was so when the station was heard last.' },
  );
}

function all_lines(input: HealthInput): HealthLine[] {
  const { recording, station, metrics, metrics_problem, fleet, pace } = input;
  const no_figures = metrics_problem === '' ? kNotKnown : line('unknown', '', `Not read: ${metrics_problem}`);
  const of = (group: HealthLine['group'], name: string, title: string, said: Line): HealthLine => ({
    group,
    name,
    title,
    ...said,
  });
  return [
    of('Recording', 'recording', 'Recording', recording ? recording_line(recording) : kNotKnown),
    of('Recording', 'queue', 'Not yet on disk', recording ? queue_line(recording, fleet) : kNotKnown),
    of('Recording', 'writes', 'Writes to the disk', recording ? writes_line(recording, pace, fleet) : kNotKnown),
    of('Recording', 'lost', 'Lost samples', recording ? lost_line(recording) : kNotKnown),
    of('Recording', 'records', 'Events and commands', recording ? records_line(recording) : kNotKnown),
    of('Recording', 'disk', 'Free disk', recording ? disk_line(recording, pace) : kNotKnown),
    of('Recording', 'log', 'Write-ahead log', recording ? wal_line(recording) : kNotKnown),
    of('Recording', 'database', 'Database', station ? database_line(station) : kNotKnown),
    of('Robots and stop', 'robots', 'Robots', robots_line(fleet)),
    of('Robots and stop', 'links', 'Links to the robots', links_line(fleet)),
    of('Robots and stop', 'stop', 'Way of a stop', stop_line(fleet, input.is_page_measured)),
    of('Robots and stop', 'stops', 'Stops until now', metrics ? stops_line(metrics) : no_figures),
    of('Station', 'faults', 'Faults inside', metrics ? faults_line(metrics) : no_figures),
    of('Station', 'connections', 'Connections', metrics ? connections_line(metrics) : no_figures),
    of('Station', 'security', 'Encryption', station ? security_line(station, input.now_ms) : kNotKnown),
    of('Station', 'clock', 'Clock', clock_line(input.clock_off_ms, recording?.clock_is_doubted ?? false)),
  ];
}

function recording_line({ state, problem }: Recording): Line {
  if (state === 'recording') return line('good', 'everything is recorded', 'What arrives becomes durable.');
  const what_to_do = problem ?? 'The station’s log says why.';
  if (state === 'low_space') return line('caution', 'recording, and the disk is filling up', what_to_do);
  return line('bad', 'nothing is recorded now', what_to_do);
}

function queue_line({ queued_samples }: Recording, fleet: Fleet): Line {
  const value = `${count(queued_samples)} samples`;
  const behind_s = fleet.samples_per_s > 0 ? queued_samples / fleet.samples_per_s : 0;
  if (behind_s > kFarBehind_s)
    return line(
      'bad',
      value,
      `The disk is ${span_text(behind_s)} behind, and robots keep about ${kFarBehind_s} s. Use a faster disk, or fewer robots.`,
    );
  if (behind_s > kBehind_s)
    return line('caution', value, `The disk is ${span_text(behind_s)} behind. After a reconnect this passes.`);
  return line('good', value, 'Received, and written with the next commit.');
}

function writes_line({ counters }: Recording, pace: Pace | null, fleet: Fleet): Line {
  const { commits_failed } = counters;
  if (!pace) return line('unknown', '', 'It is known a few seconds after the page was opened.');
  const value = `${count(pace.samples_per_s)} samples/s, ${(pace.commits / pace.over_s).toFixed(1)} commits/s`;
  if (pace.commits === 0 && fleet.samples_per_s > 0)
    return line('bad', value, `No write for ${span_text(pace.over_s)}, while robots send. The station’s log says why.`);
  if (commits_failed > 0)
    return line(
      'caution',
      `${value}; ${count(commits_failed)} failed`,
      'Failed commits were tried again. Check the disk (station’s log, kernel’s log).',
    );
  return line('good', value, `Over the last ${span_text(pace.over_s)}, counted by the station.`);
}

function lost_line({ counters }: Recording): Line {
  const { samples_lost, samples_refused } = counters;
  const asked = samples_refused > 0 ? `; ${count(samples_refused)} asked for again` : '';
  if (samples_lost === 0) return line('good', `none since the start${asked}`, 'Every sample that was made is there.');
  return line(
    'caution',
    `${count(samples_lost)} since the start${asked}`,
    'Robots were away for longer than they can keep samples. Each gap is in the runs that it concerns.',
  );
}

function records_line({ counters }: Recording): Line {
  const { records_refused, batches_malformed } = counters;
  if (records_refused > 0)
    return line(
      'bad',
      `${count(records_refused)} not recorded`,
      'The disk was too far behind. The audit says how many entries it left out.',
    );
  if (batches_malformed > 0)
    return line(
      'caution',
      `${count(batches_malformed)} frames that cannot be`,
      'A robot sends frames that the station refuses: check its firmware. The station’s log names it.',
    );
  return line('good', 'all recorded', 'None was refused since the start.');
}

function disk_line(recording: Recording, pace: Pace | null): Line {
  const { space, free_bytes, database_bytes, retention, problem } = recording;
  const is_limited = is_within_disk(recording); // max_database_mb is reached before the disk is full
  const room_bytes = is_limited ? Math.max(0, retention.max_database_bytes - database_bytes) : free_bytes;
  const full_s = pace && full_in_s(pace, room_bytes);
  const how_long = full_s ? `, enough for about ${span_text(full_s)}` : '';
  const of_database = is_limited ? `; the database may grow by ${bytes(room_bytes)}` : '';
  const value = `${bytes(free_bytes)}${of_database}${how_long}`;
  if (space === 'critical')
    return line('bad', value, problem ?? 'No run and no backup can be begun. Make room on the database’s disk.');
  if (space === 'low') return line('caution', value, problem ?? 'Make room on the database’s disk.');
  if (retention.all_held)
    return line(
      'caution',
      value,
      `Runs alone use more than max_database_mb allows (${bytes(retention.max_database_bytes)}): discard runs, or raise it.`,
    );
  if (is_limited)
    return line(
      'good',
      value,
      `Near ${bytes(retention.max_database_bytes)} its oldest samples outside runs are removed.`,
    );
  return line('good', value, 'On the disk of the database.');
}

function wal_line({ wal_bytes, wal_held_s }: Recording): Line {
  if (wal_held_s > kWalHeld_s)
    return line(
      'caution',
      `${bytes(wal_bytes)}, held for ${span_text(wal_held_s)}`,
      'Another program reads the database in one long transaction, and the log grows meanwhile. End that program.',
    );
  return line('good', bytes(wal_bytes), 'Up to 128 MB is usual.');
}

function database_line({ losses }: Station): Line {
  const latest = losses.at(-1);
  if (!latest) return line('good', 'complete', 'It holds all that it has ever held.');
  return line(
    'bad',
    `${losses.length === 1 ? 'a loss' : `${losses.length} losses`}, noticed ${exact_text(latest.noticed_at_us)}`,
    `${latest.problem} What to do: docs/operations.md, “The database has lost commits”.`,
  );
}

function robots_line({ connected, known, silent }: Fleet): Line {
  const value = `${count(connected)} of ${count(known)} connected`;
  if (silent > 0)
    return line(
      'caution',
      `${value}, ${count(silent)} silent`,
      'A silent robot is connected and sends no samples: see the view Fleet, filter “silent”.',
    );
  return line('good', value, known === 0 ? 'None has ever connected.' : 'Each one that is connected sends samples.');
}

function links_line({ connected, worst_ms }: Fleet): Line {
  if (connected === 0) return line('good', 'none', 'No robot is connected.');
  if (worst_ms === null) return line('unknown', '', 'No round trip is measured yet.');
  const value = `${milliseconds(worst_ms)} round trip, the slowest`;
  if (worst_ms > kSlowLink_ms)
    return line('caution', value, 'Check the network to that robot: the view Fleet shows the link of each.');
  return line('good', value, 'From the station to the robot and back.');
}

// SAFETY: a way that is not measured is not called good.
function stop_line({ connected, unstoppable, unmeasured }: Fleet, is_page_measured: boolean): Line {
  if (connected === 0) return line('good', 'no robot is connected', 'A stop would be kept until a robot reconnects.');
  if (unstoppable > 0)
    return line(
      'bad',
      `closed to ${count(unstoppable)} of ${count(connected)}`,
      'A stop would not reach these robots now. Cut their power if they move; the view Fleet names them.',
    );
  if (unmeasured > 0)
    return line(
      'caution',
      `not measured to ${count(unmeasured)} of ${count(connected)}`,
      'Their firmware answers no probes, or has only just connected.',
    );
  if (!is_page_measured) return line('unknown', '', 'The way from this page is not measured yet.');
  return line(
    'good',
    `open to ${connected === 1 ? 'the one' : `all ${count(connected)}`} connected`,
    'Tried twice a second.',
  );
}

function stops_line(metrics: Metrics): Line {
  const { count: stops, bound_s } = metrics.within('rheonaut_emergency_stop_seconds', 'stage="acknowledged"', 0.99);
  if (stops === 0) return line('good', 'none since the start', 'Of connected robots.');
  const within =
    bound_s === null ? 'some took longer than the last bound counted' : `99 % within ${milliseconds(bound_s * 1000)}`;
  const value = `${count(stops)} acknowledged, ${within}`;
  if (bound_s === null || bound_s > 1)
    return line('caution', value, 'A stop took more than a second: check the links.');
  return line('good', value, 'From the request to the robot’s answer, since the start.');
}

function faults_line(metrics: Metrics): Line {
  const faults = metrics.sum('rheonaut_exceptions_total');
  if (faults === null) return kNotKnown;
  if (faults === 0) return line('good', 'none since the start', 'Nothing has ended by a fault of the program.');
  return line(
    'caution',
    `${count(faults)} since the start`,
    'Please report the line of the station’s log that says which.',
  );
}

function connections_line(metrics: Metrics): Line {
  const pages = metrics.value('rheonaut_http_connections');
  const robots = metrics.value('rheonaut_robot_connections');
  if (pages === null || robots === null) return kNotKnown;
  const refused =
    (metrics.value('rheonaut_http_connections_refused_total') ?? 0) +
    (metrics.value('rheonaut_robot_connections_refused_total') ?? 0);
  const value = `${count(pages)} of pages and scripts, ${count(robots)} of robots`;
  if (refused === 0) return line('good', value, 'None was refused since the start.');
  return line(
    'caution',
    `${value}; ${count(refused)} refused`,
    'If all of them were yours, raise http.max_connections or robots.max_connections (docs/operations.md).',
  );
}

const kSoon_s = 30 * 86_400;

function security_line({ security }: Station, now_ms: number): Line {
  const { certificate, exposed } = security;
  if (exposed)
    return line(
      'bad',
      'none, and other machines reach it',
      'Anyone on the network can read along and drive: set up TLS.',
    );
  if (!certificate) return line('good', 'none needed', 'Both ports are reached from this machine only.');
  const left_s = (certificate.not_after_us / 1000 - now_ms) / 1000;
  if (left_s <= 0) return line('bad', 'the certificate has expired', 'Renew it: rheonaut certificate --renew');
  const value = `TLS, certificate for ${span_text(left_s)} more`;
  if (certificate.expires_soon || left_s < kSoon_s)
    return line('caution', value, 'Renew it: rheonaut certificate --renew');
  return line('good', value, 'See Certificate.');
}

function clock_line(off_ms: number | null, is_doubted: boolean): Line {
  if (is_doubted)
    return line(
      'caution',
      'went forward by more than a day',
      'What its age would remove stays until the clock has stood by that for 24 h of running, or an administrator accepts it (the manual: “A clock that jumps”).',
    );
  if (off_ms === null) return line('unknown', '', 'Compared with this machine’s when the station has answered.');
  const size = Math.abs(off_ms);
  if (size < kClockOff_ms)
    return line('good', 'as this machine’s, within a second', 'The station’s and this machine’s clock agree.');
  return line(
    'caution',
    `${span_text(size / 1000)} ${off_ms > 0 ? 'ahead of' : 'behind'} this machine’s`,
    'One of the two is wrong. Set it by a time server: times of runs and retention go by the station’s clock.',
  );
}

// The worst of them, and how many are not good.
export function summary_of(lines: readonly HealthLine[]): { word: Word; text: string; off: HealthLine[] } {
  const off = lines.filter(({ word }) => word === 'bad' || word === 'caution');
  const bad = off.filter(({ word }) => word === 'bad').length;
  if (lines.every(({ word }) => word === 'unknown')) return { word: 'unknown', text: 'not known now', off };
  const unknown = lines.filter(({ word }) => word === 'unknown').length;
  // SAFETY: what is not known is not called well.
  if (off.length === 0 && unknown > 0) return { word: 'unknown', text: `${count(unknown)} not known yet`, off };
  if (off.length === 0) return { word: 'good', text: 'all is well', off };
  const text =
    bad > 0
      ? `${count(bad)} bad${off.length > bad ? `, ${count(off.length - bad)} to look at` : ''}`
      : `${count(off.length)} to look at`;
  return { word: bad > 0 ? 'bad' : 'caution', text, off };
}

// SAFETY: says that nothing is to be done only of what is known.
export function lead_of(lines: readonly HealthLine[]): string {
  const { word, off } = summary_of(lines);
  const titles = (of: readonly HealthLine[]) => of.map(({ title }) => title).join(', ');
  const unknown = lines.filter((line) => line.word === 'unknown');
  const not_known = unknown.length > 0 ? ` Not known: ${titles(unknown)}.` : '';
  if (word === 'good') return 'Nothing needs you. Each line is judged again every five seconds.';
  return (off.length > 0 ? `Look at: ${titles(off)}.${not_known}` : `What is known is well.${not_known}`).trim();
}
