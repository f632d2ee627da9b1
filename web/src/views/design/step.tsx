// One numbered step of the way from runs to a controller: its title, the state it is in, and what is done in it.

import type { ComponentChildren } from 'preact';
import { useEffect } from 'preact/hooks';
import type { DesignWork } from './work';
import type { StepState } from './words';

interface StepProps {
  work: DesignWork;
  number: number;
  name: string; // of its id
  title: string;
  state: StepState;
  share?: number | null; // of the work, while it runs
  on_cancel?: (() => void) | undefined;
  children: ComponentChildren;
}

export function Step({ work, number, name, title, state, share = null, on_cancel, children }: StepProps) {
  useEffect(() => void (work.states.value = { ...work.states.peek(), [name]: state }), [state.kind, state.text]);
  return (
    <section
      class={`design-step ${state.kind}`}
      id={`design-part-${name}`}
      data-state={state.kind}
      aria-labelledby={`design-${name}-title`}
    >
      <header>
        <span class="design-number" aria-hidden="true">
          {number}
        </span>
        <h2 id={`design-${name}-title`}>
          <span class="unseen">Step {number}: </span>
          {title}
        </h2>
        <p class="design-state" id={`design-${name}-state`} role={state.kind === 'failed' ? 'alert' : undefined}>
          {state.text}
        </p>
        {state.kind === 'running' && on_cancel && (
          <button type="button" class="design-small" id={`design-${name}-cancel`} onClick={on_cancel}>
            Cancel
          </button>
        )}
      </header>
      {state.kind === 'running' && share !== null && (
        <progress value={share} max={1} aria-label={`${title}: how much is done`} />
      )}
      <div class="design-step-body">{children}</div>
    </section>
  );
}
