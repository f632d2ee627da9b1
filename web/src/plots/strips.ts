// Which traces there are, in which strip each is drawn, and which of them this browser shows.

import { signal, type Signal } from '@preact/signals';
import type { StripOptions, Trace } from '../chart';
import { milliseconds_of_us, millimetres, millimetres_per_s, millivolts, percent } from '../format';
import type { AnyColumn, Column } from '../samples';
import { browser_shelf, type Shelf } from '../settings';
import { column_of, name_of, parse_spec, type DerivedSpec } from './derived';

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
  has_predicted?: boolean; // what was predicted of an experiment is drawn in it
}

export const kPredicted = { name: 'predicted', text: 'predicted ± 2 sd', swatch: 'predicted' };

const trace = (name: string, text: string, column: AnyColumn, colour: string, more: Partial<TraceChoice> = {}) => ({
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
    has_predicted: true,
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

const kUsual = ['position', 'predicted', 'seen', 'setpoint', 'reference', 'duty', 'impedance'];
const kKey = 'rheonaut.plots';
const kNames = [...kStrips.flatMap((strip) => strip.traces.map(({ name }) => name)), kPredicted.name];
export const kRecorded: readonly Column[] = kStrips.flatMap(({ traces }) =>
  traces.map(({ column }) => column as Column),
);
const kMostDerived = 8;

export interface XyChoice {
  is_open: boolean;
  x: AnyColumn;
  y: AnyColumn;
}

export interface Kept {
  traces: string[];
  is_utc: boolean;
  span_s: number;
  derived: DerivedSpec[];
  xy: XyChoice;
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

  // At least one that is always there stays: an empty view would look like a fault.
  toggle(name: string): void {
    const { traces } = this.kept.peek();
    const next = traces.includes(name) ? traces.filter((other) => other !== name) : [...traces, name];
    if (next.some((each) => each !== kPredicted.name)) this.change({ traces: next });
  }

  // Why a derived trace is not added; '': it is, and is shown.
  add_derived(spec: DerivedSpec): string {
    const { derived, traces } = this.kept.peek();
    const column = column_of(spec);
    if (derived.some((other) => column_of(other) === column)) return `“${name_of(spec)}” is there already.`;
    if (derived.length >= kMostDerived) return `There are ${kMostDerived} already: remove one first.`;
    if (spec.kind === 'difference' && spec.of === spec.less)
      return 'A trace less itself is 0: choose two different ones.';
    if (spec.kind === 'difference' && look_of(spec.of).unit !== look_of(spec.less).unit)
      return `${spec.of} is in ${look_of(spec.of).unit}, ${spec.less} in ${look_of(spec.less).unit}: choose two in one unit.`;
    this.change({ derived: [...derived, spec], traces: [...traces, column] });
    return '';
  }

  remove_derived(spec: DerivedSpec): void {
    const { derived, traces, xy } = this.kept.peek();
    const column = column_of(spec);
    const left = traces.filter((name) => name !== column);
    this.change({
      derived: derived.filter((other) => column_of(other) !== column),
      traces: left.some((name) => name !== kPredicted.name) ? left : kUsual,
      xy: { ...xy, x: xy.x === column ? kUsualXy.x : xy.x, y: xy.y === column ? kUsualXy.y : xy.y },
    });
  }

  private load(): Kept {
    let said: Partial<Kept> | null = null;
    try {
      said = JSON.parse(this.shelf?.getItem(kKey) ?? 'null') as Partial<Kept> | null;
    } catch {
      // What cannot be read is as if it were not there.
    }
    const list = Array.isArray(said?.derived) ? (said.derived as unknown[]) : [];
    const derived = list.map((kept) => parse_spec(kept, kRecorded)).filter((spec) => spec !== null);
    const columns = derived.map(column_of);
    const names: string[] = [...kNames, ...columns];
    const traces = Array.isArray(said?.traces) ? said.traces.filter((name) => names.includes(name)) : [];
    const span_s = typeof said?.span_s === 'number' && said.span_s >= 1 && said.span_s <= 86_400 ? said.span_s : 60;
    const is_column = (name: unknown) => [...kRecorded, ...columns].includes(name as Column);
    const { x, y, is_open } = said?.xy ?? {};
    return {
      traces: traces.some((name) => name !== kPredicted.name) ? traces : kUsual,
      is_utc: said?.is_utc === true,
      span_s,
      derived,
      xy: {
        is_open: is_open === true,
        x: is_column(x) ? (x as AnyColumn) : kUsualXy.x,
        y: is_column(y) ? (y as AnyColumn) : kUsualXy.y,
      },
    };
  }
}

const kUsualXy = { x: 'estimate_m', y: 'impedance_mv' } as const;

// How the values of a recorded column are written.
export function look_of(column: AnyColumn): Pick<Strip, 'unit' | 'value' | 'label' | 'least_span'> {
  const strip = kStrips.find(({ traces }) => traces.some((each) => each.column === column));
  return strip ?? (kStrips[0] as Strip);
}

const kPerSecond: Record<string, string> = { 'mm/s': 'mm/s²', 'mm/s²': 'mm/s³' };

// The look of a derived trace, in its own unit.
export function look_of_derived(spec: DerivedSpec): Pick<Strip, 'unit' | 'value' | 'label' | 'least_span'> {
  const { unit, value, label, least_span = 1 } = look_of(spec.of);
  if (spec.kind !== 'derivative') return { unit, value, label, least_span: least_span / 4 };
  return {
    unit: kPerSecond[unit] ?? `${unit}/s`,
    value,
    label: (each: number) => value(each),
    least_span: least_span / 4,
  };
}

const derived_strip = (spec: DerivedSpec): Strip => {
  const [name, column] = [name_of(spec), column_of(spec)];
  return {
    name: column,
    title: name,
    ...look_of_derived(spec),
    traces: [trace(column, name, column, '--derived', { swatch: 'derived' })],
  };
};

// Of this page; the switch between local time and UTC is the same in other views.
export const plot_settings = new PlotSettings(browser_shelf());

// The strips that have at least one chosen trace, with those alone; the band goes with the estimate.
export function chosen_strips(chosen: readonly string[], derived: readonly DerivedSpec[] = []): Strip[] {
  return [...kStrips, ...derived.map(derived_strip)]
    .map((strip) => ({
      ...strip,
      traces: strip.traces.filter(({ name }) => chosen.includes(name)),
      has_predicted: strip.has_predicted === true && chosen.includes(kPredicted.name),
    }))
    .filter(({ traces }) => traces.length > 0);
}

export const has_band = (strip: Strip) => strip.traces.some(({ column }) => column === 'estimate_m');

// All that is drawn, each once.
export function columns_of(strips: readonly Strip[]): AnyColumn[] {
  const columns = strips.flatMap((strip) => strip.traces.map(({ column }) => column));
  const band: Column[] = strips.some(has_band) ? ['estimate_low_m', 'estimate_high_m'] : [];
  return [...new Set([...band, ...columns])];
}

// All that can be put against each other, with their names for people.
export const channels_of = (derived: readonly DerivedSpec[]): { column: AnyColumn; text: string }[] => [
  ...kRecorded.map((column) => ({ column, text: column })),
  ...derived.map((spec) => ({ column: column_of(spec), text: name_of(spec) })),
];

export function look_of_any(column: AnyColumn, derived: readonly DerivedSpec[]) {
  const spec = derived.find((each) => column_of(each) === column);
  return spec ? look_of_derived(spec) : look_of(column);
}
