// The emergency stop of the page: both ways at once, so that neither a stalled socket nor a stalled request delays it.
//
// A stop is never refused, never asks back and never waits for another. What is shown: pressed, then stopped with the
// time from press to answer, or kept for a robot that is away, or the failure in words. "The stop may not have arrived"
// stands until telemetry received after the press shows the latch; a page that is cut off receives none.

import { is_complete, phase_of, type StopEvidence, type StopOutcome } from './stop_outcome';

//   sent → stopped | kept | unanswered | failed      by the station's answer
//   sent → late                                      no answer for a second
//   late, unanswered, failed, kept → seen | kept     by telemetry
//   stopped, seen → idle                             the latch is gone again
export type StopPhase = 'idle' | 'sent' | 'late' | 'stopped' | 'seen' | 'kept' | 'unanswered' | 'failed';

export interface StopState {
  phase: StopPhase;
  robot_id: string | null; // null: every robot
  pressed_at_ms: number;
  answered_after_ms: number | null;
  outcome: StopOutcome | null; // that the station answered
  problem: string; // why there is none
  is_kept?: boolean; // nothing was answered: it goes again when the station is back
}

// `key` names the press, so that the station knows it again when it comes by the second way.
export interface StopWays {
  over_socket(robot_id: string | null, key: string): boolean;
  over_http(robot_id: string | null, key: string): Promise<StopOutcome>;
  evidence(robot_id: string | null, since_ms: number): StopEvidence; // of what was received since then
  was_answered(error: unknown): boolean; // the station has refused, rather than not answered
  now_ms(): number;
  on_change(state: StopState): void;
}

interface Press {
  number: number;
  robot_id: string | null;
  key: string;
  pressed_at_ms: number;
  failed_at_ms: number | null; // the latest try; null: it is on its way
}

export const kLate_ms = 1000;
export const kAgain_ms = 1000; // after a try that the station has not answered
export const kKept_ms = 600_000; // a press that could not be sent goes by itself no later than this
export const kIdleStop: StopState = {
  phase: 'idle',
  robot_id: null,
  pressed_at_ms: 0,
  answered_after_ms: null,
  outcome: null,
  problem: '',
};

export class EmergencyStop {
  state: StopState = kIdleStop;
  private press = 0;
  private readonly kept = new Map<string | null, Press>(); // presses that no answer has come to, one for each robot

  constructor(private readonly ways: StopWays) {}

  async stop(robot_id: string | null): Promise<void> {
    const pressed_at_ms = this.ways.now_ms();
    const press = { number: ++this.press, robot_id, key: new_key(), pressed_at_ms, failed_at_ms: null };
    this.kept.set(robot_id, press);
    return this.send(press, true);
  }

  // The station is back: what it may never have received goes once more, under the same key, so that one press is one stop.
  // Not a press of long ago: the person who made it has done something else since.
  again(): void {
    for (const press of [...this.kept.values()]) this.send_again(press);
  }

  // SAFETY: a station that is too busy, or a proxy in its place, may answer while the link stays up.
  private again_after_failure(): void {
    const failed_before_ms = this.ways.now_ms() - kAgain_ms;
    for (const press of [...this.kept.values()]) {
      if (press.failed_at_ms !== null && press.failed_at_ms <= failed_before_ms) this.send_again(press);
    }
  }

  private send_again(press: Press): void {
    const is_old = this.ways.now_ms() - press.pressed_at_ms > kKept_ms;
    const found = this.ways.evidence(press.robot_id, press.pressed_at_ms);
    if (is_old || is_complete(found) || (found.open === 0 && found.cleared > 0)) this.drop(press);
    else void this.send(press, false);
  }

  private async send(press: Press, is_first: boolean): Promise<void> {
    const { robot_id, key, pressed_at_ms } = press;
    press.failed_at_ms = null;
    // SAFETY: both leave in this very call, before anything is drawn.
    const by_socket = sent_without_throwing(() => this.ways.over_socket(robot_id, key));
    const answer = this.ways.over_http(robot_id, key);
    if (is_first) this.show({ ...kIdleStop, phase: 'sent', robot_id, pressed_at_ms });
    const settle = (change: Partial<StopState>) => {
      if (press.number !== this.press) return; // a later press shows its own state
      this.show({
        ...kIdleStop,
        robot_id,
        pressed_at_ms,
        answered_after_ms: this.ways.now_ms() - pressed_at_ms,
        ...change,
      });
      this.look();
    };
    try {
      const outcome = await answer;
      this.drop(press);
      settle({ phase: phase_of(outcome), outcome });
    } catch (error) {
      const problem = error instanceof Error ? error.message : String(error);
      if (this.ways.was_answered(error)) this.drop(press);
      press.failed_at_ms = this.ways.now_ms();
      settle({
        phase: 'failed',
        problem: by_socket ? `Sent over the live link; the second way failed: ${problem}` : problem,
        is_kept: this.kept.get(robot_id) === press,
      });
    }
  }

  private drop(press: Press): void {
    if (this.kept.get(press.robot_id) === press) this.kept.delete(press.robot_id);
  }

  // Called again and again: telemetry settles what no answer has settled, and shows when the latch is gone.
  look(): void {
    this.again_after_failure();
    const { phase, robot_id, pressed_at_ms } = this.state;
    if (phase === 'idle') return;
    if (phase === 'sent') {
      if (this.ways.now_ms() - pressed_at_ms >= kLate_ms) this.show({ ...this.state, phase: 'late' });
      return;
    }
    const found = this.ways.evidence(robot_id, pressed_at_ms);
    if (phase === 'stopped' || phase === 'seen') {
      if (found.cleared > 0 && robot_id !== null) this.forget();
      return;
    }
    if (!is_complete(found)) return;
    const next = found.kept > 0 ? 'kept' : 'seen';
    if (next !== phase) this.show({ ...this.state, phase: next });
  }

  // The newest press; with it a clear says later which stop it was begun under.
  get newest_press(): number {
    return this.press;
  }

  // A latch of this robot was cleared: its stop is history.
  // SAFETY: not a press that came after the clear was begun, not the stop of another robot, and never one of all robots.
  cleared(robot_id: string, press_before: number): void {
    if (press_before === this.press && this.state.robot_id === robot_id) this.forget();
  }

  private forget(): void {
    this.press += 1;
    this.kept.delete(this.state.robot_id);
    this.show(kIdleStop);
  }

  private show(state: StopState): void {
    this.state = state;
    this.ways.on_change(state);
  }
}

// Random, also on a page without TLS, where the browser has no randomUUID.
export function new_key(): string {
  const words = crypto.getRandomValues(new Uint32Array(4));
  return Array.from(words, (word) => word.toString(16)).join('-');
}

function sent_without_throwing(send: () => boolean): boolean {
  try {
    return send();
  } catch {
    return false;
  }
}
