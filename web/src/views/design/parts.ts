// What every step of the view is given.

import { useMemo } from 'preact/hooks';
import type { Session } from '../../session';
import { useAsked } from '../experiments/acts';
import { RunsApi, type Run } from '../runs/runs_api';
import type { Design } from './address';
import type { StoredDesign, StoredDesignWithDocument } from './design_api';
import type { DesignWork } from './work';

export interface AskedRuns {
  answer: { runs: Run[] } | null;
  problem: string;
}

export interface StepProps {
  session: Session;
  work: DesignWork;
  design: Design;
  runs: AskedRuns; // the newest ones, and those that are chosen however old they are
  designs: StoredDesign[]; // that are kept, the newest first
  model: StoredDesignWithDocument | string | null; // that is tuned for; a text: why it cannot be read
}

const kShown = 60;
const kLook_ms = 4000; // /live does not report a run that an experiment begins or ends

export function useRuns(session: Session, chosen: number[]): AskedRuns {
  const api = useMemo(() => new RunsApi(session.api), []);
  const open = session.store.runs.value;
  return useAsked(
    session,
    async () => {
      const newest = await api.page({ robot_id: '', state: '', before: null, limit: kShown });
      const older = chosen.filter((id) => !newest.some(({ run_id }) => run_id === id));
      const found = await Promise.all(older.map((id) => api.run(id).catch(() => null)));
      return { runs: [...newest, ...found.filter((run) => run !== null)] };
    },
    [open, chosen.join(',')],
    kLook_ms,
  );
}
