// A manual duty by a gamepad: the left stick gives it, while a shoulder button is held, and no longer.
//
// The duty itself is held by DutyHold, as for the button on the page: this only says when a hand is on the control. It
// looks at the pads once in each animation frame, since a browser reports what they do in no other way.

import type { DutyHold } from './duty_hold';

export type Pad = Pick<Gamepad, 'index' | 'id' | 'connected' | 'axes'> & { buttons: readonly { pressed: boolean }[] };

export interface PadWays {
  pads(): readonly (Pad | null)[];
  now_ms(): number;
  robot_id: string;
  why_not(): string; // why no duty can run now; '': it can
  full_duty(): number; // at the end of the stick's way
  hold: Pick<DutyHold, 'press' | 'change' | 'release' | 'robot_id'>;
}

export const kFrameless_ms = 200; // without an animation frame for so long nobody knows what the hand does
export const kWatch_ms = 50;
const kShoulders = [4, 5, 6, 7]; // of the standard mapping
const kAxis = 0; // left stick, left and right
const kSlack = 0.12; // of a stick that is let go

// In whole percents, so that a hand that trembles sends few commands.
export function duty_of_axis(axis: number, full_duty: number): number {
  if (!Number.isFinite(axis) || Math.abs(axis) <= kSlack) return 0;
  const share = Math.min(1, (Math.abs(axis) - kSlack) / (1 - kSlack));
  return (Math.sign(axis) * Math.round(share * full_duty * 100)) / 100 || 0;
}

export class GamepadHold {
  pad: Pad | null = null; // that is looked at
  is_running = false; // it holds a duty
  is_held = false; // its button is down
  duty = 0;
  private is_armed = false; // its button was up since the last time that anything ended
  private said_duty = 0;
  private seen_at_ms = -Infinity;

  constructor(private readonly ways: PadWays) {}

  // Once in each animation frame.
  frame(): void {
    const { hold, robot_id } = this.ways;
    this.seen_at_ms = this.ways.now_ms();
    const before = this.pad;
    this.pad = this.ways.pads().find((pad) => pad?.connected) ?? null;
    // SAFETY: a pad that is gone, or that is another one, holds nothing.
    if (!this.pad || (before && before.index !== this.pad.index)) return this.end();
    const { pad } = this;
    this.is_held = kShoulders.some((button) => pad.buttons[button]?.pressed === true);
    this.duty = this.is_held ? duty_of_axis(pad.axes[kAxis] ?? 0, this.ways.full_duty()) : 0;
    if (!this.is_held) {
      // SAFETY: the button is up: duty 0, now.
      this.end();
      this.is_armed = true;
      return;
    }
    // SAFETY: what ended otherwise (a lapse, a stop, another mode, lost focus) does not run on: the button has to come up first.
    if (this.is_running && hold.robot_id !== robot_id) return this.forget();
    // SAFETY: a button that was down already when a duty became possible starts nothing.
    if (this.ways.why_not() !== '') return this.end();
    if (!this.is_armed) return;
    if (this.duty === 0) return this.centre();
    if (this.is_running) return this.change();
    if (hold.robot_id !== null) return this.forget(); // another hand is on the page's own button
    this.is_running = true;
    this.said_duty = this.duty;
    hold.press(robot_id, this.duty);
  }

  private change(): void {
    if (this.duty === this.said_duty) return;
    this.said_duty = this.duty;
    this.ways.hold.change(this.duty);
  }

  // Each kWatch_ms, by a timer.
  watch(): void {
    // SAFETY: no animation frame means that the pad is not read: the last that it said is worth nothing.
    if (this.is_running && this.ways.now_ms() - this.seen_at_ms > kFrameless_ms) this.end();
  }

  // Lost focus, a hidden page, another view, the pad unplugged. SAFETY: duty 0 at once, and the button has to come up first.
  end(): void {
    this.is_armed = false;
    if (!this.is_running) return;
    this.is_running = false;
    if (this.ways.hold.robot_id === this.ways.robot_id) this.ways.hold.release();
  }

  // The stick is let go under the held button: duty 0, and it may be pushed again.
  private centre(): void {
    this.end();
    this.is_armed = true;
  }

  private forget(): void {
    this.is_running = false;
    this.is_armed = false;
  }
}
