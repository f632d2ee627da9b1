// The setpoint as it is moved by hand or by keys, before it is sent: once, on release or by Enter, and never else.

import { m_to_millimetres, millimetres_to_m } from '../format';

export interface Bounds {
  min_m: number;
  max_m: number;
}

export class Ghost {
  at_m: number | null = null; // null: nobody moves it
  private from_m = 0;

  get is_moved(): boolean {
    return this.at_m !== null;
  }

  begin(setpoint_m: number): void {
    this.from_m = this.at_m = setpoint_m;
  }

  // To whole millimetres, within what may be asked for.
  move(to_m: number, { min_m, max_m }: Bounds): void {
    if (this.at_m === null) return;
    const rounded_m = millimetres_to_m(Math.round(m_to_millimetres(to_m)));
    this.at_m = Math.max(min_m, Math.min(max_m, rounded_m));
  }

  // What is to be sent, once; null: nothing, since nothing was moved.
  release(): number | null {
    const { at_m, from_m } = this;
    this.at_m = null;
    return at_m === null || Math.abs(at_m - from_m) < 1e-9 ? null : at_m;
  }

  // SAFETY: whatever interrupts a hand (Escape, another mode, lost control, lost focus) sends nothing.
  abandon(): void {
    this.at_m = null;
  }
}

export interface Circumstances {
  is_current: boolean; // the page receives from the station
  is_connected: boolean;
  is_stale: boolean;
  mode: string;
  has_setpoint: boolean;
  holder: string | null; // who is in control
  actor: string; // this page
  may_command: boolean;
}

// Why the setpoint cannot be moved; '': it can.
export function why_not(now: Circumstances): string {
  if (!now.may_command) return 'The setpoint is moved by operators.';
  if (!now.is_current) return 'Cut off from the station: the setpoint cannot be moved.';
  if (!now.is_connected) return 'The robot is not connected: its setpoint cannot be moved.';
  if (now.is_stale) return 'No samples: where the robot is now is not known, so its setpoint cannot be moved.';
  if (now.mode !== 'auto' || !now.has_setpoint) return 'The setpoint can be moved here in auto.';
  if (now.holder !== null && now.holder !== now.actor) return `${now.holder} is in control, and moves the setpoint.`;
  return '';
}
