// The clock of a replay: which moment is shown, how fast it moves, and where it waits.
//
// It knows nothing of samples: `ready_to_s` says until which moment they have come, and it never runs past that.

import { signal } from '@preact/signals';

export const kSpeeds = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100] as const;
const kLongestStep_s = 0.25; // of real time in one tick: a page that stood still does not jump

export class Player {
  readonly at_s = signal(0); // since the first sample of the run
  readonly speed = signal(1);
  readonly is_playing = signal(false);
  readonly is_waiting = signal(false); // for samples
  length_s = 0;
  private ticked_at_ms: number | null = null;

  constructor(private readonly ready_to_s: (at_s: number) => number) {}

  // From the beginning again, where it stood at the end.
  play(): void {
    if (this.at_s.peek() >= this.length_s) this.seek(0);
    this.is_playing.value = true;
    this.ticked_at_ms = null;
  }
  pause(): void {
    this.is_playing.value = false;
    this.is_waiting.value = false;
  }
  toggle(): void {
    if (this.is_playing.peek()) this.pause();
    else this.play();
  }

  seek(at_s: number): void {
    this.at_s.value = Math.min(this.length_s, Math.max(0, at_s));
  }

  set_speed(speed: number): void {
    this.speed.value = clamped_speed(speed);
  }
  // To the next of the usual ones.
  faster(by: 1 | -1): void {
    const now = this.speed.peek();
    const next = by > 0 ? kSpeeds.find((speed) => speed > now) : [...kSpeeds].reverse().find((speed) => speed < now);
    if (next !== undefined) this.set_speed(next);
  }

  // With each animation frame.
  tick(now_ms: number): void {
    const passed_s = this.ticked_at_ms === null ? 0 : (now_ms - this.ticked_at_ms) / 1000;
    this.ticked_at_ms = now_ms;
    if (!this.is_playing.peek()) return;
    const at_s = this.at_s.peek();
    const wanted_s = at_s + Math.min(kLongestStep_s, Math.max(0, passed_s)) * this.speed.peek();
    const ready_s = Math.max(at_s, this.ready_to_s(at_s));
    this.is_waiting.value = wanted_s > ready_s && ready_s < this.length_s;
    this.seek(Math.min(wanted_s, ready_s));
    if (this.at_s.peek() >= this.length_s) this.pause();
  }
}

export const clamped_speed = (speed: number) => Math.min(100, Math.max(0.1, speed));

export interface Asked {
  at_s: number | null; // null: the address names none
  speed: number | null;
  problem: string; // of what was typed into the address
}

// Members `at` and `speed` of the address.
export function parse_address(query: Record<string, string>, length_s: number): Asked {
  const problems: string[] = [];
  const number = (name: string, what: string, low: number, high: number, otherwise: string) => {
    const text = query[name];
    if (text === undefined) return null;
    const value = /^\d+(\.\d*)?$|^\.\d+$/.test(text) ? Number(text) : NaN;
    if (value >= low && value <= high) return value;
    problems.push(`“${name}=${text}” in the address is no ${what}: ${otherwise}.`);
    return null;
  };
  const end = Math.floor(length_s * 100) / 100;
  const at_s = number('at', `moment from 0 to ${end} s`, 0, length_s, 'the replay begins at 0');
  const speed = number('speed', 'speed from 0.1 to 100', 0.1, 100, 'it plays at 1 ×');
  return { at_s, speed, problem: problems.join(' ') };
}

// As it stands in the address: to the microsecond, without zeros at the end.
export const at_text = (at_s: number) => String(Number(at_s.toFixed(6)));
