// The sound of a value beyond a threshold: when it crosses it, and again while nobody has acknowledged it.
//
// It is heard only where alarms are heard as well (alerts.ts), and can be muted by itself. SAFETY: it warns of a setting of
// this browser; an alarm has another sound, which this one never replaces.

import type { Alert } from './thresholds';

export const kSoundAgain_ms = 10_000;

export interface SoundWays {
  is_on(): boolean; // sounds are turned on in this browser
  is_muted(): boolean; // those of thresholds are not
  chime(): void;
}

export class ThresholdSound {
  private sounding = new Set<string>(); // channels that are beyond and not acknowledged
  private chimed_at_ms = -Infinity;

  constructor(private readonly ways: SoundWays) {}

  // With each reading.
  follow(alerts: readonly Alert[], now_ms: number): void {
    const before = this.sounding;
    const now = alerts.filter((alert) => alert.is_beyond && !alert.is_acknowledged).map(({ channel }) => channel);
    this.sounding = new Set(now);
    const is_new = now.some((channel) => !before.has(channel));
    const is_due = now.length > 0 && now_ms - this.chimed_at_ms >= kSoundAgain_ms;
    if (!(is_new || is_due) || !this.ways.is_on() || this.ways.is_muted()) return;
    this.chimed_at_ms = now_ms;
    this.ways.chime();
  }
}
