// The tabs of one browser that look at the same station know of each other: how many of this session there are, and which
// of them runs a motor.

import { signal } from '@preact/signals';

export interface TabState {
  actor: string; // as the station calls the session
  duty_robot_id: string | null; // whose motor it runs
}
interface Note extends TabState {
  tab: string;
  left?: boolean;
}

export interface Channel {
  postMessage(note: unknown): void;
  onmessage: ((event: MessageEvent) => void) | null;
}

export const kTell_ms = 1000;
export const kForgotten_ms = 4000; // a tab in the background reports once a second at best

export class Tabs {
  readonly others = signal<TabState[]>([]); // of this session
  private readonly tab = Array.from(crypto.getRandomValues(new Uint32Array(2))).join('-');
  private readonly known = new Map<string, { state: TabState; at_ms: number }>();
  private own: TabState = { actor: '', duty_robot_id: null };

  constructor(
    private readonly channel: Channel | null, // null: this browser has none
    private readonly now_ms: () => number,
  ) {
    if (channel) channel.onmessage = (event) => this.receive(event.data as Note);
  }

  // At once when something has changed, and again and again.
  tell(own: TabState): void {
    this.own = own;
    this.channel?.postMessage({ ...own, tab: this.tab } satisfies Note);
    this.look();
  }

  leave(): void {
    this.channel?.postMessage({ ...this.own, tab: this.tab, left: true } satisfies Note);
  }

  private receive(note: Note): void {
    const is_new = !this.known.has(note.tab);
    if (note.left) this.known.delete(note.tab);
    else this.known.set(note.tab, { state: note, at_ms: this.now_ms() });
    if (is_new && !note.left) this.tell(this.own);
    else this.look();
  }

  private look(): void {
    const found: TabState[] = [];
    for (const [tab, { state, at_ms }] of this.known) {
      if (this.now_ms() - at_ms > kForgotten_ms) this.known.delete(tab);
      else if (state.actor === this.own.actor && state.actor !== '')
        found.push({ actor: state.actor, duty_robot_id: state.duty_robot_id });
    }
    if (JSON.stringify(found) !== JSON.stringify(this.others.peek())) this.others.value = found;
  }
}

export function browser_channel(): Channel | null {
  return typeof BroadcastChannel === 'undefined' ? null : new BroadcastChannel('rheonaut');
}
