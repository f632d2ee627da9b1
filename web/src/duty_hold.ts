// Hold to run: a manual duty that lives while a hand is on the control, and one moment longer at most.
//
// Pressing sends set_duty, holding renews its lease, letting go sends duty 0 at once. Two requests may overtake each
// other on their way, so when the hand let go before the first was answered, duty 0 is sent once more after it.

export const kRenew_ms = 150;
export const kLease_ms = 500; // of the robot, from one renewal to the next

export interface HoldWays {
  set_duty(robot_id: string, duty: number): Promise<unknown>;
  renew_lease(robot_id: string): boolean; // false: the stamp is stale or the link closed, nothing was sent
  now_ms(): number;
  set_interval(callback: () => void, period_ms: number): unknown;
  clear_interval(timer: unknown): void;
  on_change(): void;
}

export class DutyHold {
  robot_id: string | null = null; // of the held duty; null when nothing is held
  error: Error | null = null;
  lapsed = false; // the last hold ended because its lease could not be renewed
  private duty = 0; // wanted
  private sent_duty = 0;
  private in_flight = 0;
  private stop_again: string | null = null; // a robot whose duty 0 may have been overtaken
  private timer: unknown = null;
  private pressed_at_ms = 0;
  private renewed_at_ms = 0;

  constructor(private readonly ways: HoldWays) {}

  press(robot_id: string, duty: number): void {
    if (this.robot_id !== null) this.release();
    this.robot_id = robot_id;
    this.duty = duty;
    this.error = null;
    this.lapsed = false;
    this.pressed_at_ms = this.renewed_at_ms = this.ways.now_ms();
    this.timer = this.ways.set_interval(() => this.renew(), kRenew_ms);
    void this.send();
    this.ways.on_change();
  }

  // Another duty while held; the newest wins, and only one is on its way at a time.
  change(duty: number): void {
    if (this.robot_id === null) return;
    this.duty = duty;
    if (this.in_flight === 0) void this.send();
  }

  release(): void {
    const robot_id = this.robot_id;
    if (robot_id === null) return;
    this.robot_id = null;
    this.ways.clear_interval(this.timer);
    // SAFETY: at once, whatever is still on its way; the robot's lease ends by itself if this is lost.
    this.stop(robot_id);
    this.ways.on_change();
  }

  // It runs by renewals alone, which the station takes from nobody but who is in control.
  get is_past_first_lease(): boolean {
    return this.robot_id !== null && this.ways.now_ms() - this.pressed_at_ms > kLease_ms;
  }

  // The robot or the station ended it (emergency, mode change, control taken by another): nothing more to send.
  forget(): void {
    if (this.robot_id === null) return;
    this.robot_id = null;
    this.ways.clear_interval(this.timer);
    this.ways.on_change();
  }

  private stop(robot_id: string): void {
    this.stop_again = this.in_flight > 0 ? robot_id : null;
    void this.ways.set_duty(robot_id, 0).catch(() => undefined);
  }

  // SAFETY: of a page that stood still for longer than the lease the duty has ended, whatever is fresh now; the hand has to
  // press again, and nothing says that the motor runs.
  private renew(): void {
    if (this.robot_id === null) return;
    const now_ms = this.ways.now_ms();
    const stood_still = now_ms - this.renewed_at_ms > kLease_ms;
    if (stood_still || !this.ways.renew_lease(this.robot_id)) return this.lapse();
    this.renewed_at_ms = now_ms;
  }

  // The lease could not be renewed.
  lapse(): void {
    if (this.robot_id === null) return;
    // The lease ends by now, and only a new command may move the motor: so only a new press does.
    this.lapsed = true;
    this.release();
  }

  private async send(): Promise<void> {
    const robot_id = this.robot_id;
    if (robot_id === null) return;
    const duty = (this.sent_duty = this.duty);
    this.in_flight += 1;
    try {
      await this.ways.set_duty(robot_id, duty);
    } catch (error) {
      if (this.robot_id === robot_id) {
        this.error = error as Error;
        this.forget();
      }
    } finally {
      this.in_flight -= 1;
    }
    if (this.in_flight === 0 && this.stop_again !== null && this.robot_id === null) {
      const again = this.stop_again;
      this.stop_again = null;
      void this.ways.set_duty(again, 0).catch(() => undefined);
    } else if (this.robot_id === robot_id && this.duty !== this.sent_duty) {
      void this.send();
    }
  }
}
