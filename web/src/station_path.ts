// The way between this page and the station, measured by the stamps of /live and their echoes.
//
//   station → page   stamp_us each 100 ms; the page answers each at once with an echo of it
//   station → page   the next stamp says which echo has come (echo_us), and for how long it has been there (echo_held_us)
//
//   round trip = when the stamp came − when that echo was sent − echo_held_us
//   true age of a stamp = time since it came + how much longer it was on its way than the fastest one
//
// SAFETY: what comes late is counted as old as it is. Stamps that have waited, in a network or in a page that stood still,
// prove nothing of the present.

export interface Stamp {
  stamp_us: number;
  echo_us?: number; // the newest stamp whose echo has come
  echo_held_us?: number;
}

export const kSilent_ms = 250; // without a stamp for this long the station may stand still
export const kUnanswered_ms = 180; // a stamp confirms the echo of the one before, 100 ms older, or this page is not received
const kLongestWay_ms = 500; // that is allowed for, beside that
const kEchoPeriod_ms = 50; // a page that stood still does not answer all that waited for it
const kRemembered = 64; // echoes whose confirmation may still come
const kLatest = 9; // round trips of which the middle one is shown
const kDrift = 1e-4; // clocks part by no more than this, so the fastest way is believed that much less as time goes by

export class StationPath {
  round_trip_ms: number | null = null; // null: not measured
  private answers = false; // the station knows echoes
  private stamp_at_ms = -Infinity; // the newest, as old as it is
  private proof_at_ms = -Infinity; // when the newest echo was sent that has come
  private least_ms = Infinity; // of page time less stamp
  private least_at_ms = 0;
  private echoed_at_ms = -Infinity;
  private readonly sent = new Map<number, number>(); // stamp_us → when its echo left
  private latest_ms: number[] = [];
  private utc_offset_us: number | null = null; // UTC less the station's steady time

  // A connection was welcomed: both ways have just worked.
  begin(welcome: { stamp_us: number; utc_us: number; echoes?: boolean }, now_ms: number): void {
    this.end();
    this.answers = welcome.echoes === true;
    this.stamp_at_ms = this.proof_at_ms = now_ms;
    this.utc_offset_us = welcome.utc_us - welcome.stamp_us;
  }

  end(): void {
    this.round_trip_ms = null;
    this.answers = false;
    this.stamp_at_ms = this.proof_at_ms = this.echoed_at_ms = -Infinity;
    this.least_ms = Infinity;
    this.sent.clear();
    this.latest_ms = [];
    this.utc_offset_us = null;
  }

  // True: answer it with an echo now, and say so with echoed().
  receive({ stamp_us, echo_us, echo_held_us = 0 }: Stamp, now_ms: number): boolean {
    const transit_ms = now_ms - stamp_us / 1000;
    this.least_ms = Math.min(transit_ms, this.least_ms + kDrift * (now_ms - this.least_at_ms));
    this.least_at_ms = now_ms;
    this.stamp_at_ms = Math.max(this.stamp_at_ms, now_ms - (transit_ms - this.least_ms));
    if (echo_us !== undefined) this.take_echo(echo_us, echo_held_us, now_ms);
    return this.answers && now_ms - this.echoed_at_ms >= kEchoPeriod_ms;
  }

  echoed(stamp_us: number, now_ms: number): void {
    this.echoed_at_ms = now_ms;
    this.sent.set(stamp_us, now_ms);
    for (const known of this.sent.keys()) if (this.sent.size > kRemembered) this.sent.delete(known);
  }

  private take_echo(echo_us: number, held_us: number, now_ms: number): void {
    this.answers = true;
    const sent_ms = this.sent.get(echo_us);
    if (sent_ms === undefined) return; // confirmed before
    for (const known of this.sent.keys()) if (known <= echo_us) this.sent.delete(known);
    this.proof_at_ms = sent_ms;
    this.latest_ms = [...this.latest_ms, Math.max(0, now_ms - sent_ms - held_us / 1000)].slice(-kLatest);
    const ordered = [...this.latest_ms].sort((a, b) => a - b);
    this.round_trip_ms = ordered[ordered.length >> 1] ?? null;
  }

  // Until when, without another message, the station is believed to send.
  get heard_until_ms(): number {
    return this.stamp_at_ms + kSilent_ms;
  }

  // Whether it receives from this page, by what its newest stamp confirms. An older station confirms nothing.
  get is_received(): boolean {
    const usual_ms = Math.min(this.round_trip_ms ?? kLongestWay_ms, kLongestWay_ms);
    return !this.answers || this.stamp_at_ms - this.proof_at_ms <= kUnanswered_ms + usual_ms;
  }

  // How old a stamp is that the newest one was sent with.
  stamp_age_ms(now_ms: number): number {
    return now_ms - this.stamp_at_ms;
  }

  // The station's steady time now, as well as it is known; null: not connected.
  station_us(now_ms: number): number | null {
    if (!Number.isFinite(this.least_ms)) return null;
    return (now_ms - this.least_ms + (this.round_trip_ms ?? 0) / 2) * 1000;
  }

  // That time in UTC, by the station's clock.
  station_utc_us(now_ms: number): number | null {
    const station_us = this.station_us(now_ms);
    return station_us === null || this.utc_offset_us === null ? null : station_us + this.utc_offset_us;
  }
}
