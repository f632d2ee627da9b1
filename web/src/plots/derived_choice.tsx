// In the list of traces: those that somebody has made of others, and how one more is made.

import { useSignal } from '@preact/signals';
import type { Column } from '../samples';
import { Choice } from '../parts/choice';
import { column_of, kLeastTime_s, kLongestTime_s, name_of, type DerivedSpec } from './derived';
import { kRecorded, type PlotSettings } from './strips';

const kKinds = [
  { value: 'derivative', text: 'd/dt of' },
  { value: 'low_pass', text: 'low-pass of' },
  { value: 'difference', text: 'difference of' },
];
const kUsualTime = { derivative: '0.2', low_pass: '0.5', difference: '' } as const;
const kColumns = kRecorded.map((column) => ({ value: column, text: column }));

// The number of seconds that somebody typed, or why it is none.
export function parse_time(text: string): number | string {
  const plain = text.trim().replace(',', '.');
  const value = /^(\d+(\.\d*)?|\.\d+)$/.test(plain) ? Number(plain) : NaN;
  if (value >= kLeastTime_s && value <= kLongestTime_s) return value;
  return `“${text.trim()}” is no time from ${kLeastTime_s} to ${kLongestTime_s} s. Write a number of seconds, such as 0.2.`;
}

export function DerivedChoice({ settings }: { settings: PlotSettings }) {
  const { traces, derived } = settings.kept.value;
  const kind = useSignal<DerivedSpec['kind']>('derivative');
  const of = useSignal<Column>('estimate_m');
  const less = useSignal<Column>('setpoint_m');
  const time = useSignal<string>(kUsualTime.derivative);
  const problem = useSignal('');
  const add = () => {
    const time_s = parse_time(time.value);
    if (kind.value !== 'difference' && typeof time_s === 'string') return void (problem.value = time_s);
    problem.value = settings.add_derived(spec_of(kind.value, of.value, less.value, Number(time_s)));
  };
  return (
    <div class="derived-choice" role="group" aria-label="Traces computed from others">
      <b>Computed from others</b>
      {derived.map((spec) => {
        const column = column_of(spec);
        return (
          <div class="derived-row" key={column}>
            <label>
              <input
                type="checkbox"
                autoComplete="off"
                name={column}
                checked={traces.includes(column)}
                onChange={() => settings.toggle(column)}
              />
              <span class="swatch derived">{name_of(spec)}</span>
            </label>
            <button type="button" aria-label={`Remove ${name_of(spec)}`} onClick={() => settings.remove_derived(spec)}>
              ×
            </button>
          </div>
        );
      })}
      <div class="derived-new">
        <Choice
          id="derived-kind"
          label="What is computed"
          options={kKinds}
          value={kind.value}
          on_choose={(value) => {
            kind.value = value as DerivedSpec['kind'];
            time.value = kUsualTime[kind.value];
            problem.value = '';
          }}
        />
        <Choice
          id="derived-of"
          label="Of which trace"
          options={kColumns}
          value={of.value}
          on_choose={(value) => (of.value = value as Column)}
        />
        {kind.value === 'difference' ? (
          <Choice
            id="derived-less"
            label="Less which trace"
            options={kColumns}
            value={less.value}
            on_choose={(value) => (less.value = value as Column)}
          />
        ) : (
          <span class="derived-time">
            <input
              id="derived-time"
              autoComplete="off"
              inputMode="decimal"
              aria-label={kind.value === 'low_pass' ? 'Time constant in s' : 'Window in s'}
              value={time.value}
              onInput={(event) => (time.value = event.currentTarget.value)}
              onKeyDown={(event) => event.key === 'Enter' && (event.preventDefault(), add())}
            />
            <span class="unit">s {kind.value === 'low_pass' ? 'time constant' : 'window'}</span>
          </span>
        )}
        <button type="button" id="derived-add" onClick={add}>
          Add
        </button>
      </div>
      {problem.value && (
        <p class="outcome failed" id="derived-problem" role="alert">
          {problem.value}
        </p>
      )}
    </div>
  );
}

function spec_of(kind: DerivedSpec['kind'], of: Column, less: Column, time_s: number): DerivedSpec {
  if (kind === 'difference') return { kind, of, less };
  return kind === 'low_pass' ? { kind, of, time_constant_s: time_s } : { kind, of, window_s: time_s };
}
