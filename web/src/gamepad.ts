// A gamepad: a manual duty by the left stick while a shoulder button is held, and no longer; and the emergency stop.
//
// The duty itself is held by DutyHold, as for the button on the page: this only says when a hand is on the control. It
// looks at the pads once in each animation frame, since a browser reports what they do in no other way. Pads of another
// layout than the standard one (https://www.w3.org/TR/gamepad/#remapping) are not read.

import type { DutyHold } from './duty_hold';

export type Pad = Pick<Gamepad, 'index' | 'id' | 'connected' | 'axes' | 'mapping'> & {
  buttons: readonly { pressed: boolean; value?: number }[];
};

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
export const kStill_ms = 5000; // a pad that says nothing new for so long may have frozen
const kShoulders = [4, 5, 6, 7]; // of the standard mapping
const kStop = 1; // the right one of the four
const kAxis = 0; // left stick, left and right
const kSlack = 0.12; // of a stick that is let go

export const browser_pads = (): readonly (Pad | null)[] => {
  try {
    return navigator.getGamepads?.() ?? [];
  } catch {
    return []; // a page that may not read them has none
  }
};

// SAFETY: in every view, as Escape; nothing is read while no animation frame comes, as in a hidden page.
export function listen_for_stop_of_pads(stop: () => void): void {
  const button = new GamepadStop();
  let is_looking = false;
  const tick = () => {
    const pads = browser_pads();
    button.frame(pads, stop);
    is_looking = connected_pads(pads).length > 0;
    if (is_looking) requestAnimationFrame(tick);
  };
  const begin = () => {
    if (!is_looking) requestAnimationFrame(tick);
    is_looking = true;
  };
  addEventListener('gamepadconnected', begin);
  begin();
}

// In whole percents, so that a hand that trembles sends few commands.
export function duty_of_axis(axis: number, full_duty: number): number {
  if (!Number.isFinite(axis) || Math.abs(axis) <= kSlack) return 0;
  const share = Math.min(1, (Math.abs(axis) - kSlack) / (1 - kSlack));
  return (Math.sign(axis) * Math.round(share * full_duty * 100)) / 100 || 0;
}

export const is_known_layout = (pad: Pad) => pad.mapping === 'standard';
const name_of = (pad: Pad) => `${pad.index} ${pad.id}`;
const readings_of = (pad: Pad) =>
  JSON.stringify([pad.axes, pad.buttons.map(({ pressed, value }) => [pressed, value ?? 0])]);

export const connected_pads = (pads: readonly (Pad | null)[]): Pad[] => pads.filter((pad) => pad?.connected) as Pad[];

// The stop button of every pad whose layout is known, whether it drives or not.
export class GamepadStop {
  private down = new Set<string>(); // pads whose button is down

  // Once in each animation frame. SAFETY: a press counts once, and so does a pad that appears with the button down.
  frame(pads: readonly (Pad | null)[], stop: () => void): void {
    const pressed = connected_pads(pads).filter((pad) => is_known_layout(pad) && pad.buttons[kStop]?.pressed);
    const names = new Set(pressed.map(name_of));
    const is_new = [...names].some((name) => !this.down.has(name));
    this.down = names;
    if (is_new) stop();
  }
}

export class GamepadHold {
  pads: Pad[] = []; // that are connected
  pad: Pad | null = null; // that drives
  is_running = false; // it holds a duty
  is_held = false; // its button is down
  duty = 0;
  is_asleep = false; // its duty has ended since it said nothing new
  private chosen = ''; // of several; '': none
  private is_armed = false; // its button was up since the last time that anything ended
  private said_duty = 0;
  private seen_at_ms = -Infinity;
  private seen = ''; // names of the pads
  private readings = '';
  private changed_at_ms = -Infinity;

  constructor(private readonly ways: PadWays) {}

  choose(pad: Pad): void {
    this.end();
    this.chosen = name_of(pad);
  }

  // How long the duty still runs if the pad says nothing new.
  get still_left_ms(): number {
    return Math.max(0, this.changed_at_ms + kStill_ms - this.seen_at_ms);
  }

  // Once in each animation frame.
  frame(): void {
    const { hold, robot_id } = this.ways;
    this.seen_at_ms = this.ways.now_ms();
    this.pads = connected_pads(this.ways.pads());
    const seen = this.pads.map(name_of).join('\n');
    const is_changed = seen !== this.seen;
    // SAFETY: a pad that appears may be the same one, which has frozen in its first place; of several none drives unasked.
    if (is_changed) {
      this.seen = seen;
      this.chosen = '';
      this.end();
    }
    const known = this.pads.filter(is_known_layout);
    this.pad = (this.pads.length > 1 ? known.find((pad) => name_of(pad) === this.chosen) : known[0]) ?? null;
    if (!this.pad) return this.end();
    const { pad } = this;
    this.note_readings(pad, is_changed);
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
    if (this.still_left_ms === 0) return this.is_running ? this.fall_asleep() : this.stay_asleep();
    if (!this.is_armed) return;
    if (this.duty === 0) return this.centre();
    if (this.is_running) return this.change();
    if (hold.robot_id !== null) return this.forget(); // another hand is on the page's own button
    this.is_running = true;
    this.said_duty = this.duty;
    hold.press(robot_id, this.duty);
  }

  // A pad that fell asleep under the hand goes on when it is moved.
  private note_readings(pad: Pad, is_another: boolean): void {
    const readings = readings_of(pad);
    if (readings === this.readings && !is_another) return;
    this.readings = readings;
    this.changed_at_ms = this.seen_at_ms;
    if (this.is_asleep) this.is_armed = true;
    this.is_asleep = false;
  }

  // SAFETY: a pad that freezes goes on saying what it said last; a hand moves.
  private fall_asleep(): void {
    this.end();
    this.is_asleep = true;
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
    this.is_asleep = false;
    if (!this.is_running) return;
    this.is_running = false;
    if (this.ways.hold.robot_id === this.ways.robot_id) this.ways.hold.release();
  }

  // It has not been running; who moves it is there, and has to let the button come up.
  private stay_asleep(): void {
    const was_asleep = this.is_asleep;
    this.end();
    this.is_asleep = was_asleep;
  }

  // The stick is let go under the held button: duty 0, and it may be pushed again.
  private centre(): void {
    this.end();
    this.is_armed = true;
  }

  private forget(): void {
    this.is_running = false;
    this.is_armed = false;
    this.is_asleep = false;
  }
}
