// While the page shows the past, nothing on it acts on a robot but the stop.
//
// The view of a replay has no control in it. SAFETY: this is the second lock: whatever asks the station all the same (a
// key, a gamepad, a hand that was on a control when the view was opened) is refused on the page.

import type { Route } from './route';

type Where = Pick<Route, 'view' | 'parts'>;

export const shows_past = ({ view, parts }: Where): boolean => view === 'runs' && parts[1] === 'replay';

// Stops, what keeps an experiment at rest, and what concerns this page and its session.
const kAllowed = /\/(emergency-stop|login|logout|recording\/losses\/acknowledge|experiments\/\d+\/(pause|abort))$/;

export function is_refused_in_past(now: Where, method: string, path: string, body: unknown): boolean {
  return shows_past(now) && method !== 'GET' && !kAllowed.test(path) && !ends_duty(body);
}

// SAFETY: a duty that was held when the replay was opened ends at once; this is what ends it.
function ends_duty(body: unknown): boolean {
  if (typeof body !== 'string') return false;
  const { kind, duty } = JSON.parse(body) as { kind?: unknown; duty?: unknown };
  return kind === 'set_duty' && duty === 0;
}
