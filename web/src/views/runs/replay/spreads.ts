// The "±" of the positions in the log of a replay: that of the sample of each event's moment. Where no page of the reel holds
// that moment, its few samples are read by themselves, one event after the other.

import type { EventRecord } from '../../../api';
import { kSameMoment_us } from '../../../robot';
import type { LogLine } from '../../../store';
import type { PageWays } from './pages';
import type { Reel } from './reel';

const kAgain_ms = 5000; // after a request that failed

export class Spreads {
  private readonly found = new Map<string, number | null>(); // by key of the line
  private wanted: readonly LogLine[] = [];
  private is_busy = false;
  private is_closed = false;

  constructor(
    private readonly reel: Reel,
    private readonly ways: PageWays,
    private readonly on_read: () => void,
  ) {}

  close(): void {
    this.is_closed = true;
  }

  // The lines that are shown, the newest first, as far as it is known now.
  of(lines: readonly LogLine[]): LogLine[] {
    const known = lines.map((line) => ({ ...line, position_sd_m: this.spread_of(line) }));
    this.wanted = known.filter(({ position_sd_m }) => position_sd_m === undefined);
    void this.read();
    return known;
  }

  // undefined: it has not been read yet.
  private spread_of({ key, at_ms, event }: LogLine): number | null | undefined {
    // One that is zeroed is 0 by command, and the samples around it are of the place before.
    if (!event || event.position_m === null || event.kind === 'position_zeroed') return null;
    const known = this.found.get(key);
    if (known !== undefined) return known;
    const utc_us = at_ms * 1000;
    if (!this.reel.page(this.reel.number_of(utc_us))) return undefined;
    const row = this.reel.at(utc_us);
    const is_ours = row !== null && this.is_of(event, row.situation.boot_id, row.seq);
    const spread_m = is_ours ? row.value('position_sd_m') : null;
    if (spread_m !== null) this.found.set(key, spread_m); // also when the page is gone
    return spread_m;
  }

  private is_of(event: EventRecord, boot_id: string, seq: number): boolean {
    if (event.sample_seq === null || event.boot_id !== boot_id) return false;
    return Math.abs(seq - event.sample_seq) * this.reel.period_s * 1e6 <= kSameMoment_us;
  }

  private async read(): Promise<void> {
    const line = this.wanted[0];
    if (!line?.event || this.is_busy || this.is_closed) return;
    this.is_busy = true;
    const { key, event } = line;
    try {
      const utc_us = Math.round(line.at_ms * 1000);
      const limit = 2 + Math.ceil(kSameMoment_us / 1e6 / this.reel.period_s);
      const samples = await this.ways.samples(utc_us - kSameMoment_us, utc_us + 1, limit);
      const last = samples.filter(({ boot_id, seq }) => this.is_of(event, boot_id, seq)).at(-1);
      this.found.set(key, last?.position_sd_m ?? null);
      this.is_busy = false;
      if (!this.is_closed) this.on_read();
    } catch {
      // Nothing is said of this "±" meanwhile; that samples do not come is said of the pages.
      this.ways.set_timer(() => {
        this.is_busy = false;
        void this.read();
      }, kAgain_ms);
    }
  }
}
