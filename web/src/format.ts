// Numbers as people read them: the only place where SI units become millimetres, percent and clock times.
//
// A minus sign is U+2212 and a missing value is an en dash, so that a column of numerals keeps its width.

const kMissing = '–';
const kMinus = '\u2212';

// A rounded number with a real minus sign; never "−0".
function fixed(value: number, decimals: number): string {
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? kMinus + text : text;
}

function scaled(value: number | null | undefined, factor: number, decimals: number): string {
  return value === null || value === undefined || !Number.isFinite(value) ? kMissing : fixed(value * factor, decimals);
}

export const millimetres = (length_m: number | null | undefined, decimals = 1) => scaled(length_m, 1e3, decimals);
// How many standard deviations stand behind each "±" of the page.
export const kSpread_sd = 2;
// The spread of an estimate, as "± 1.6".
export const plus_minus = (sd_m: number | null | undefined) =>
  `± ${millimetres(sd_m === null || sd_m === undefined ? null : kSpread_sd * sd_m)}`;
// Beside a plot whose axis does not show all of the band; the distance from the estimate to its edge, at most.
export const band_cut_text = (spread_m: number) => `± cut at the edge: up to ± ${millimetres(spread_m, 0)} mm`;

export const millimetres_per_s = (velocity_m_s: number | null | undefined) => scaled(velocity_m_s, 1e3, 1);
export const percent = (duty: number | null | undefined, decimals = 1) => scaled(duty, 100, decimals);
export const millivolts = (value_mv: number | null | undefined) => scaled(value_mv, 1, 1);
export const volts_of_mv = (value_mv: number | null | undefined) => scaled(value_mv, 1e-3, 2);
export const milliseconds_of_us = (time_us: number | null | undefined, decimals = 1) => scaled(time_us, 1e-3, decimals);

export const count = (value: number | null | undefined) =>
  value === null || value === undefined
    ? kMissing
    : Math.round(value).toLocaleString('en').replaceAll(',', '\u202f').replace('-', kMinus);

// The size of a file or a disk: "640 kB", "12.4 GB".
export function bytes(size: number): string {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let [value, at] = [size, 0];
  while (value >= 999.5 && at < units.length - 1) [value, at] = [value / 1000, at + 1];
  return `${at === 0 || value >= 99.95 ? Math.round(value) : value.toFixed(1)} ${units[at]}`;
}

// The length a person typed in millimetres, in metres; null when it is no number. Comma and both minus signs are taken.
export function parse_millimetres(text: string): number | null {
  const plain = text.trim().replace(kMinus, '-').replace(',', '.');
  if (!/^[+-]?(\d+(\.\d*)?|\.\d+)$/.test(plain)) return null;
  // Through the shortest decimal, so that 100.3 mm is 0.1003 m and not 0.10030000000000001 m.
  return Number((Number(plain) / 1e3).toPrecision(12));
}

export const millimetres_to_m = (length_mm: number) => Number((length_mm / 1e3).toPrecision(12));
export const m_to_millimetres = (length_m: number) => length_m * 1e3;
export const percent_to_duty = (value_percent: number) => Number((value_percent / 100).toPrecision(12));
export const duty_to_percent = (duty: number) => duty * 100;

// A way or a wait that was measured: "0.4 ms", "38 ms".
export const milliseconds = (time_ms: number) => `${time_ms < 9.95 ? time_ms.toFixed(1) : Math.round(time_ms)} ms`;

// How long ago, in one short word: "340 ms", "2.1 s", "5 min".
export function age(age_ms: number): string {
  if (age_ms < 1000) return `${Math.max(0, Math.round(age_ms / 10) * 10)} ms`;
  if (age_ms < 60_000) return `${(age_ms / 1000).toFixed(1)} s`;
  if (age_ms < 3_600_000) return `${Math.floor(age_ms / 60_000)} min`;
  return `${Math.floor(age_ms / 3_600_000)} h`;
}

// A stretch of time that runs: "0:07", "12:30", "1:02:03".
export function duration(time_ms: number): string {
  const total_s = Math.max(0, Math.floor(time_ms / 1000));
  const two = (value: number) => String(value).padStart(2, '0');
  const [h, m, s] = [Math.floor(total_s / 3600), Math.floor(total_s / 60) % 60, total_s % 60];
  return h > 0 ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}`;
}

// Local time of day to the millisecond.
export function clock_time(utc_ms: number): string {
  const date = new Date(utc_ms);
  const two = (value: number) => String(value).padStart(2, '0');
  const ms = String(date.getMilliseconds()).padStart(3, '0');
  return `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}.${ms}`;
}

// Local date and time of day to the minute: "2026-11-26 14:05".
export function date_and_time(utc_ms: number): string {
  const date = new Date(utc_ms);
  const two = (value: number) => String(value).padStart(2, '0');
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())} ${two(date.getHours())}:${two(date.getMinutes())}`;
}

// An identifier of the protocol as words: "sensor_out_of_range" becomes "sensor out of range".
export const fluid_text = (fluid: string) => (fluid === 'non_newtonian' ? 'non-Newtonian' : words(fluid));
export const words = (identifier: string) => identifier.replaceAll('_', ' ');
