// What the tests hand in instead of time, timers, sockets and the station.

import type { LiveMessage, RobotState, SamplesMessage } from '../src/api';
import type { Socket, Surroundings } from '../src/live';
import { Store } from '../src/store';

// Time that moves only when it is advanced; timers run in their order.
export class FakeTime {
  now_ms = 0;
  private timers: { at_ms: number; every_ms: number | null; callback: () => void; id: number }[] = [];
  private next_id = 1;

  set(callback: () => void, delay_ms: number, every_ms: number | null = null): number {
    this.timers.push({ at_ms: this.now_ms + delay_ms, every_ms, callback, id: this.next_id });
    return this.next_id++;
  }
  clear(id: unknown): void {
    this.timers = this.timers.filter((timer) => timer.id !== id);
  }
  get waiting_ms(): number[] {
    return this.timers.map((timer) => timer.at_ms - this.now_ms);
  }
  async advance(by_ms: number): Promise<void> {
    const end_ms = this.now_ms + by_ms;
    for (;;) {
      const next = this.timers.filter((timer) => timer.at_ms <= end_ms).sort((a, b) => a.at_ms - b.at_ms)[0];
      if (!next) break;
      this.now_ms = next.at_ms;
      if (next.every_ms === null) this.clear(next.id);
      else next.at_ms += next.every_ms;
      next.callback();
      await settle();
    }
    this.now_ms = end_ms;
    await settle();
  }
}

// Lets promises that are ready run.
export const settle = () => new Promise<void>((resolve) => setImmediate(resolve));

export class FakeSocket implements Socket {
  readyState = 0;
  onopen: Socket['onopen'] = null;
  onmessage: Socket['onmessage'] = null;
  onclose: Socket['onclose'] = null;
  onerror: Socket['onerror'] = null;
  sent: unknown[] = [];
  closed = false;

  send(text: string): void {
    this.sent.push(JSON.parse(text));
  }
  close(): void {
    this.closed = true;
    this.readyState = 3;
  }
  say(message: LiveMessage): void {
    this.readyState = 1;
    this.onmessage?.({ data: JSON.stringify(message) } as never);
  }
  welcome(): void {
    this.say({ type: 'welcome', actor: 'session:1', version: '0.1.0', utc_us: 0, stamp_us: 0, robots: [] });
  }
  break(): void {
    this.readyState = 3;
    this.onclose?.(undefined as never);
  }
}

export class FakeSurroundings implements Surroundings {
  readonly time = new FakeTime();
  readonly sockets: FakeSocket[] = [];
  signed_out = false;
  chance = 0.5; // no jitter

  get socket(): FakeSocket {
    return this.sockets[this.sockets.length - 1] as FakeSocket;
  }
  open_socket = () => {
    this.sockets.push(new FakeSocket());
    return this.socket;
  };
  now_ms = () => this.time.now_ms;
  set_timer = (callback: () => void, delay_ms: number) => this.time.set(callback, delay_ms);
  clear_timer = (timer: unknown) => this.time.clear(timer);
  random = () => this.chance;
  is_signed_out = () => Promise.resolve(this.signed_out);
}

// A batch of `size` samples whose position is seq / 1000 m.
export function batch(first_seq: number, size: number, change: Partial<SamplesMessage> = {}): SamplesMessage {
  const column = (value: (i: number) => number) => Array.from({ length: size }, (_, i) => value(i));
  return {
    type: 'samples',
    robot_id: 'rheo-1',
    boot_id: '11',
    first_seq,
    first_robot_time_us: first_seq * 10_000,
    period_us: 10_000,
    mode: 'auto',
    sub_state: 'navigating',
    setpoint_m: 0.1,
    disturbance_m: 0,
    position_sd_m: 0.001,
    emergency_id: null,
    flags: 0,
    unknown_values: null,
    backfill: false,
    position_m: column((i) => (first_seq + i) / 1000),
    velocity_m_s: column(() => 0),
    acceleration_m_s2: column(() => 0),
    duty: column(() => 0.5),
    impedance_mv: column(() => 175),
    reference_m: column(() => 0.1),
    ...change,
  };
}

// A connected robot that nobody controls, at rest.
export const robot = (robot_id: string, change: object = {}) =>
  ({
    robot_id,
    link: 'connected',
    mode: 'manual',
    emergency_id: null,
    pending_stop: null,
    control: null,
    reservation: null,
    clock: null,
    ...change,
  }) as unknown as RobotState;

// A store that the station has welcomed, and the page's clock.
export function store_with(...robots: RobotState[]) {
  const clock = { page: 0 };
  const store = new Store({ page_ms: () => clock.page, utc_ms: () => 0 });
  store.receive({ type: 'welcome', actor: 'session:1', version: '', utc_us: 0, stamp_us: 0, robots });
  store.is_current.value = true;
  store.refresh();
  return { store, clock };
}
