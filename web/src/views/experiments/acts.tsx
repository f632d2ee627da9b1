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

// What is asked for when it is first shown, each time the page is live again, and every so often.
export function useAsked<Answer>(
  session: Session,
  ask: () => Promise<Answer>,
  depends_on: readonly unknown[],
  every_ms = 0,
): { answer: Answer | null; problem: string; ask_again: () => void } {
  const found = useSignal<{ answer: Answer | null; problem: string }>({ answer: null, problem: '' });
  const asked_again = useSignal(0);
  const is_live = session.phase.value === 'live';
  useEffect(() => {
    if (!is_live) return;
    let is_wanted = true;
    const look = async () => {
      try {
        const answer = await ask();
        if (is_wanted) found.value = { answer, problem: '' };
      } catch (error) {
        if (is_wanted) found.value = { answer: found.peek().answer, problem: refusal(error) };
      }
    };
    void look();
    const timer = every_ms > 0 ? setInterval(() => void look(), every_ms) : 0;
    return () => {
      is_wanted = false;
      clearInterval(timer);
    };
  }, [is_live, asked_again.value, ...depends_on]);
  return { ...found.value, ask_again: () => (asked_again.value += 1) };
}

export const may_command = (session: Session) => (session.me.value?.scopes ?? '').split(',').includes('command');
