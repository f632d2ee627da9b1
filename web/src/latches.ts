// When each emergency came into force, so that a latch is named by its time and cause: nobody compares 64-bit numbers.

import { signal } from '@preact/signals';
import { clock_time, words } from './format';

export interface LatchTime {
  at_ms: number; // UTC
  is_known: boolean; // false: it is from before that time
}

const kRemembered = 200;

export class Latches {
  readonly times = signal<ReadonlyMap<string, LatchTime>>(new Map());

  // `is_known`: from its event, or from a page that saw it begin.
  note(emergency_id: string | null, at_ms: number, is_known: boolean): void {
    if (emergency_id === null) return;
    const before = this.times.peek().get(emergency_id);
    if (before && (before.is_known || !is_known)) return;
    this.times.value = new Map(
      [...this.times.peek(), [emergency_id, { at_ms, is_known }] as const].slice(-kRemembered),
    );
  }

  is_known(emergency_id: string): boolean {
    return this.times.peek().get(emergency_id)?.is_known === true;
  }

  // "operator, 02:11:05"
  name(emergency_id: string, cause: string): string {
    const time = this.times.value.get(emergency_id);
    const text = time ? `${time.is_known ? '' : 'before '}${clock_time(time.at_ms).slice(0, 8)}` : 'time not known';
    return `${words(cause)}, ${text}`;
  }
}
