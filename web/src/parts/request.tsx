// One thing that was asked of the station, and the line that tells how it went.

import { computed, effect, useSignal, type ReadonlySignal, type Signal } from '@preact/signals';
import { createContext } from 'preact';
import { useContext, useEffect, useRef } from 'preact/hooks';
import type { Session } from '../session';

export const kDone_ms = 8_000; // that something was accepted is shown for so long
export const kFailed_ms = 60_000; // and a refusal at most
export const kRead_ms = 3_000; // also one whose cause is gone is shown until it can have been read

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

// What an outcome must not contradict, and the page's time.
export interface Present {
  now_ms: ReadonlySignal<number>;
  page: ReadonlySignal<string>; // its link
  robot: ReadonlySignal<string>; // that is looked at: who controls it, its mode and its link
}

// Without one nothing ends by itself.
export const PresentContext = createContext<Present | null>(null);

export function present_of({ store, phase }: Pick<Session, 'store' | 'phase'>): Present {
  const robot = computed(() => {
    const now = store.selected.value;
    const { control, link } = now?.state.value ?? {};
    return [now?.robot_id, control?.holder, now?.mode.value, link].join(' ');
  });
  return { now_ms: store.now_ms, page: computed(() => `${phase.value} ${store.is_current.value}`), robot };
}

// An outcome is of the past: beside what is true now it would contradict it. It ends by itself after a while, and a refusal
// also when what it can be about has changed. `about`: what is asked of the station alone does not end with the robot's state.
export function useAsking(about: 'robot' | 'station' = 'robot'): Asking {
  const outcome = useSignal<Outcome>({ phase: 'idle', text: '' });
  const latest = useRef(0);
  const present = useContext(PresentContext);
  const shown = useRef<{ outcome: Outcome; at_ms: number; situation: string; is_changed: boolean } | null>(null);
  const end_in_time = () => {
    const now = outcome.value;
    if (!present || now.phase === 'idle' || now.phase === 'pending') return;
    const now_ms = present.now_ms.value;
    const situation = about === 'robot' ? `${present.page.value} ${present.robot.value}` : present.page.value;
    if (shown.current?.outcome !== now) shown.current = { outcome: now, at_ms: now_ms, situation, is_changed: false };
    const { at_ms } = shown.current;
    shown.current.is_changed ||= situation !== shown.current.situation;
    const is_void = shown.current.is_changed && now_ms - at_ms >= kRead_ms;
    const is_over = now.phase === 'done' ? now_ms - at_ms >= kDone_ms : is_void || now_ms - at_ms >= kFailed_ms;
    if (is_over) outcome.value = { phase: 'idle', text: '' };
  };
  // At once, unlike useSignalEffect: what changes there and back in one go has changed.
  useEffect(() => effect(end_in_time), [present, about]);
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
