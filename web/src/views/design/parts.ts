// What every step of the view is given.

import { useMemo } from 'preact/hooks';
import type { Session } from '../../session';
import { useAsked } from '../experiments/acts';
import { RunsApi, type Run } from '../runs/runs_api';
import type { Design } from './address';
import type { ControllerInForce, StoredDesign, StoredDesignWithDocument } from './design_api';
import type { JobBody } from './jobs';
import type { DesignWork } from './work';

export interface AskedRuns {
  answer: { runs: Run[] } | null;
  problem: string;
}

// What the robot that is selected reports that it runs.
export interface InForce {
  found: ControllerInForce | null;
  is_read: boolean; // the station has answered, or it could not
}

// What the station is asked to tune now, and the name of this question.
export interface TuneQuestion {
  key: string;
  body: JobBody;
}

export interface StepProps {
  session: Session;
  work: DesignWork;
  design: Design;
  runs: AskedRuns; // the newest ones, and those that are chosen however old they are
  designs: StoredDesign[]; // that are kept, the newest first
  model: StoredDesignWithDocument | string | null; // that is tuned for; a text: why it cannot be read
  in_force: InForce;
  tune: TuneQuestion | null;
}

const kShown = 60;
const kAgain_ms = 1000;
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

export function useInForce(session: Session, work: DesignWork): InForce {
  const robot = session.store.selected.value;
  const robot_id = robot?.robot_id ?? '';
  const state = robot?.state.value;
  const is_connected = state?.link === 'connected';
  const asked = useAsked(
    session,
    async () => ({ robot_id, found: robot_id === '' ? null : await work.api.in_force(robot_id) }),
    [robot_id, state?.controller_checksum, state?.link, work.pushed.value],
    // A robot that has just connected reports its controller a moment later.
    (answer) => (is_connected && !(answer?.robot_id === robot_id && answer.found?.is_current) ? kAgain_ms : 0),
  );
  const is_answered = asked.answer?.robot_id === robot_id;
  return {
    found: is_answered ? (asked.answer?.found ?? null) : null,
    is_read: is_answered || asked.problem !== '',
  };
}
