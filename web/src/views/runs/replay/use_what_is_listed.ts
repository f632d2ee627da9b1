// The commands of a robot in the time of a run, as far as the station lists them, and what is not there of its samples.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { CommandRecord } from '../../../api';
import type { Session } from '../../../session';
import type { RunPage } from '../run_page';
import type { Losses, Run } from '../runs_api';

const kListed = 1000; // the newest

export function useCommands(session: Session, run: Run): { commands: readonly CommandRecord[]; out_of_reach: boolean } {
  const commands = useSignal<readonly CommandRecord[]>([]);
  const is_live = session.phase.value === 'live';
  useEffect(() => {
    let is_wanted = true;
    if (is_live)
      void session.api.robot_commands(run.robot_id).then(
        (found) => is_wanted && (commands.value = found),
        () => undefined,
      );
    return () => void (is_wanted = false);
  }, [session, run.run_id, run.state, is_live]);
  const oldest_us = commands.value.at(-1)?.submitted_at_us ?? 0;
  return {
    commands: commands.value,
    out_of_reach: commands.value.length >= kListed && oldest_us > run.started_at_us,
  };
}

export function useLosses(session: Session, page: RunPage): Losses | null {
  const losses = useSignal<Losses | null>(null);
  const is_live = session.phase.value === 'live';
  useEffect(() => {
    let is_wanted = true;
    if (is_live)
      void page.losses().then(
        (found) => is_wanted && (losses.value = found),
        () => undefined,
      );
    return () => void (is_wanted = false);
  }, [session, page, page.run.value?.state, is_live]);
  return losses.value;
}
