// What a person asks of the station here, one thing at a time, and what it answers.

import { useSignal, type Signal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { ApiError } from '../../api';
import type { Session } from '../../session';

export interface Acts {
  pending: Signal<string>; // what is asked now, '': nothing
  problem: Signal<string>;
  act(what: string, request: () => Promise<unknown>): Promise<boolean>;
}

// The station's own words say more than the sentence for its reason: which step, which reservation, whose control.
export const refusal = (error: unknown) =>
  error instanceof ApiError ? error.detail || error.message : error instanceof Error ? error.message : String(error);

export function useActs(): Acts {
  const pending = useSignal('');
  const problem = useSignal('');
  const act = async (what: string, request: () => Promise<unknown>) => {
    if (pending.peek() !== '') return false;
    pending.value = what;
    problem.value = '';
    try {
      await request();
      return true;
    } catch (error) {
      problem.value = refusal(error);
      return false;
    } finally {
      pending.value = '';
    }
  };
  return { pending, problem, act };
}

// What is asked for when it is first shown, each time the page is live again, and so long after each answer: one look at a
// time, so that no older answer comes after a newer one. `every_ms` may depend on the answer; 0: not again.
export function useAsked<Answer>(
  session: Session,
  ask: () => Promise<Answer>,
  depends_on: readonly unknown[],
  every_ms: number | ((answer: Answer | null) => number) = 0,
): { answer: Answer | null; problem: string; ask_again: () => void } {
  const found = useSignal<{ answer: Answer | null; problem: string }>({ answer: null, problem: '' });
  const asked_again = useSignal(0);
  const is_live = session.phase.value === 'live';
  useEffect(() => {
    if (!is_live) return;
    let is_wanted = true;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const look = async () => {
      let next: { answer: Answer | null; problem: string };
      try {
        next = { answer: await ask(), problem: '' };
      } catch (error) {
        next = { answer: found.peek().answer, problem: refusal(error) };
      }
      if (!is_wanted) return;
      found.value = next;
      const again_ms = typeof every_ms === 'number' ? every_ms : every_ms(next.answer);
      if (again_ms > 0) timer = setTimeout(() => void look(), again_ms);
    };
    void look();
    return () => {
      is_wanted = false;
      clearTimeout(timer);
    };
  }, [is_live, asked_again.value, ...depends_on]);
  return { ...found.value, ask_again: () => (asked_again.value += 1) };
}

export const may_command = (session: Session) => (session.me.value?.scopes ?? '').split(',').includes('command');
