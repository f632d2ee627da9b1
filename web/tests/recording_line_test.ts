// The one line about the recording of a robot.
import { expect, test } from 'vitest';
import { recording_line } from '../src/recording_line';

const kGood = { next_seq: 1000, durable_next_seq: 990, link: 'connected' as const, status: { lost_samples: 0 } };

test('it says what is worst, and "nothing lost" only where that is known', () => {
  const of = (change: object, is_current = true) => {
    const { text, tone } = recording_line({ ...kGood, ...change }, is_current);
    return `${tone}: ${text}`;
  };
  expect(of({})).toBe(': recorded, nothing lost');
  expect(of({ durable_next_seq: 700 })).toBe('caution: 300 samples not yet on disk');
  expect(of({ status: { lost_samples: 1 }, durable_next_seq: 700 })).toBe('alarm: 1 sample lost for good');
  expect(of({ link: 'disconnected' })).toBe('stale: not connected');
  expect(of({}, false)).toBe('stale: cut off: recording not known');
});
