// The commands of a robot in the time of a run, as far as the station lists them, and what is not there of its samples.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { CommandRecord } from '../../../api';
import type { Session } from '../../../session';
import { said, type RunPage } from '../run_page';
import { time_of, type Losses, type Run } from '../runs_api';

const kListed = 1000; // the newest
const kAgain_ms = 5000; // after a request that failed

// Asked for until it has come; anew when one of `of` changes. `problem`: why it has not.
export function useRead<Answer>(
  session: Pick<Session, 'phase'>,
  ask: () => Promise<Answer>,
  of: readonly unknown[],
): { answer: Answer | null; problem: string } {
  const answer = useSignal<Answer | null>(null);
  const problem = useSignal('');
  const is_live = session.phase.value === 'live';
  useEffect(() => {
    if (!is_live) return;
    let is_wanted = true;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const look = () =>
      ask().then(
        (found) => {
          if (!is_wanted) return;
          answer.value = found;
          problem.value = '';
        },
        (error: unknown) => {
          if (!is_wanted) return;
          problem.value = said(error);
          timer = setTimeout(() => void look(), kAgain_ms);
        },
      );
    void look();
    return () => {
      is_wanted = false;
      clearTimeout(timer);
    };
  }, [session, ...of, is_live]);
  return { answer: answer.value, problem: problem.value };
}

const kNone: readonly CommandRecord[] = [];

export function useCommands(session: Session, run: Run) {
  const { answer, problem } = useRead(session, () => session.api.robot_commands(run.robot_id, time_of(run)), [
    run.run_id,
    run.state,
  ]);
  const commands: readonly CommandRecord[] = answer ?? kNone;
  const oldest_us = commands.at(-1)?.submitted_at_us ?? 0;
  return { commands, problem, out_of_reach: commands.length >= kListed && oldest_us > run.started_at_us };
}

export function useLosses(session: Session, page: RunPage): { answer: Losses | null; problem: string } {
  return useRead(session, page.losses, [page, page.run.value?.state]);
}

// What could not be read of a run, in one line; '': all of it was.
export function unread_text(problems: Record<string, string>): string {
  const failed = Object.entries(problems).filter(([, problem]) => problem !== '');
  const names = failed.map(([name]) => name).join(', ');
  return failed.length === 0 ? '' : `Could not be read: ${names}. ${failed[0]?.[1]} It is tried again every 5 s.`;
}
