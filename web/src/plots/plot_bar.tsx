// Above the plots: back to live, how much time they show, of which clock, and which traces.

import { useSignal, type Signal } from '@preact/signals';
import { useCloseOnEscape } from '../keys';
import { DerivedChoice } from './derived_choice';
import { kPredicted, kStrips, type PlotSettings, type Strip } from './strips';

export interface Span {
  span_s: number;
  text: string;
}

const kSpans: readonly Span[] = [
  { span_s: 60, text: '1 min' },
  { span_s: 600, text: '10 min' },
  { span_s: 3600, text: '1 h' },
  { span_s: 21_600, text: '6 h' },
  { span_s: 86_400, text: '1 day' },
];

export interface PlotState {
  is_live: boolean;
  span_s: number;
  range: string; // what is held, in words
}

interface BarProps {
  state: Signal<PlotState>;
  note: Signal<string>;
  settings: PlotSettings;
  on_live?: () => void; // none where nothing is live
  on_span(span_s: number): void;
  spans?: readonly Span[];
  children?: preact.ComponentChildren;
}

export function PlotBar({ state, note, settings, on_live, on_span, spans = kSpans, children }: BarProps) {
  const { is_live, span_s, range } = state.value;
  const { is_utc, xy } = settings.kept.value;
  return (
    <div class="plot-bar">
      {on_live && (
        <button
          type="button"
          id="plots-live"
          class={is_live ? 'live' : 'held'}
          aria-pressed={is_live}
          onClick={on_live}
        >
          {is_live ? 'Live' : 'Back to live'}
        </button>
      )}
      <div class="spans" role="group" aria-label="How much time the plots show">
        {spans.map((span) => (
          <button
            type="button"
            key={span.span_s}
            aria-pressed={Math.abs(span_s - span.span_s) < 0.5}
            onClick={() => on_span(span.span_s)}
          >
            {span.text}
          </button>
        ))}
      </div>
      <output class="range" id="plots-range">
        {range}
      </output>
      <output class="plot-note" id="plots-note">
        {note}
      </output>
      <div class="plot-choices">
        <button
          type="button"
          id="plots-clock"
          title="The clock of the time axis"
          onClick={() => settings.change({ is_utc: !is_utc })}
        >
          {is_utc ? 'UTC' : 'Local time'}
        </button>
        <button
          type="button"
          id="plots-xy"
          aria-pressed={xy.is_open}
          title="Any channel against any other, below the strips"
          onClick={() => {
            settings.change({ xy: { ...xy, is_open: !xy.is_open } });
            // Below the strips it may be out of sight.
            setTimeout(() => document.getElementById('xy-plot')?.scrollIntoView({ block: 'nearest' }));
          }}
        >
          X–Y
        </button>
        {children}
        <TraceList settings={settings} />
      </div>
    </div>
  );
}

function TraceList({ settings }: { settings: PlotSettings }) {
  const open = useSignal(false);
  useCloseOnEscape(() => (open.value = false));
  const { traces } = settings.kept.value;
  return (
    <div class="trace-choice">
      <button
        type="button"
        id="plots-traces"
        aria-expanded={open.value}
        aria-controls="trace-list"
        onClick={() => (open.value = !open.value)}
      >
        Traces
      </button>
      {open.value && (
        <fieldset id="trace-list">
          <legend>Traces, kept in this browser</legend>
          {kStrips.flatMap((strip) =>
            choices_of(strip).map(({ name, text, swatch }) => (
              <label key={name}>
                <input
                  type="checkbox"
                  autoComplete="off"
                  name={name}
                  checked={traces.includes(name)}
                  disabled={traces.length === 1 && traces[0] === name}
                  onChange={() => settings.toggle(name)}
                />
                <span class={`swatch ${swatch}`}>{strip.traces.length > 1 ? `${strip.title}, ${text}` : text}</span>
              </label>
            )),
          )}
          <DerivedChoice settings={settings} />
        </fieldset>
      )}
    </div>
  );
}

// From the top of the drawing downwards; what was predicted stands below what was estimated.
function choices_of(strip: Strip): { name: string; text: string; swatch: string }[] {
  const [first, ...others] = [...strip.traces].reverse();
  if (!first) return [];
  return strip.has_predicted ? [first, kPredicted, ...others] : [first, ...others];
}
