// What every step of the view is given.

import type { Session } from '../../session';
import type { Design } from './address';
import type { StoredDesign, StoredDesignWithDocument } from './design_api';
import type { DesignWork } from './work';

export interface StepProps {
  session: Session;
  work: DesignWork;
  design: Design;
  designs: StoredDesign[]; // that are kept, the newest first
  model: StoredDesignWithDocument | string | null; // that is tuned for; a text: why it cannot be read
}
