// What somebody has typed and not sent, of each robot: it outlives the view, and the page's look at another robot.

import { signal, type Signal } from '@preact/signals';
import type { Session } from './session';

export type DraftName = 'setpoint' | 'disturbance' | 'duty' | 'run';

const kDrafts = new WeakMap<Session, Map<string, Signal<string | null>>>();

// null: nothing has been typed.
export function draft_of(session: Session, robot_id: string, name: DraftName): Signal<string | null> {
  const drafts = kDrafts.get(session) ?? new Map<string, Signal<string | null>>();
  kDrafts.set(session, drafts);
  const key = `${name} ${robot_id}`;
  const draft = drafts.get(key) ?? signal<string | null>(null);
  drafts.set(key, draft);
  return draft;
}
