// What somebody has typed and not sent, of each robot, run or profile: it outlives the view, and the look at another one.

import { signal, type Signal } from '@preact/signals';
import type { Session } from './session';

export type DraftName =
  | 'setpoint'
  | 'disturbance'
  | 'duty'
  | 'run' // the name of one that is not begun
  | 'run_name'
  | 'run_notes'
  | 'run_verdict'
  | 'marker'
  | 'profile_text'
  | 'experiment_notes';

const kDrafts = new WeakMap<Session, Map<string, Signal<string | null>>>();

// null: nothing has been typed.
export function draft_of(session: Session, of: string, name: DraftName): Signal<string | null> {
  const drafts = kDrafts.get(session) ?? new Map<string, Signal<string | null>>();
  kDrafts.set(session, drafts);
  const key = `${name} ${of}`;
  const draft = drafts.get(key) ?? signal<string | null>(null);
  drafts.set(key, draft);
  return draft;
}
