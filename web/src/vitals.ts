// How old what is seen is, and how long the ways are, as figures that can be read: the worst of the last half second.

import { signal } from '@preact/signals';
import type { Robot } from './robot';
import type { StationPath } from './station_path';

export const kOld_ms = 250; // what is seen is older than it should be
export const kTooOld_ms = 500;
const kWindow = 5; // refreshes
const kShow_ms = 500;

export interface VitalSigns {
  page_ms: number | null; // round trip to the station
  robot_ms: number | null; // round trip from there to the robot that is selected
  seen_ms: number | null; // age of its newest sample, from the robot's clock to this page; null: there is none
}

export class Vitals {
  readonly now = signal<VitalSigns>({ page_ms: null, robot_ms: null, seen_ms: null });
  private robot_id = '';
  private ages_ms: number[] = [];
  private shown_at_ms = -Infinity;

  constructor(private readonly path: StationPath) {}

  refresh(robot: Robot | null, now_ms: number): void {
    const is_other = (robot?.robot_id ?? '') !== this.robot_id;
    this.robot_id = robot?.robot_id ?? '';
    const seen_ms = robot ? robot.seen_age_ms(now_ms, this.path.station_us(now_ms)) : null;
    const ages_ms = is_other ? [] : this.ages_ms;
    this.ages_ms = seen_ms === null ? [] : [...ages_ms, seen_ms].slice(-kWindow);
    if (!is_other && now_ms - this.shown_at_ms < kShow_ms) return;
    this.shown_at_ms = now_ms;
    const round_trip_us = robot && !robot.is_away.peek() ? robot.state.peek().clock?.round_trip_us : null;
    this.now.value = {
      page_ms: this.path.round_trip_ms,
      robot_ms: typeof round_trip_us === 'number' ? round_trip_us / 1000 : null,
      seen_ms: this.ages_ms.length === 0 ? null : Math.max(...this.ages_ms),
    };
  }
}
