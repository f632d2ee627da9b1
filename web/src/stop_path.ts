// Whether a stop that is pressed now would work now, and how long its way is.
//
// It is judged again with each message and, when none comes, at the very moment from which the newest no longer proves
// anything. SAFETY: a page that stood still judges first, by how old things are, and shows nothing that it believed before.

import { signal } from '@preact/signals';
import type { RobotState } from './api';
import { milliseconds } from './format';
import type { StationPath } from './station_path';

// Why a stop would not work now. `cut_off`: no connection; `silent`: the station sends nothing, as if it stood still;
// `unanswered`: what this page sends does not arrive.
export type Hindrance = 'cut_off' | 'silent' | 'unanswered' | null;

export interface StopPathWays {
  now_ms(): number;
  set_timer(callback: () => void, delay_ms: number): unknown;
  clear_timer(timer: unknown): void;
  is_live(): boolean;
}

const kStoodStill_ms = 60; // a timer that is later than this found the page standing still

export class StopPath {
  readonly hindrance = signal<Hindrance>('cut_off');
  private timer: unknown = null;

  constructor(
    private readonly path: StationPath,
    private readonly ways: StopPathWays,
  ) {}

  look = (): void => {
    const now_ms = this.ways.now_ms();
    this.hindrance.value = this.judge(now_ms);
    this.wait(this.hindrance.value === null ? this.next_ms : Infinity, now_ms);
  };

  private get next_ms(): number {
    return Math.min(this.path.heard_until_ms, this.path.received_until_ms);
  }

  private judge(now_ms: number): Hindrance {
    if (!this.ways.is_live()) return 'cut_off';
    if (now_ms >= this.path.heard_until_ms) return 'silent';
    return now_ms >= this.path.received_until_ms ? 'unanswered' : null;
  }

  private wait(until_ms: number, now_ms: number): void {
    if (this.timer !== null) this.ways.clear_timer(this.timer);
    this.timer = null;
    if (!Number.isFinite(until_ms)) return;
    const woken = () => {
      // What waits for a page that stood still is read first; it is as old as its stamps say.
      const is_late = this.ways.now_ms() - until_ms > kStoodStill_ms;
      this.timer = is_late ? this.ways.set_timer(this.look, 0) : null;
      if (!is_late) this.look();
    };
    this.timer = this.ways.set_timer(woken, Math.max(0, until_ms - now_ms));
  }
}

export interface Readiness {
  works: boolean; // as far as is known
  text: string; // when it would not work: what becomes of a press
  why: string; // and the reason
  latency_ms: number | null; // page → station → robot and back; null: not all of it is measured
  parts: string; // the latency, part by part
}

// `robot`: that the stop is meant for; null: every robot.
export function readiness_of(
  hindrance: Hindrance,
  page_ms: number | null,
  robot: Pick<RobotState, 'robot_id' | 'link' | 'stop_path'> | null,
): Readiness {
  const path = robot?.stop_path ?? null; // null: not measured
  const robot_ms = path && path.round_trip_us !== null ? path.round_trip_us / 1000 : null;
  const is_connected = robot?.link === 'connected';
  const parts = [
    `page to station ${page_ms === null ? 'not measured yet' : milliseconds(page_ms)}`,
    robot && `station to ${robot.robot_id} ${robot_ms === null ? 'not measured yet' : milliseconds(robot_ms)}`,
  ];
  const [why, text] =
    hindrance !== null
      ? kHindered[hindrance]
      : robot && !is_connected
        ? [`${robot.robot_id} is not connected`, `will be sent when ${robot.robot_id} returns`]
        : robot && path && !path.is_open
          ? [`${robot.robot_id} does not answer the probes of the stop`, `will be sent when ${robot.robot_id} answers`]
          : ['', ''];
  return {
    works: text === '',
    text,
    why,
    latency_ms: text === '' && page_ms !== null && robot_ms !== null ? page_ms + robot_ms : null,
    parts: `There and back: ${parts.filter(Boolean).join(', ')}`,
  };
}

const kHindered: Record<Exclude<Hindrance, null>, [why: string, text: string]> = {
  cut_off: ['This page is cut off from the station', 'will be sent when the station answers'],
  silent: ['The station sends nothing, as if it stood still', 'will be sent when the station answers'],
  unanswered: ['What this page sends does not reach the station', 'will be sent when the station is reached'],
};

// What stands on the button while a stop would work.
export function latency_text(readiness: Readiness): string {
  return readiness.latency_ms === null ? 'path not measured yet' : `path ${milliseconds(readiness.latency_ms)}`;
}
