// What the page says of the recording of a robot in one line: whether anything is lost, and nothing else.

import type { RobotState } from './api';

export interface RecordingLine {
  text: string;
  tone: '' | 'caution' | 'alarm' | 'stale';
}

const kLagging = 200; // samples: two seconds at 100 Hz

type Told = Pick<RobotState, 'next_seq' | 'durable_next_seq' | 'link'> & {
  status: Pick<NonNullable<RobotState['status']>, 'lost_samples'> | null;
};

// SAFETY: without news from the station nothing is claimed of what it records now.
export function recording_line(state: Told, is_current: boolean): RecordingLine {
  const lost = state.status?.lost_samples ?? 0;
  const lag = Math.max(0, state.next_seq - state.durable_next_seq);
  if (!is_current) return { text: 'cut off: recording not known', tone: 'stale' };
  if (lost > 0) return { text: `${lost} ${lost === 1 ? 'sample' : 'samples'} lost for good`, tone: 'alarm' };
  if (state.link !== 'connected') return { text: 'not connected', tone: 'stale' };
  if (lag > kLagging) return { text: `${lag} samples not yet on disk`, tone: 'caution' };
  return { text: 'recorded, nothing lost', tone: '' };
}
