// Experiments that were interrupted and go on by themselves after a count-down, until somebody presses anything.

import { counts_down } from './experiments_store';
import type { Session } from './session';

// Pauses the experiments in the hands of this page that count down.
// SAFETY: who presses anything while a robot is about to move again by itself decides that it does not.
export function pause_count_downs({ store, experiments }: Pick<Session, 'store' | 'experiments'>): void {
  for (const id of store.experiments.kept_by(store.actor.peek(), store.client.peek())) {
    const experiment = store.experiments.known.peek().get(id);
    if (experiment && counts_down(experiment)) experiments.pause(id).catch(() => undefined); // it has ended meanwhile
  }
}
