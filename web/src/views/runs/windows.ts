// The window of time that is looked at: from the address, and after zooming or moving it.

import type { Window } from './runs_api';

const kLeast_us = 50_000;

// Members `from` and `to` of the address, UTC in milliseconds. null: the whole run.
export function parse_window(query: Record<string, string>): Window | null {
  const [from_us, to_us] = [query['from'], query['to']].map((text) => Math.round(Number(text || NaN) * 1000)) as [
    number,
    number,
  ];
  return from_us >= 0 && to_us > from_us ? { from_us, to_us } : null;
}

export const window_query = (window: Window | null): Record<string, string> => ({
  from: window ? String(Math.round(window.from_us / 1000)) : '',
  to: window ? String(Math.round(window.to_us / 1000)) : '',
});

// `by` < 1 shows less. The whole run is null again.
export function zoomed(window: Window, by: number, bounds: Window): Window | null {
  const middle_us = (window.from_us + window.to_us) / 2;
  const half_us = Math.max(kLeast_us, (window.to_us - window.from_us) * by) / 2;
  return inside({ from_us: middle_us - half_us, to_us: middle_us + half_us }, bounds);
}

export function moved(window: Window, share: number, bounds: Window): Window | null {
  const by_us = (window.to_us - window.from_us) * share;
  return inside({ from_us: window.from_us + by_us, to_us: window.to_us + by_us }, bounds);
}

export const around = (at_us: number, half_us: number, bounds: Window): Window | null =>
  inside({ from_us: at_us - half_us, to_us: at_us + half_us }, bounds);

// Keeps its length where it can.
export function inside(window: Window, bounds: Window): Window | null {
  const length_us = window.to_us - window.from_us;
  if (length_us >= bounds.to_us - bounds.from_us) return null;
  const from_us = Math.min(Math.max(window.from_us, bounds.from_us), bounds.to_us - length_us);
  return { from_us: Math.round(from_us), to_us: Math.round(from_us + length_us) };
}
