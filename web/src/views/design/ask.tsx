// What is asked of a controller: two sliders. While one moves the page answers at once; where it rests, the station does.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { change_design, kCrossover, kMargin, type Design } from './address';
import type { Specification } from './frequency';
import type { DesignWork } from './work';

const kRest_ms = 350; // a slider that was not moved for so long rests
const kPositions = 1000; // of the slider of the crossover, evenly spaced in its logarithm

export const rounded = ({ crossover_rad_s, phase_margin_deg }: Specification): Specification => ({
  crossover_rad_s: Math.min(kCrossover.to, Math.max(kCrossover.from, Number(crossover_rad_s.toPrecision(3)))),
  phase_margin_deg: Math.min(kMargin.to, Math.max(kMargin.from, Number(phase_margin_deg.toFixed(1)))),
});
export const specification_of = (design: Design): Specification => ({
  crossover_rad_s: design.crossover_rad_s,
  phase_margin_deg: design.margin_deg,
});
// Another question: what was found and kept for the old one is not its answer.
export function with_specification(design: Design, asked: Specification): Design {
  const { crossover_rad_s, phase_margin_deg } = asked;
  if (crossover_rad_s === design.crossover_rad_s && phase_margin_deg === design.margin_deg) return design;
  return { ...design, crossover_rad_s, margin_deg: phase_margin_deg, controller: null, verified: null };
}

// Moves what is asked; `is_done` where a hand lets go. One rest is one step that "back" undoes.
export function useAskMoves(work: DesignWork, design: Design) {
  const timer = useRef<ReturnType<typeof setTimeout> | null>(null);
  const now = useRef(design);
  now.current = design;
  useEffect(
    () => () => {
      clearTimeout(timer.current ?? undefined);
      work.dragged.value = null;
    },
    [],
  );
  return (asked: Specification, is_done: boolean) => {
    clearTimeout(timer.current ?? undefined);
    work.dragged.value = rounded(asked);
    const rest = () => {
      const settled = work.dragged.peek();
      work.dragged.value = null;
      if (settled) change_design(with_specification(now.current, settled));
    };
    if (is_done) timer.current = setTimeout(rest, kRest_ms);
  };
}

interface AskProps {
  asked: Specification;
  on_move(asked: Specification, is_done: boolean): void;
}

export function Ask({ asked, on_move }: AskProps) {
  const { crossover_rad_s, phase_margin_deg } = asked;
  const ratio = Math.log(kCrossover.to / kCrossover.from);
  const at = Math.round((Math.log(crossover_rad_s / kCrossover.from) / ratio) * kPositions);
  const crossover = (position: number) => ({
    ...asked,
    crossover_rad_s: kCrossover.from * Math.exp((position / kPositions) * ratio),
  });
  const margin = (phase_margin_deg: number) => ({ ...asked, phase_margin_deg });
  return (
    <div class="design-ask">
      <Slider
        name="crossover"
        label="Gain crossover"
        unit="rad/s"
        value={crossover_rad_s}
        range={{ min: 0, max: kPositions, step: 1, at }}
        bounds={kCrossover}
        on_slide={(position, is_done) => on_move(crossover(position), is_done)}
        on_type={(value) => on_move({ ...asked, crossover_rad_s: value }, true)}
      />
      <Slider
        name="margin"
        label="Phase margin"
        unit="°"
        value={phase_margin_deg}
        range={{ min: kMargin.from, max: kMargin.to, step: 0.5, at: phase_margin_deg }}
        bounds={kMargin}
        on_slide={(degrees, is_done) => on_move(margin(degrees), is_done)}
        on_type={(value) => on_move(margin(value), true)}
      />
    </div>
  );
}

interface SliderProps {
  name: string;
  label: string;
  unit: string;
  value: number;
  range: { min: number; max: number; step: number; at: number };
  bounds: { from: number; to: number };
  on_slide(at: number, is_done: boolean): void;
  on_type(value: number): void;
}

function Slider({ name, label, unit, value, range, bounds, on_slide, on_type }: SliderProps) {
  const problem = useSignal('');
  const draft = useSignal<string | null>(null); // what is being typed: an answer that comes meanwhile leaves it alone
  const { min, max, step, at } = range;
  // Whatever was typed, something else is asked now.
  useEffect(() => {
    problem.value = '';
    draft.value = null;
  }, [value]);
  const take = (text: string) => {
    const typed = Number(text.trim().replace(',', '.'));
    const is_in = text.trim() !== '' && typed >= bounds.from && typed <= bounds.to;
    problem.value = is_in ? '' : `${label}: “${text}” is no number from ${bounds.from} to ${bounds.to} ${unit}.`;
    if (is_in && typed !== value) on_type(typed);
  };
  return (
    <div class="design-slider">
      <label for={`design-${name}-slider`}>{label}</label>
      <input
        type="range"
        id={`design-${name}-slider`}
        min={min}
        max={max}
        step={step}
        value={at}
        aria-valuetext={`${value} ${unit}`}
        onInput={(event) => on_slide(Number(event.currentTarget.value), false)}
        onChange={(event) => on_slide(Number(event.currentTarget.value), true)}
      />
      <span class="field">
        <input
          id={`design-${name}`}
          aria-label={`${label} in ${unit === '°' ? 'degrees' : unit}`}
          inputMode="decimal"
          autoComplete="off"
          value={draft.value ?? String(value)}
          aria-invalid={problem.value !== ''}
          onInput={(event) => (draft.value = event.currentTarget.value)}
          onChange={(event) => take(event.currentTarget.value)}
        />
        <span class="unit">{unit}</span>
      </span>
      {problem.value !== '' && (
        <p class="problem" role="alert">
          {problem.value}
        </p>
      )}
    </div>
  );
}
