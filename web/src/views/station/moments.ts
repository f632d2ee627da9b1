// Times of the station's lists: to the minute or second, in local time or UTC as the plots are, and exactly on demand.

// "2026-11-26 05:50", with seconds "2026-11-26 05:50:35".
export function moment_text(at_us: number, is_utc: boolean, has_seconds = false): string {
  const utc = new Date(Math.floor(at_us / 1000));
  const shown = is_utc ? utc : new Date(utc.getTime() - utc.getTimezoneOffset() * 60_000);
  return shown
    .toISOString()
    .slice(0, has_seconds ? 19 : 16)
    .replace('T', ' ');
}

// "2026-11-26 05:50:35.496012 UTC".
export function exact_text(at_us: number): string {
  const micros = String(at_us % 1_000_000).padStart(6, '0');
  return `${moment_text(at_us, true, true)}.${micros} UTC`;
}

// How long in one short word, from seconds to years: "40 s", "12 min", "5 h", "64 days", "12 years".
export function span_text(time_s: number): string {
  const [minute, hour, day, year] = [60, 3600, 86_400, 365 * 86_400];
  const counted = (value: number, unit: string) => `${Math.floor(value)} ${unit}${Math.floor(value) === 1 ? '' : 's'}`;
  if (time_s < minute) return `${Math.max(0, Math.floor(time_s))} s`;
  if (time_s < hour) return `${Math.floor(time_s / minute)} min`;
  if (time_s < 2 * day) return `${Math.floor(time_s / hour)} h`;
  if (time_s < 3 * year) return counted(time_s / day, 'day');
  return time_s < 1000 * year ? counted(time_s / year, 'year') : 'more than 1000 years';
}

// The name of a backup that is made now: it sorts by its time, and is one that the station takes.
export const backup_name = (now_ms: number) =>
  moment_text(now_ms * 1000, true, true)
    .replace(' ', '-')
    .replaceAll(':', '') + 'Z';

// The age of a past moment: "just now", "3 min ago".
export const ago_text = (at_us: number, now_ms: number) => {
  const age_s = (now_ms - at_us / 1000) / 1000;
  return age_s < 60 ? 'just now' : `${span_text(age_s)} ago`;
};
