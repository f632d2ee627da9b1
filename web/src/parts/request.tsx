// One thing that was asked of the station, and the line that tells how it went.

import { useSignal, type Signal } from '@preact/signals';
import { useRef } from 'preact/hooks';

export interface Outcome {
  phase: 'idle' | 'pending' | 'done' | 'failed';
  text: string;
}

export interface Asking {
  outcome: Signal<Outcome>;
  pending: boolean;
  ask(what: string, request: () => Promise<unknown>, whom?: string): Promise<boolean>; // whom: it waits for
  fail(text: string): void;
  clear(): void;
}

export function useAsking(): Asking {
  const outcome = useSignal<Outcome>({ phase: 'idle', text: '' });
  const latest = useRef(0);
  return {
    outcome,
    pending: outcome.value.phase === 'pending',
    fail: (text) => (outcome.value = { phase: 'failed', text }),
    clear: () => outcome.value.phase !== 'pending' && (outcome.value = { phase: 'idle', text: '' }),
    async ask(what, request, whom = 'the robot') {
      const number = ++latest.current;
      const started_ms = performance.now();
      const show = (phase: Outcome['phase'], text: string) => {
        if (number === latest.current) outcome.value = { phase, text };
      };
      show('pending', `${what}: waiting for ${whom}`);
      try {
        await request();
        show('done', `${what}: accepted in ${Math.round(performance.now() - started_ms)} ms`);
        return true;
      } catch (error) {
        show('failed', error instanceof Error ? error.message : String(error));
        return false;
      }
    },
  };
}

// Refusals are spoken, progress is only shown.
export function OutcomeLine({ asking, id }: { asking: Asking; id?: string }) {
  const { phase, text } = asking.outcome.value;
  return (
    <p class={`outcome ${phase}`} id={id} role={phase === 'failed' ? 'alert' : undefined}>
      {text}
    </p>
  );
}
