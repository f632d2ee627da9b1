// Which traces there are, in which strip each is drawn, and which of them this browser shows.

import { signal, type Signal } from '@preact/signals';
import type { StripOptions, Trace } from '../chart';
import { milliseconds_of_us, millimetres, millimetres_per_s, millivolts, percent } from '../format';
import type { Column } from '../samples';
import { browser_shelf, type Shelf } from '../settings';

export interface TraceChoice extends Trace {
  name: string; // as it is kept
  text: string;
  swatch: string; // its sign in the legend, a class
}

export interface Strip extends Omit<StripOptions, 'traces' | 'band'> {
  name: string;
  title: string;
  unit: string;
  value: (value: number | null) => string;
  traces: TraceChoice[]; // the last one is drawn on top
}

const trace = (name: string, text: string, column: Column, colour: string, more: Partial<TraceChoice> = {}) => ({
  name,
  text,
  column,
  colour,
  width_px: 1.3,
  swatch: name,
  ...more,
});

export const kStrips: readonly Strip[] = [
  {
    name: 'position',
    title: 'Position',
    unit: 'mm',
    value: millimetres,
    label: (value) => millimetres(value, 0),
    least_span: 0.08,
    is_large: true,
    traces: [
      trace('reference', 'reference', 'reference_m', '--commanded-soft', { width_px: 1.2 }),
      trace('setpoint', 'setpoint', 'setpoint_m', '--commanded', {
        width_px: 1.4,
        dash_px: [7, 5],
        swatch: 'commanded',
      }),
      trace('seen', 'seen by controller', 'position_m', '--seen', { width_px: 1.2 }),
      trace('position', 'estimated ± 2 sd', 'estimate_m', '--measured', { width_px: 1.8, swatch: 'measured' }),
    ],
  },
  {
    name: 'velocity',
    title: 'Velocity',
    unit: 'mm/s',
    value: millimetres_per_s,
    label: (value) => millimetres(value, 0),
    least_span: 0.02,
    traces: [trace('velocity', 'velocity', 'velocity_m_s', '--measured')],
  },
  {
    name: 'acceleration',
    title: 'Acceleration',
    unit: 'mm/s²',
    value: millimetres,
    label: (value) => millimetres(value, 0),
    least_span: 0.1,
    traces: [trace('acceleration', 'acceleration', 'acceleration_m_s2', '--seen')],
  },
  {
    name: 'duty',
    title: 'Duty',
    unit: '%',
    value: percent,
    label: (value) => percent(value, 0),
    fixed_range: [-1.08, 1.08],
    splits: [-1, 0, 1],
    traces: [trace('duty', 'duty', 'duty', '--duty')],
  },
  {
    name: 'impedance',
    title: 'Impedance',
    unit: 'mV',
    value: millivolts,
    label: (value) => millivolts(value).replace('.0', ''),
    least_span: 60,
    traces: [trace('impedance', 'impedance', 'impedance_mv', '--impedance')],
  },
  {
    name: 'disturbance',
    title: 'Disturbance',
    unit: 'mm',
    value: millimetres,
    label: (value) => millimetres(value, 0),
    least_span: 0.04,
    traces: [trace('disturbance', 'disturbance', 'disturbance_m', '--commanded')],
  },
  {
    name: 'spread',
    title: 'Position sd',
    unit: 'mm',
    value: millimetres,
    label: (value) => millimetres(value, 1),
    least_span: 0.004,
    traces: [trace('spread', 'standard deviation of the position', 'position_sd_m', '--seen')],
  },
  {
    name: 'round_trip',
    title: 'Round trip',
    unit: 'ms',
    value: milliseconds_of_us,
    label: (value) => milliseconds_of_us(value, 0),
    least_span: 4000,
    traces: [trace('round_trip', 'round trip, while this page is open', 'round_trip_us', '--caution')],
  },
];

const kUsual = ['position', 'seen', 'setpoint', 'reference', 'duty', 'impedance'];
const kKey = 'rheonaut.plots';
const kNames = kStrips.flatMap((strip) => strip.traces.map(({ name }) => name));

export interface Kept {
  traces: string[];
  is_utc: boolean;
  span_s: number;
}

// What the browser keeps of how the plots look. SAFETY: nothing that commands or stops reads it.
export class PlotSettings {
  readonly kept: Signal<Kept>;

  constructor(private readonly shelf: Shelf | null) {
    this.kept = signal(this.load());
  }

  change(change: Partial<Kept>): void {
    this.kept.value = { ...this.kept.peek(), ...change };
    try {
      this.shelf?.setItem(kKey, JSON.stringify(this.kept.peek()));
    } catch {
      // A browser that keeps nothing shows it so until the page is closed.
    }
  }

  // At least one stays: an empty view would look like a fault.
  toggle(name: string): void {
    const { traces } = this.kept.peek();
    const next = traces.includes(name) ? traces.filter((other) => other !== name) : [...traces, name];
    if (next.length > 0) this.change({ traces: next });
  }

  private load(): Kept {
    let said: Partial<Kept> | null = null;
    try {
      said = JSON.parse(this.shelf?.getItem(kKey) ?? 'null') as Partial<Kept> | null;
    } catch {
      // What cannot be read is as if it were not there.
    }
    const traces = Array.isArray(said?.traces) ? said.traces.filter((name) => kNames.includes(name)) : [];
    const span_s = typeof said?.span_s === 'number' && said.span_s >= 1 && said.span_s <= 86_400 ? said.span_s : 60;
    return { traces: traces.length > 0 ? traces : kUsual, is_utc: said?.is_utc === true, span_s };
  }
}

// Of this page; the switch between local time and UTC is the same in other views.
export const plot_settings = new PlotSettings(browser_shelf());

// The strips that have at least one chosen trace, with those alone; the band goes with the estimate.
export function chosen_strips(chosen: readonly string[]): Strip[] {
  return kStrips
    .map((strip) => ({ ...strip, traces: strip.traces.filter(({ name }) => chosen.includes(name)) }))
    .filter(({ traces }) => traces.length > 0);
}

export const has_band = (strip: Strip) => strip.traces.some(({ column }) => column === 'estimate_m');

// All that is drawn, each once.
export function columns_of(strips: readonly Strip[]): Column[] {
  const columns = strips.flatMap((strip) => strip.traces.map(({ column }) => column));
  const band: Column[] = strips.some(has_band) ? ['estimate_low_m', 'estimate_high_m'] : [];
  return [...new Set([...band, ...columns])];
}
