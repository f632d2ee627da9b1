// Why a stretch of a run has no samples: lost for good, not sent yet, or never made.

import { count, words } from '../../../format';
import type { Losses } from '../runs_api';

export interface Hole {
  since_s: number; // the last sample before it, since the first one of the run
  until_s: number | null; // the first sample after it; null: not known yet
  boot_id: string;
  seq: number; // of that sample
}

// What the station says of the samples that follow the last one. '': it has not said all that it knows.
export function why_missing({ boot_id, seq }: Pick<Hole, 'boot_id' | 'seq'>, losses: Losses | null): string {
  if (!losses) return '';
  const follows = (range: { boot_id: string; first_seq: number }) =>
    range.boot_id === boot_id && range.first_seq === seq + 1;
  const size = ({ first_seq, last_seq }: { first_seq: number; last_seq: number }) => last_seq - first_seq + 1;
  const lost = losses.gaps.find(follows);
  if (lost) return `${count(size(lost))} samples are lost for good (${words(lost.cause)}).`;
  const missing = losses.missing.find(follows);
  if (missing) return `${count(size(missing))} samples are not here yet: the robot may send them.`;
  return losses.is_whole ? 'The robot made none: it stood still, or was restarted.' : '';
}
