// The emergency stop of the page: both ways at once, so that neither a stalled socket nor a stalled request delays it.
//
// A stop is never refused, never asks back and never waits for another. What is shown: pressed, then stopped with the
// time from press to answer, or kept for a robot that is away, or the failure in words.

import type { CommandRecord } from './api';

export type StopPhase = 'idle' | 'sent' | 'stopped' | 'kept' | 'unanswered' | 'failed';

export interface StopState {
  phase: StopPhase;
  robot_id: string | null; // null: every robot
  pressed_at_ms: number;
  answered_after_ms: number | null;
  detail: string;
}

// `key` names the press, so that the station knows it again when it comes by the second way.
export interface StopWays {
  over_socket(robot_id: string | null, key: string): boolean;
  over_http(robot_id: string | null, key: string): Promise<CommandRecord[]>;
  now_ms(): number;
  on_change(state: StopState): void;
}

export const kIdleStop: StopState = { phase: 'idle', robot_id: null, pressed_at_ms: 0, answered_after_ms: null, detail: '' };

export class EmergencyStop {
  state: StopState = kIdleStop;
  private press = 0;

  constructor(private readonly ways: StopWays) {}

  async stop(robot_id: string | null): Promise<void> {
    const press = ++this.press;
    const pressed_at_ms = this.ways.now_ms();
    const key = new_key();
    // SAFETY: both leave in this very call, before anything is drawn.
    const by_socket = sent_without_throwing(() => this.ways.over_socket(robot_id, key));
    const answer = this.ways.over_http(robot_id, key);
    const show = (phase: StopPhase, detail: string) => {
      if (press !== this.press) return; // a later press shows its own state
      const answered_after_ms = phase === 'sent' ? null : this.ways.now_ms() - pressed_at_ms;
      this.state = { phase, robot_id, pressed_at_ms, answered_after_ms, detail };
      this.ways.on_change(this.state);
    };
    show('sent', '');
    try {
      show(...judge(await answer));
    } catch (error) {
      const detail = error instanceof Error ? error.message : String(error);
      show('failed', by_socket ? `Sent over the live link; the second way failed: ${detail}` : detail);
    }
  }

  // The latch was cleared or another robot is looked at: the last stop is history.
  forget(): void {
    this.press += 1;
    this.state = kIdleStop;
    this.ways.on_change(this.state);
  }
}

// Random, also on a page without TLS, where the browser has no randomUUID.
function new_key(): string {
  const words = crypto.getRandomValues(new Uint32Array(4));
  return Array.from(words, (word) => word.toString(16)).join('-');
}

// One word for the answers of all robots that were stopped: the worst decides.
function judge(records: CommandRecord[]): [StopPhase, string] {
  if (records.length === 0) return ['failed', 'The station knows no robot.'];
  const kept = records.filter((record) => record.state === 'queued');
  const waiting = records.filter((record) => record.state === 'sent');
  const others = records.filter((record) => !['queued', 'sent', 'acknowledged', 'verified'].includes(record.state));
  const names = (list: CommandRecord[]) => list.map((record) => record.robot_id).join(', ');
  if (others.length > 0) return ['failed', `${names(others)}: ${others[0]?.reason || others[0]?.state}`];
  if (kept.length > 0) return ['kept', names(kept)];
  if (waiting.length > 0) return ['unanswered', names(waiting)];
  return ['stopped', names(records)];
}

function sent_without_throwing(send: () => boolean): boolean {
  try {
    return send();
  } catch {
    return false;
  }
}
