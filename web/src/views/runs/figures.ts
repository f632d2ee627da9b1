// Figures and measures of steps by name: what they are called, and how their numbers are written.

import { count, millimetres, percent } from '../../format';

export interface Figure {
  title: string;
  unit: string;
  text: (value: number | null | undefined) => string;
}

const seconds = (value: number | null | undefined) =>
  value === null || value === undefined ? '–' : value.toFixed(2).replace('-', '\u2212');
const share = (title: string): Figure => ({ title, unit: '%', text: (value) => percent(value, 2) });
const samples = (title: string): Figure => ({ title, unit: '', text: count });
const length = (title: string): Figure => ({ title, unit: 'mm', text: (value) => millimetres(value, 2) });
const time = (title: string): Figure => ({ title, unit: 's', text: seconds });

const kFigures: Record<string, Figure> = {
  duration_s: time('Duration'),
  samples_expected: samples('Samples made'),
  samples_stored: samples('Samples recorded'),
  samples_lost: samples('Samples lost'),
  missed_ticks: samples('Ticks missed by the robot'),
  longest_missed_ticks: samples('Most of them in a row'),
  gaps: samples('Gaps'),
  longest_gap_s: time('Longest gap'),
  resent_share: share('Sent again'),
  link_lost_share: share('Made without a link'),
  sensor_fault_share: share('With a sensor fault'),
  saturated_share: share('With a saturated duty'),
  latched_share: share('In emergency'),
  driven_share: share('Motor on'),
  longest_at_power_s: time('Longest time at power'),
  duty_rms: { title: 'Duty, root mean square', unit: '%', text: (value) => percent(value, 2) },
  position_range_m: length('Range of the position'),
  position_sd_max_m: length('Largest sd of the position'),
  settling_s: time('Settling time'),
  rise_10_90_s: time('Rise, 10 to 90 %'),
  overshoot_percent: { title: 'Overshoot', unit: '%', text: seconds },
  peak_m: length('Peak'),
  steady_state_error_m: length('Error at the end'),
  position_sd_m: length('Largest sd of the position'),
  start_m: length('Start'),
  target_m: length('Target'),
};

// One that this page does not know is shown under its own name.
export const figure_named = (name: string): Figure =>
  kFigures[name] ?? {
    title: name.replaceAll('_', ' '),
    unit: '',
    text: (value) => (value === null || value === undefined ? '–' : String(Number(value.toPrecision(4)))),
  };

// In the order of the table above; unknown ones last.
export function in_order<T extends { name: string }>(figures: readonly T[]): T[] {
  const names = Object.keys(kFigures);
  const place = ({ name }: T) => (names.includes(name) ? names.indexOf(name) : names.length);
  return [...figures].sort((a, b) => place(a) - place(b));
}
