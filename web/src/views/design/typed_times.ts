// The times that a person types for an identification: the window of each run, and the limit of the search.

import { kLimit, type Design } from './address';
import { number_text } from './words';

export type TimeField = 'from' | 'to' | 'limit';
export type Times = Pick<Design, 'from_s' | 'to_s' | 'limit_s'>;
export interface TimeProblem {
  field: TimeField;
  text: string;
}

const kLongest_s = 1e6;
const kNames: Record<TimeField, string> = { from: 'From', to: 'To', limit: 'Search at most' };
const kAllowed: Record<TimeField, [number, number]> = {
  from: [0, kLongest_s],
  to: [0, kLongest_s],
  limit: [kLimit.from, kLimit.to],
};

// As they stand in the fields; empty: as usual.
export const texts_of = ({ from_s, to_s, limit_s }: Times): Record<TimeField, string> => ({
  from: from_s === 0 ? '' : number_text(from_s),
  to: to_s === null ? '' : number_text(to_s),
  limit: limit_s === kLimit.usual ? '' : number_text(limit_s),
});

// What the fields mean, or what is wrong in one of them: nothing is then taken of what was typed, and nothing fitted.
export function times_of(texts: Record<TimeField, string>): Times | TimeProblem {
  const read = {} as Record<TimeField, number | null>;
  for (const field of ['from', 'to', 'limit'] as const) {
    const text = texts[field].trim();
    const value = text === '' ? null : Number(text.replace(',', '.'));
    const [least, most] = kAllowed[field];
    if (Number.isNaN(value)) return { field, text: `${kNames[field]}: “${text}” is not a number of seconds.` };
    if (value !== null && (value < least || value > most))
      return { field, text: `${kNames[field]}: it must lie between ${least} and ${most} s.` };
    read[field] = value;
  }
  const { from, to, limit } = read;
  if (to !== null && to <= (from ?? 0)) return { field: 'to', text: 'To: it must be later than From.' };
  return { from_s: from ?? 0, to_s: to, limit_s: limit ?? kLimit.usual };
}

export const is_problem = (found: Times | TimeProblem): found is TimeProblem => 'field' in found;
