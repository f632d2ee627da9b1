// Thresholds that this browser puts on what it shows: a value beyond one is coloured, and stays announced until somebody
// has acknowledged it.
//
// They belong to the page. SAFETY: nothing that commands or stops reads them, and they replace no limit of the robot.

import { signal, type Signal } from '@preact/signals';
import type { Shelf } from './settings';

export const kChannels = [
  'estimate_m',
  'position_sd_m',
  'velocity_m_s',
  'duty',
  'impedance_mv',
  'round_trip_us',
] as const;
export type Channel = (typeof kChannels)[number];

export interface Range {
  low: number | null; // null: none
  high: number | null;
}

export interface Alert {
  channel: Channel;
  since_ms: number; // UTC
  worst: number; // that was seen since
  worst_sd_m: number | null; // of the position at that moment
  limit: number; // that it went beyond
  is_beyond: boolean; // now
  is_acknowledged: boolean;
}

const kKey = 'rheonaut.thresholds';

export class Thresholds {
  readonly ranges: Signal<Partial<Record<Channel, Range>>>;

  constructor(private readonly shelf: Shelf | null) {
    this.ranges = signal(this.load());
  }

  set(channel: Channel, range: Range): void {
    const next = { ...this.ranges.peek(), [channel]: range };
    if (range.low === null && range.high === null) delete next[channel];
    this.ranges.value = next;
    try {
      this.shelf?.setItem(kKey, JSON.stringify(this.ranges.peek()));
    } catch {
      // A browser that keeps nothing has them until the page is closed.
    }
  }

  private load(): Partial<Record<Channel, Range>> {
    try {
      const kept = JSON.parse(this.shelf?.getItem(kKey) ?? '{}') as Record<string, Partial<Range> | null>;
      const number = (value: unknown) => (typeof value === 'number' && Number.isFinite(value) ? value : null);
      const ranges = kChannels.map((name) => [name, { low: number(kept[name]?.low), high: number(kept[name]?.high) }]);
      const known = ranges as [Channel, Range][];
      return Object.fromEntries(known.filter(([, { low, high }]) => low !== null || high !== null));
    } catch {
      return {};
    }
  }
}

// The readings of one robot that are beyond a threshold, or were and have not been acknowledged.
export class Alerts {
  readonly alerts = signal<readonly Alert[]>([]);

  // With each reading. null: not known now, which ends nothing and begins nothing.
  judge(ranges: Partial<Record<Channel, Range>>, values: Record<Channel, number | null>, now_ms: number): void {
    const before = this.alerts.peek();
    const after = kChannels.flatMap((channel) => {
      const known = before.find((alert) => alert.channel === channel);
      const range = ranges[channel];
      if (!range) return [];
      const value = values[channel];
      if (value === null) return known ? [known] : [];
      const limit = limit_beyond(range, value);
      if (limit === null) return !known || known.is_acknowledged ? [] : [{ ...known, is_beyond: false }];
      const now = { worst: value, worst_sd_m: values.position_sd_m };
      if (!known) return [{ channel, since_ms: now_ms, ...now, limit, is_beyond: true, is_acknowledged: false }];
      const { worst, worst_sd_m } = Math.abs(value - limit) > Math.abs(known.worst - limit) ? now : known;
      // It was back in between: that is another one, and has been acknowledged by nobody.
      const is_acknowledged = known.is_acknowledged && known.is_beyond;
      return [{ ...known, worst, worst_sd_m, limit, is_beyond: true, is_acknowledged }];
    });
    if (!is_same(before, after)) this.alerts.value = after;
  }

  // What is still beyond stays coloured, and is not announced any more.
  acknowledge(): void {
    const kept = this.alerts.peek().filter((alert) => alert.is_beyond);
    this.alerts.value = kept.map((alert) => ({ ...alert, is_acknowledged: true }));
  }
}

function limit_beyond({ low, high }: Range, value: number): number | null {
  if (high !== null && value > high) return high;
  return low !== null && value < low ? low : null;
}

const is_same = (a: readonly Alert[], b: readonly Alert[]) =>
  a.length === b.length &&
  a.every((alert, at) => (Object.keys(alert) as (keyof Alert)[]).every((key) => alert[key] === b[at]?.[key]));
