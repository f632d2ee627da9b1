// Times on the axis of a run: seconds since its start, or the time of day.

import { clock_time } from '../../format';

const kSteps_s = [
  0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14_400, 21_600,
  43_200, 86_400, 172_800, 604_800,
];

export function time_step_s(span_s: number, most: number): number {
  return kSteps_s.find((step) => span_s / step <= most) ?? (kSteps_s.at(-1) as number);
}

// Round times in [from_s, to_s] since an origin; `offset_s` is added before rounding: the origin's time of day.
export function time_splits(from_s: number, to_s: number, step_s: number, offset_s = 0): number[] {
  const first = Math.ceil((from_s + offset_s) / step_s - 1e-9);
  const last = Math.floor((to_s + offset_s) / step_s + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, at) => (first + at) * step_s - offset_s);
}

// Seconds since local midnight, for round times of day.
export function time_of_day_s(utc_ms: number): number {
  const date = new Date(utc_ms);
  return date.getHours() * 3600 + date.getMinutes() * 60 + date.getSeconds() + date.getMilliseconds() / 1000;
}

// "0.25 s", "12 s", "2:30", "1:02:30"
export function since_text(time_s: number, decimals = 2): string {
  const sign = time_s < -1e-9 ? '\u2212' : '';
  const size_s = Math.abs(time_s);
  if (size_s < 60) return `${sign}${Number(size_s.toFixed(decimals))} s`;
  const whole_s = Number(size_s.toFixed(decimals));
  const [hours, minutes, seconds] = [Math.floor(whole_s / 3600), Math.floor(whole_s / 60) % 60, whole_s % 60];
  const rest = Number(seconds.toFixed(decimals));
  const padded = rest < 10 ? `0${rest}` : String(rest);
  return hours > 0 ? `${sign}${hours}:${String(minutes).padStart(2, '0')}:${padded}` : `${sign}${minutes}:${padded}`;
}

// As exact as steps of the axis are.
export function clock_label(utc_ms: number, step_s: number): string {
  const text = clock_time(Math.round(utc_ms));
  return step_s >= 60 ? text.slice(0, 5) : step_s >= 1 ? text.slice(0, 8) : text.slice(0, 11);
}
