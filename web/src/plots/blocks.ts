// The least and the largest values of each 16 consecutive samples of a ring, computed once: so that ten minutes of samples
// can be drawn anew thirty times a second.

import type { AnyColumn, SampleRows } from '../samples';

export const kBlock = 16;

export class Blocks {
  readonly min: Float64Array[] = []; // of each column, by slot
  readonly max: Float64Array[] = [];
  private of: SampleRows | null = null;
  private capacity = 0;
  private epoch = 0;
  private held = new Float64Array(0); // which block a slot holds

  constructor(private readonly names: readonly AnyColumn[]) {}

  // Where the block that begins with this sample is; -1 when not all of it is there, or when it is interrupted.
  slot_of(ring: SampleRows, first_index: number): number {
    this.fit(ring);
    const block = first_index / kBlock;
    const slot = block % this.held.length;
    // What was whole stays so: a sample that is sent again is the same.
    if (this.held[slot] === block) return slot;
    if (!is_whole(ring, first_index)) return -1;
    const from = first_index % ring.capacity;
    this.names.forEach((name, c) => {
      let [min, max] = [Infinity, -Infinity];
      const values = ring.column(name);
      for (let at = from; at < from + kBlock; ++at) {
        const value = values[at] as number;
        if (value < min) min = value;
        if (value > max) max = value;
      }
      (this.min[c] as Float64Array)[slot] = min;
      (this.max[c] as Float64Array)[slot] = max;
    });
    this.held[slot] = block;
    return slot;
  }

  private fit(ring: SampleRows): void {
    if (this.of === ring && this.capacity === ring.capacity && this.epoch === ring.epoch) return;
    [this.of, this.capacity, this.epoch] = [ring, ring.capacity, ring.epoch];
    const size = Math.floor(ring.capacity / kBlock);
    this.held = new Float64Array(size).fill(-1);
    this.names.forEach((_, c) => {
      this.min[c] = new Float64Array(size);
      this.max[c] = new Float64Array(size);
    });
  }
}

function is_whole(ring: SampleRows, first_index: number): boolean {
  if (ring.capacity % kBlock !== 0 || first_index + kBlock > ring.next_index) return false;
  for (let index = first_index; index < first_index + kBlock; ++index) if (!ring.holds(index)) return false;
  const from = first_index % ring.capacity;
  const took_s = (ring.time_s[from + kBlock - 1] as number) - (ring.time_s[from] as number);
  return took_s > 0 && took_s < kBlock * ring.period_s;
}
