// What stretch of time the plots show, past and present on one axis: running with the newest sample, or held still.
//
// Times are UTC in seconds. The caller that draws hands in `now_s`, the right edge of a plot that runs.

export const kLeastSpan_s = 0.2;
export const kLongestSpan_s = 40 * 86_400;

export interface Stretch {
  from_s: number;
  to_s: number;
}

export class TimeAxis {
  private held_to_s: number | null = null; // null: it runs

  constructor(
    public span_s = 60,
    private readonly on_change: () => void = () => undefined,
  ) {}

  get is_live(): boolean {
    return this.held_to_s === null;
  }

  view(now_s: number): Stretch {
    const to_s = this.held_to_s ?? now_s;
    return { from_s: to_s - this.span_s, to_s };
  }

  // The held stretch in whole milliseconds, as it stands in the address; null while it runs.
  address(): { from: string; to: string } | null {
    if (this.held_to_s === null) return null;
    const ms = (time_s: number) => String(Math.round(time_s * 1000));
    return { from: ms(this.held_to_s - this.span_s), to: ms(this.held_to_s) };
  }

  // Past the newest sample there is nothing: dragging there runs along with it again.
  pan(by_s: number, now_s: number): void {
    const to_s = this.view(now_s).to_s + by_s;
    this.held_to_s = to_s >= now_s ? null : to_s;
    this.on_change();
  }

  // `factor` < 1 shows less. What is at `at_s` stays where it is; while it runs, the newest sample does.
  zoom(factor: number, at_s: number, now_s: number): void {
    const { to_s } = this.view(now_s);
    const span_s = clamp(this.span_s * factor, kLeastSpan_s, kLongestSpan_s);
    const next_to_s = at_s + ((to_s - at_s) * span_s) / this.span_s;
    this.span_s = span_s;
    if (this.held_to_s !== null) this.held_to_s = next_to_s >= now_s ? null : next_to_s;
    this.on_change();
  }

  // Keeps the middle of what is looked at.
  choose_span(span_s: number, now_s: number): void {
    const { from_s, to_s } = this.view(now_s);
    this.zoom(span_s / this.span_s, (from_s + to_s) / 2, now_s);
  }

  hold(from_s: number, to_s: number): void {
    this.span_s = clamp(to_s - from_s, kLeastSpan_s, kLongestSpan_s);
    this.held_to_s = to_s;
    this.on_change();
  }

  run(): void {
    this.held_to_s = null;
    this.on_change();
  }
}

const clamp = (value: number, low: number, high: number) => Math.max(low, Math.min(high, value));

// A stretch from the address, where somebody may have typed anything. null: it names none.
export function stretch_of({ from = '', to = '' }: { from?: string; to?: string }): Stretch | null {
  if (!/^\d{1,15}$/.test(from) || !/^\d{1,15}$/.test(to)) return null;
  const [from_s, to_s] = [Number(from) / 1000, Number(to) / 1000];
  return to_s > from_s ? { from_s, to_s } : null;
}

const kSteps_s = [
  0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10_800, 21_600,
  43_200, 86_400, 172_800, 432_000, 864_000,
];

// Round times of a clock within the stretch, at most `most` steps of them. `zone_s`: local time less UTC.
export function clock_splits(
  { from_s, to_s }: Stretch,
  most: number,
  zone_s: number,
): { at_s: number[]; step_s: number } {
  const step_s = kSteps_s.find((step) => (to_s - from_s) / step <= most) ?? 864_000;
  const first = Math.ceil((from_s + zone_s) / step_s - 1e-6);
  const last = Math.floor((to_s + zone_s) / step_s + 1e-6);
  return { at_s: Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step_s - zone_s), step_s };
}

const two = (value: number) => String(value).padStart(2, '0');
const kMonths = ['Jan', 'Feb', 'Mar', 'Apr', 'May', 'Jun', 'Jul', 'Aug', 'Sep', 'Oct', 'Nov', 'Dec'];

// "14:05", "14:05:30" or "14:05:30.25", as fine as the step needs it; midnight is the day.
export function clock_label(utc_s: number, step_s: number, zone_s: number): string {
  const total_ms = Math.round((utc_s + zone_s) * 1000);
  const date = new Date(total_ms);
  const [h, m, s] = [date.getUTCHours(), date.getUTCMinutes(), date.getUTCSeconds()];
  if (step_s >= 60 && h === 0 && m === 0) return `${date.getUTCDate()} ${kMonths[date.getUTCMonth()]}`;
  if (step_s >= 60) return `${two(h)}:${two(m)}`;
  const decimals = step_s >= 1 ? 0 : step_s >= 0.1 ? 1 : 2;
  const fraction = decimals === 0 ? '' : `.${String(date.getUTCMilliseconds()).padStart(3, '0').slice(0, decimals)}`;
  return `${two(h)}:${two(m)}:${two(s)}${fraction}`;
}

// "26 Nov 2026".
export function day_label(utc_s: number, zone_s: number): string {
  const date = new Date((utc_s + zone_s) * 1000);
  return `${date.getUTCDate()} ${kMonths[date.getUTCMonth()]} ${date.getUTCFullYear()}`;
}
