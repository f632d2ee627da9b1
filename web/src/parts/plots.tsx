// The three strip charts of a robot: position (with its ± as a band, and what the controller sees) beside setpoint and
// reference, duty, impedance.
//
// They hold still while a pointer moves over them, and while zoomed (drag a stretch); a button goes back to live.

import { signal, useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { ChartDeck, type DeckState, type StripOptions } from '../chart';
import { millimetres, millivolts, percent } from '../format';
import type { PlotWindow } from '../samples';
import type { Robot } from '../robot';

const kPosition: StripOptions = {
  traces: [
    { column: 'reference_m', colour: '--commanded-soft', width_px: 1.2 },
    { column: 'setpoint_m', colour: '--commanded', width_px: 1.4, dash_px: [7, 5] },
    { column: 'position_m', colour: '--seen', width_px: 1.2 },
    { column: 'estimate_m', colour: '--measured', width_px: 1.8 },
  ],
  band: { low: 'estimate_low_m', high: 'estimate_high_m', colour: '--spread' },
  label: (value) => millimetres(value, 0),
  least_span: 0.08,
  show_time: false,
};
const kDuty: StripOptions = {
  traces: [{ column: 'duty', colour: '--duty', width_px: 1.3 }],
  label: (value) => percent(value, 0),
  fixed_range: [-1.08, 1.08],
  splits: [-1, 0, 1],
  show_time: false,
};
const kImpedance: StripOptions = {
  traces: [{ column: 'impedance_mv', colour: '--impedance', width_px: 1.3 }],
  label: (value) => millivolts(value).replace('.0', ''),
  least_span: 60,
  show_time: true,
};

export function Plots({ robot }: { robot: Robot }) {
  const hosts = [useRef<HTMLDivElement>(null), useRef<HTMLDivElement>(null), useRef<HTMLDivElement>(null)] as const;
  const deck = useRef<ChartDeck | null>(null);
  const state = useSignal<DeckState>('running');
  const cursors = useRef([signal(''), signal(''), signal('')]).current;

  useEffect(() => {
    const made = new ChartDeck(robot.ring, (next) => (state.value = next));
    [kPosition, kDuty, kImpedance].forEach((options, at) => {
      const write = cursors[at];
      const show = (index: number | null, window: PlotWindow) =>
        write && (write.value = cursor_text(options, index, window));
      made.add(hosts[at as 0 | 1 | 2].current as HTMLElement, options, show);
    });
    deck.current = made;
    const theme = matchMedia('(prefers-color-scheme: light)');
    const restyle = () => made.restyle();
    theme.addEventListener('change', restyle);
    // Numerals are drawn on the canvas, so the charts wait for their font.
    void document.fonts.ready.then(restyle);
    return () => {
      theme.removeEventListener('change', restyle);
      made.destroy();
      deck.current = null;
    };
  }, []);
  useEffect(() => deck.current?.show(robot.ring), [robot]);

  const strip = (at: 0 | 1 | 2, title: string, unit: string, key: preact.ComponentChildren) => (
    <figure class={`strip strip-${at}`}>
      <figcaption>
        <b>{title}</b> <span class="unit">{unit}</span>
        <span class="key">{key}</span>
        <output class="cursor">{cursors[at]}</output>
      </figcaption>
      <div class="plot" ref={hosts[at]} />
    </figure>
  );
  return (
    <section
      class={`plots ${state.value}`}
      aria-label="The last 60 seconds"
      onPointerMove={() => deck.current?.look()}
      onPointerLeave={() => deck.current?.look_away()}
    >
      {strip(0, 'Position', 'mm', <PositionKey />)}
      {strip(1, 'Duty', '%', null)}
      {strip(2, 'Impedance', 'mV', null)}
      {state.value !== 'running' && (
        <button type="button" class="back-to-live" onClick={() => deck.current?.run()}>
          {state.value === 'zoomed' ? 'Zoomed' : 'Held'} <b>Back to live</b>
        </button>
      )}
    </section>
  );
}

const PositionKey = () => (
  <>
    <span class="swatch measured">estimated ± 2 sd</span>
    <span class="swatch seen">seen by controller</span>
    <span class="swatch commanded">setpoint</span>
    <span class="swatch reference">reference</span>
  </>
);

function cursor_text(options: StripOptions, index: number | null, window: PlotWindow): string {
  if (index === null || index >= window.size) return '';
  const unit = options === kPosition ? 'mm' : options === kDuty ? '%' : 'mV';
  const value = window.values.at(-1)?.[index];
  const shown =
    options === kPosition ? position_text(index, window) : options === kDuty ? percent(value) : millivolts(value);
  return `${shown} ${unit} at \u2212${Math.abs(window.time_s[index] ?? 0).toFixed(2)} s`;
}

// The columns of kPosition: two edges of the band, then its traces.
function position_text(index: number, window: PlotWindow): string {
  const [high_m, seen_m, estimate_m] = [1, 4, 5].map((column) => window.values[column]?.[index] ?? NaN) as [
    number,
    number,
    number,
  ];
  const seen = seen_m === estimate_m ? '' : `, seen ${millimetres(seen_m)},`;
  return `${millimetres(estimate_m)} ± ${millimetres(high_m - estimate_m)}${seen}`;
}
