// The /live WebSocket that heals itself: opens, notices silence, and tries again until it is stopped.
//
//   connecting → (welcome) → live → (closed, or silent for 1.5 s) → waiting → connecting → …
//   waiting → (the station says 401) → signed_out → (a person opened the link, in whatever tab) → connecting → …
//
// The station sends a stamp each 100 ms, so silence means that the link is dead, whatever TCP believes.
// Time, timers, sockets and chance are handed in, so that tests run it without any of them.

import type { ClientMessage, LiveMessage } from './api';

export type LinkPhase = 'connecting' | 'live' | 'waiting' | 'signed_out';

export interface Socket {
  readyState: number;
  onopen: ((event: never) => void) | null;
  onmessage: ((event: never) => void) | null;
  onclose: ((event: never) => void) | null;
  onerror: ((event: never) => void) | null;
  send(text: string): void;
  close(): void;
}

export interface Surroundings {
  open_socket(): Socket;
  now_ms(): number;
  set_timer(callback: () => void, delay_ms: number): unknown;
  clear_timer(timer: unknown): void;
  random(): number; // in [0, 1)
  is_signed_out(): Promise<boolean>; // asks the station over HTTP
}

export const kSilence_ms = 1500;
export const kOpen_ms = 3000; // a connection that is not welcomed within this is given up
export const kFirstDelay_ms = 300;
export const kLongestDelay_ms = 2000;
const kDelayGrowth = 1.6;
const kJitter = 0.3; // of the delay, either way
export const kFresh_ms = 400; // a stamp younger than this proves that the station receives and answers
export const kCurrent_ms = 1000; // without a stamp for this long, nothing is claimed of the station's present
export const kSignedOut_ms = 2000; // how often a signed-out page asks whether it still is
const kOpenState = 1;

export class LiveLink {
  phase: LinkPhase = 'connecting';
  lost_at_ms: number | null = null; // when it was last live; null while it is
  attempt = 0; // failed ones since it was last live
  stamp_us: number | null = null; // the latest of this connection
  stamp_at_ms = -Infinity;
  private socket: Socket | null = null;
  private timer: unknown = null;
  heard_at_ms = 0; // when the latest message came
  private stopped = false;

  constructor(
    private readonly surroundings: Surroundings,
    private readonly on_message: (message: LiveMessage) => void,
    private readonly on_phase: () => void,
  ) {}

  start(): void {
    this.stopped = false;
    this.lost_at_ms = this.surroundings.now_ms();
    this.connect();
  }

  stop(): void {
    this.stopped = true;
    this.drop_socket();
    this.set_timer(null, 0);
  }

  // Tries at once; for a page that wakes up or a network that is back.
  hurry(): void {
    if (this.phase === 'waiting') this.connect();
  }

  // A person has just signed in here.
  sign_in(): void {
    if (this.phase === 'signed_out') this.connect();
  }

  // True when it left for the station; false says that this way is closed now.
  send(message: ClientMessage): boolean {
    if (this.socket?.readyState !== kOpenState) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  stamp_is_fresh(): boolean {
    return this.has_stamp_of(kFresh_ms);
  }

  // Whether what the page shows of control and recording still holds.
  is_current(): boolean {
    return this.has_stamp_of(kCurrent_ms);
  }

  private has_stamp_of(age_ms: number): boolean {
    return this.phase === 'live' && this.surroundings.now_ms() - this.stamp_at_ms < age_ms;
  }

  private connect(): void {
    this.drop_socket();
    this.set_phase('connecting');
    const socket = this.surroundings.open_socket();
    this.socket = socket;
    socket.onmessage = (event: { data: unknown }) => this.receive(event.data);
    socket.onclose = () => this.lose();
    socket.onerror = () => undefined; // a close follows
    this.set_timer(() => this.lose(), kOpen_ms);
  }

  private receive(data: unknown): void {
    if (typeof data !== 'string') return;
    this.heard_at_ms = this.surroundings.now_ms();
    let message: LiveMessage;
    try {
      message = JSON.parse(data) as LiveMessage;
    } catch {
      return; // one broken message is no reason to lose the others
    }
    if (message.type === 'welcome') {
      this.lost_at_ms = null;
      this.attempt = 0;
      this.set_phase('live');
      this.watch_silence();
    } else if (message.type === 'stamp') {
      this.stamp_us = message.stamp_us;
      this.stamp_at_ms = this.heard_at_ms;
    }
    this.on_message(message);
  }

  private watch_silence(): void {
    const silent_ms = this.surroundings.now_ms() - this.heard_at_ms;
    if (silent_ms >= kSilence_ms) this.lose();
    else this.set_timer(() => this.watch_silence(), kSilence_ms - silent_ms);
  }

  private lose(): void {
    if (this.stopped || this.phase === 'signed_out') return;
    this.drop_socket();
    if (this.lost_at_ms === null) this.lost_at_ms = this.heard_at_ms;
    this.stamp_us = null;
    this.stamp_at_ms = -Infinity;
    const delay_ms = Math.min(kLongestDelay_ms, kFirstDelay_ms * kDelayGrowth ** this.attempt);
    const jittered_ms = delay_ms * (1 + kJitter * (2 * this.surroundings.random() - 1));
    this.attempt += 1;
    this.set_phase('waiting');
    this.set_timer(() => this.connect(), Math.min(kLongestDelay_ms, Math.max(kFirstDelay_ms, jittered_ms)));
    void this.ask_whether_signed_out();
  }

  // A refused WebSocket does not say why; HTTP does.
  private async ask_whether_signed_out(): Promise<void> {
    const signed_out = await this.surroundings.is_signed_out().catch(() => this.phase === 'signed_out');
    if (this.stopped || this.phase === 'live') return;
    if (signed_out) {
      this.drop_socket();
      this.set_phase('signed_out');
      this.set_timer(() => void this.ask_whether_signed_out(), kSignedOut_ms);
    } else if (this.phase === 'signed_out') {
      this.connect();
    }
  }

  private drop_socket(): void {
    const socket = this.socket;
    this.socket = null;
    if (!socket) return;
    socket.onmessage = socket.onclose = socket.onopen = null;
    socket.close();
  }

  private set_timer(callback: (() => void) | null, delay_ms: number): void {
    if (this.timer !== null) this.surroundings.clear_timer(this.timer);
    this.timer = callback === null ? null : this.surroundings.set_timer(callback, delay_ms);
  }

  private set_phase(phase: LinkPhase): void {
    if (phase === this.phase) return;
    this.phase = phase;
    this.on_phase();
  }
}
