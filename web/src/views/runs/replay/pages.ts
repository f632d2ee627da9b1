// Fetches the pages of a reel around the moment that is shown: a few at a time, the one that is needed first first.

import { signal } from '@preact/signals';
import type { StoredSample } from '../../../api';
import { kPages, kRowsOfPage, type Reel } from './reel';

const kAtOnce = 3; // requests on their way
const kAhead_s = 4; // of real time that lies ready before the moment that is played
const kMostAhead = 24; // pages
const kAgain_ms = 1000; // after a request that failed
export const kMostSamples = kRowsOfPage + 176; // asked for in one page

export interface PageWays {
  samples(from_us: number, to_us: number, limit: number): Promise<StoredSample[]>;
  set_timer(callback: () => void, delay_ms: number): unknown;
}

// The numbers of the pages that are wanted, the most urgent first.
export function wanted_pages(number: number, ahead: number, behind: number, last: number): number[] {
  const before = Array.from({ length: behind }, (_, at) => number - 1 - at);
  const after = Array.from({ length: ahead }, (_, at) => number + 1 + at);
  return [number, ...after.slice(0, 1), ...before.slice(0, 1), ...after.slice(1), ...before.slice(1)]
    .filter((each) => each >= 0 && each <= last)
    .slice(0, kPages - 1);
}

export class Pages {
  readonly problem = signal(''); // why samples do not come
  private wanted: number[] = [];
  private readonly under_way = new Set<number>();
  private is_closed = false;
  private waits = false; // after a failure
  private known_to_us = 0; // the end of what is recorded

  constructor(
    private readonly reel: Reel,
    private readonly ways: PageWays,
    private readonly on_page: () => void,
  ) {}

  close(): void {
    this.is_closed = true;
  }

  // Around a moment: what is played next, and what the plots show behind it.
  look(utc_us: number, speed: number, shown_s: number, known_to_us: number): void {
    const page_s = this.reel.page_us / 1e6;
    this.known_to_us = known_to_us;
    const ahead = Math.min(kMostAhead, 1 + Math.ceil((speed * kAhead_s) / page_s));
    const behind = Math.min(kPages - kMostAhead - 2, Math.ceil(shown_s / page_s));
    const last = this.reel.number_of(known_to_us - 1);
    this.wanted = wanted_pages(this.reel.number_of(utc_us), ahead, behind, last);
    this.hurry();
  }

  // A page that somebody steps into comes before all others.
  need(number: number): void {
    this.wanted = [number, ...this.wanted.filter((each) => each !== number)];
    this.hurry();
  }

  // Until when samples lie ready without a break, from a moment on. What is recorded later than known_to_us is not awaited.
  ready_to_us(utc_us: number): number {
    let number = this.reel.number_of(utc_us);
    while (this.is_whole(number) && this.reel.start_us(number) < this.known_to_us) number += 1;
    return number > this.reel.number_of(utc_us) ? this.reel.start_us(number) : utc_us;
  }

  private is_whole(number: number): boolean {
    const page = this.reel.page(number);
    return page !== null && page.known_to_us >= Math.min(this.reel.start_us(number + 1), this.known_to_us);
  }

  private hurry(): void {
    for (const number of this.wanted) {
      if (this.is_closed || this.waits || this.under_way.size >= kAtOnce) return;
      if (!this.is_whole(number) && !this.under_way.has(number)) void this.load(number);
    }
  }

  private async load(number: number): Promise<void> {
    const { reel, known_to_us } = this;
    this.under_way.add(number);
    try {
      const samples = await this.ways.samples(reel.start_us(number), reel.start_us(number + 1), kMostSamples);
      if (this.is_closed) return;
      if (this.wanted.includes(number)) reel.take(number, samples, known_to_us);
      this.problem.value = '';
      this.on_page();
    } catch (error) {
      this.problem.value = error instanceof Error ? error.message : String(error);
      this.waits = true;
      this.ways.set_timer(() => {
        this.waits = false;
        this.hurry();
      }, kAgain_ms);
    } finally {
      this.under_way.delete(number);
    }
    this.hurry();
  }
}
