// How fast the recording grows, from the station's own counts at two times.

import type { Recording } from '../../api';

export interface Pace {
  samples_per_s: number;
  commits: number; // in that time
  over_s: number;
}

type Counted = Pick<Recording['counters'], 'samples_written' | 'commits'>;

const kShortest_s = 4;
const kLongest_s = 60;
export const kBytesOfSample = 66; // docs/operations.md, "Disk space"

export class PaceMeter {
  private seen: { at_s: number; counted: Counted }[] = [];

  // What it was read at, in steady seconds. A station that was started again counts from 0.
  note(at_s: number, counted: Counted): void {
    const last = this.seen.at(-1);
    if (last && (counted.samples_written < last.counted.samples_written || counted.commits < last.counted.commits))
      this.seen = [];
    this.seen.push({ at_s, counted });
    while (this.seen.length > 2 && at_s - (this.seen[1]?.at_s ?? at_s) >= kLongest_s) this.seen.shift();
  }

  forget(): void {
    this.seen = [];
  }

  // null: it has not been watched for long enough.
  pace(): Pace | null {
    const [first] = this.seen;
    const last = this.seen.at(-1);
    if (!first || !last || last.at_s - first.at_s < kShortest_s) return null;
    const over_s = last.at_s - first.at_s;
    return {
      samples_per_s: (last.counted.samples_written - first.counted.samples_written) / over_s,
      commits: last.counted.commits - first.counted.commits,
      over_s,
    };
  }
}

export const bytes_per_day = (pace: Pace) => pace.samples_per_s * kBytesOfSample * 86_400;

// The database is never so large that the disk is full: it is kept below a limit that fits on the disk and can be kept.
export const is_within_disk = ({ retention, database_bytes, free_bytes }: Recording): boolean =>
  retention.max_database_bytes > 0 &&
  !retention.all_held &&
  retention.max_database_bytes - database_bytes <= free_bytes;

// Until the disk is full at this pace; null: nothing arrives.
export function full_in_s(pace: Pace, free_bytes: number): number | null {
  const growth_per_s = pace.samples_per_s * kBytesOfSample;
  return growth_per_s > 0 ? free_bytes / growth_per_s : null;
}
