// The way between this page and the station, measured by the stamps of /live and by echoes.
//
//   station → page   stamp_us each 100 ms: the station runs, and how old what comes from it is
//   page → station   with every second stamp an echo of it, which comes back at once: what this page sends arrives
//
//   round trip = when the echo came back − when it was sent
//   true age of a stamp = time since it came + how much longer it was on its way than the fastest one
//
// SAFETY: what comes late is counted as old as it is. Stamps that have waited, in a network or in a page that stood still,
// prove nothing of the present.

export const kSilent_ms = 250; // without a stamp for this long the station may stand still
export const kEcho_ms = 200; // how often the way there is tried
export const kUnanswered_ms = 100; // beside twice the usual round trip: an echo that is not back by then may not have come
const kLongestWay_ms = 500; // that is allowed for, twice
const kJitter_ms = 20; // of the stamps
const kRemembered = 64; // echoes that may still come back
const kLatest = 9; // round trips of which the middle one is shown
const kDrift = 1e-4; // clocks part by no more than this, so the fastest way is believed that much less as time goes by

export class StationPath {
  round_trip_ms: number | null = null; // null: not measured
  private stamp_at_ms = -Infinity; // the newest, as old as it is
  private least_ms = Infinity; // of page time less stamp
  private least_at_ms = 0;
  private echoed_at_ms = -Infinity;
  private readonly sent = new Map<number, number>(); // stamp_us → when its echo left; the oldest first
  private latest_ms: number[] = [];
  private utc_offset_us: number | null = null; // UTC less the station's steady time
  private utc_minus_page_ms: number | null = null; // as it was known last

  // A connection was welcomed: both ways have just worked.
  begin(welcome: { stamp_us: number; utc_us: number }, now_ms: number): void {
    this.end();
    this.stamp_at_ms = now_ms;
    this.utc_offset_us = welcome.utc_us - welcome.stamp_us;
    this.utc_minus_page_ms = welcome.utc_us / 1000 - now_ms;
  }

  end(): void {
    this.round_trip_ms = null;
    this.stamp_at_ms = this.echoed_at_ms = -Infinity;
    this.least_ms = Infinity;
    this.sent.clear();
    this.latest_ms = [];
    this.utc_offset_us = null;
  }

  // True: send an echo of it now, and say so with echoed().
  receive({ stamp_us }: { stamp_us: number }, now_ms: number): boolean {
    const transit_ms = now_ms - stamp_us / 1000;
    this.least_ms = Math.min(transit_ms, this.least_ms + kDrift * (now_ms - this.least_at_ms));
    this.least_at_ms = now_ms;
    this.stamp_at_ms = Math.max(this.stamp_at_ms, now_ms - (transit_ms - this.least_ms));
    return now_ms - this.echoed_at_ms >= kEcho_ms - kJitter_ms;
  }

  echoed(stamp_us: number, now_ms: number): void {
    this.echoed_at_ms = now_ms;
    this.sent.set(stamp_us, now_ms);
    for (const known of this.sent.keys()) if (this.sent.size > kRemembered) this.sent.delete(known);
  }

  receive_echo(stamp_us: number, now_ms: number): void {
    const sent_ms = this.sent.get(stamp_us);
    if (sent_ms === undefined) return;
    for (const known of this.sent.keys()) if (known <= stamp_us) this.sent.delete(known); // they come back in order
    this.latest_ms = [...this.latest_ms, now_ms - sent_ms].slice(-kLatest);
    const ordered = [...this.latest_ms].sort((a, b) => a - b);
    this.round_trip_ms = ordered[ordered.length >> 1] ?? null;
  }

  // Until when, without another message, the station is believed to send, and to receive from this page.
  get heard_until_ms(): number {
    return this.stamp_at_ms + kSilent_ms;
  }
  get received_until_ms(): number {
    const [oldest_ms] = this.sent.values();
    if (oldest_ms === undefined) return Infinity;
    return oldest_ms + kUnanswered_ms + 2 * Math.min(this.round_trip_ms ?? kLongestWay_ms, kLongestWay_ms);
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

  // The time in UTC, by the station's clock.
  station_utc_us(now_ms: number): number | null {
    const station_us = this.station_us(now_ms);
    return station_us === null || this.utc_offset_us === null ? null : station_us + this.utc_offset_us;
  }
  // The same while it is not connected, as it was known last; by this computer's clock alone before the first connection.
  utc_s(now_ms: number): number {
    const utc_us = this.station_utc_us(now_ms);
    if (utc_us !== null) this.utc_minus_page_ms = utc_us / 1000 - now_ms;
    return (now_ms + (this.utc_minus_page_ms ?? Date.now() - now_ms)) / 1000;
  }
}
