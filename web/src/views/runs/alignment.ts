// What several runs are compared at: the members of the address, and those that the station is asked with.
//
//   #/runs/compare?runs=3,4&at=step&number=2&channel=duty&from=-1&to=10    (from and to in seconds since the moment)

import { parse_numbers } from './filter';
import { kMostComparedTraces } from './runs_api';

export const kMoments = ['start', 'step', 'disturbance', 'event', 'marker'] as const;
export type AlignedAt = (typeof kMoments)[number];

export interface Comparison {
  runs: number[];
  at: AlignedAt;
  number: number;
  event: string;
  marker: string;
  reference: number; // the run that others are compared with
  window_s: [number, number] | null;
  problem: string; // why the station is not asked; ''
}

export function parse_comparison(query: Record<string, string>): Comparison {
  const runs = parse_numbers(query['runs']);
  const at = kMoments.find((moment) => moment === query['at']) ?? 'start';
  const number = Number(query['number'] ?? '1');
  const reference = Number(query['reference'] ?? '');
  const [from_s, to_s] = [Number(query['from'] || NaN), Number(query['to'] || NaN)];
  const made = {
    runs,
    at,
    number: Number.isSafeInteger(number) && number >= 1 ? Math.min(number, 10_000) : 1,
    event: query['event'] ?? 'detection',
    marker: query['marker'] ?? '',
    reference: runs.includes(reference) ? reference : (runs[0] ?? 0),
    window_s: from_s < to_s ? ([from_s, to_s] as [number, number]) : null,
  };
  return { ...made, problem: problem_of(runs) };
}

function problem_of(runs: number[]): string {
  if (runs.length < 2) return 'A comparison needs at least two runs. Choose them in the list.';
  if (runs.length > kMostComparedTraces)
    return `${runs.length} runs are too many: at most ${kMostComparedTraces} can be compared. Take some out.`;
  return '';
}

// Members of the routes of a comparison.
export function asked({
  runs,
  at,
  number,
  event,
  marker,
  reference,
  window_s,
}: Comparison): Record<string, string | number> {
  const counts = at !== 'start' ? { number } : {};
  return {
    runs: runs.join(','),
    at,
    ...counts,
    ...(at === 'event' ? { event } : {}),
    ...(at === 'marker' && marker !== '' ? { marker } : {}),
    reference_run_id: reference,
    ...(window_s ? { from_ms: Math.floor(window_s[0] * 1000), to_ms: Math.ceil(window_s[1] * 1000) } : {}),
  };
}

// How far rows of the answer should be apart: about two a pixel, and within the station's bound of values.
export function grid_us(length_s: number, points: number): number {
  return Math.min(60_000_000, Math.max(10_000, Math.ceil(length_s / points / 0.01) * 10_000));
}
