// What a page has asked of the station for this design; it goes on while another view is looked at.

import { signal } from '@preact/signals';
import type { Session } from '../../session';
import { address_of, note_in_address, Steps, type Design } from './address';
import { DesignApi, type Identified, type Pushed, type Tuned, type TuningMap } from './design_api';
import type { Specification } from './frequency';
import { Question } from './jobs';
import type { StepState } from './words';

export class DesignWork {
  readonly api: DesignApi;
  readonly fit: Question<Identified>;
  readonly tuning: Question<Tuned>;
  readonly map: Question<TuningMap>;
  readonly steps = new Steps(history);
  readonly states = signal<Record<string, StepState>>({}); // of the steps that are shown, by their names
  readonly dragged = signal<Specification | null>(null); // while a slider moves
  readonly kept = signal(0); // counts what was kept, so that lists are read again
  readonly pushed = signal<(Pushed & { robot_id: string }) | null>(null);

  constructor(session: Session) {
    this.api = new DesignApi(session.api, () => session.link.stamp_us);
    this.fit = new Question(this.api);
    this.tuning = new Question(this.api);
    this.map = new Question(this.api);
  }

  // What a person has not done (the number of a job) is no step that is undone.
  note(design: Design): void {
    this.steps.replace(address_of(design));
    note_in_address(design);
  }
}

const works = new WeakMap<Session, DesignWork>();

export function work_of(session: Session): DesignWork {
  const known = works.get(session);
  if (known) return known;
  const made = new DesignWork(session);
  works.set(session, made);
  return made;
}
