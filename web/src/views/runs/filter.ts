// What runs are listed: the members of the address, and whether a run is meant by them.
//
//   #/runs?q=glucose&robot=sim-1&state=ended&fluid=water&from=2026-11-26&to=2026-11-27 14:30&chosen=3,4

import { clock_time, date_and_time } from '../../format';
import type { Run } from './runs_api';

export interface Filter {
  words: string[]; // each of which is somewhere in what is said of the run
  robot_id: string;
  state: string;
  fluid: string;
  from_ms: number; // of its beginning
  to_ms: number;
}

export type Query = Record<string, string>;

export interface Parsed {
  filter: Filter;
  problem: string; // '' when every member is understood; one that is not is left out
}

// Local time, as "2026-11-26" or "2026-11-26 14:30". null: it is none.
export function parse_moment(text: string): number | null {
  const [, year, month, day, hour = '0', minute = '0'] =
    /^\s*(\d{4})-(\d{1,2})-(\d{1,2})(?:[ T]+(\d{1,2}):(\d{2}))?\s*$/.exec(text) ?? [];
  if (!year) return null;
  const [y, m, d, h, min] = [year, month, day, hour, minute].map(Number) as [number, number, number, number, number];
  const date = new Date(y, m - 1, d, h, min);
  const is_real = date.getMonth() === m - 1 && date.getDate() === d && h < 24 && min < 60;
  return is_real ? date.getTime() : null;
}

const kDay_ms = 24 * 3_600_000;
const moment_problem = (text: string) =>
  `“${text}” is no date. Write it as 2026-11-26, or with a time as 2026-11-26 14:30.`;

export function parse_filter(query: Query): Parsed {
  let problem = '';
  const moment = (text: string | undefined, otherwise: number, whole_day: boolean): number => {
    if (!text?.trim()) return otherwise;
    const found_ms = parse_moment(text);
    if (found_ms === null) problem = moment_problem(text.trim());
    if (found_ms === null) return otherwise;
    return whole_day && !text.includes(':') ? found_ms + kDay_ms : found_ms;
  };
  const filter = {
    words: (query['q'] ?? '').toLowerCase().split(/\s+/).filter(Boolean),
    robot_id: query['robot'] ?? '',
    state: query['state'] ?? '',
    fluid: query['fluid'] ?? '',
    from_ms: moment(query['from'], -Infinity, false),
    to_ms: moment(query['to'], Infinity, true),
  };
  if (!problem && filter.from_ms >= filter.to_ms)
    problem = 'The first date is not before the second one: no run lies between.';
  return { filter, problem };
}

// The station filters by robot and state; the rest is looked for here, in all pages.
export const looks_here = ({ words, fluid, from_ms, to_ms }: Filter) =>
  words.length > 0 || fluid !== '' || from_ms !== -Infinity || to_ms !== Infinity;

export function matches(run: Run, { words, fluid, from_ms, to_ms }: Filter): boolean {
  const started_ms = run.started_at_us / 1000;
  if (fluid !== '' && run.fluid !== fluid) return false;
  if (started_ms < from_ms || started_ms >= to_ms) return false;
  if (words.length === 0) return true;
  const said = [
    `#${run.run_id}`,
    run.name,
    run.robot_id,
    run.fluid,
    run.pump_profile,
    run.tube,
    run.operator_name,
    run.profile,
    run.notes,
    run.verdict,
    run.made_by,
    date_and_time(started_ms),
  ]
    .join('\n')
    .toLowerCase();
  return words.every((word) => said.includes(word));
}

// The numbers in "3,4"; what is none is left out.
export function parse_numbers(text: string | undefined): number[] {
  const numbers = (text ?? '').split(',').map(Number);
  return [...new Set(numbers.filter((number) => Number.isSafeInteger(number) && number > 0))];
}

// How complete a run is, as far as its row says.
export function completeness(run: Run): { tone: string; text: string } {
  const missing = run.samples_expected - run.samples_stored - run.samples_lost;
  const missed = run.missed_ticks ? `; ${run.missed_ticks} missed by the robot` : '';
  if (run.samples_lost > 0) return { tone: 'caution', text: `${run.samples_lost} lost${missed}` };
  if (run.state === 'open') return { tone: '', text: 'recording' };
  if (missing > 0) return { tone: 'caution', text: `${missing} missing` };
  return { tone: '', text: `complete${missed}` };
}

export const started_text = (run: Run) => date_and_time(run.started_at_us / 1000);
export const clock_text = (utc_us: number) => clock_time(utc_us / 1000);
