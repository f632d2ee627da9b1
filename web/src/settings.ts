// What this browser keeps of the view: which robots are not listed, which notices were dismissed, and whether an alarm is
// heard or notified.
//
// They only change what is drawn. SAFETY: nothing that commands or stops reads them.

import { signal, type Signal } from '@preact/signals';

export type Shelf = Pick<Storage, 'getItem' | 'setItem'>;

const kMaxNames = 20_000;
const kMaxDismissed = 200;

// A set of names that is kept under one key; without a shelf, or with one that refuses, it lasts as long as the page.
class KeptSet {
  readonly names: Signal<ReadonlySet<string>>;

  constructor(
    private readonly shelf: Shelf | null,
    private readonly key: string,
    private readonly capacity: number,
  ) {
    this.names = signal(new Set(this.load()));
  }

  add(...names: string[]): void {
    const next = new Set(this.names.peek());
    for (const name of names) next.delete(name); // the newest stand last
    this.keep([...next, ...new Set(names)]);
  }

  remove(...names: string[]): void {
    const gone = new Set(names);
    this.keep([...this.names.peek()].filter((name) => !gone.has(name)));
  }

  private keep(names: string[]): void {
    const kept = names.slice(-this.capacity); // the oldest are dropped
    this.names.value = new Set(kept);
    try {
      this.shelf?.setItem(this.key, JSON.stringify(kept));
    } catch {
      // A browser that keeps nothing shows the view as it is until the page is closed.
    }
  }

  private load(): string[] {
    try {
      const kept: unknown = JSON.parse(this.shelf?.getItem(this.key) ?? '[]');
      return Array.isArray(kept) ? kept.filter((name) => typeof name === 'string') : [];
    } catch {
      return [];
    }
  }
}

// A switch that is off until somebody turns it on.
class KeptSwitch {
  readonly on: Signal<boolean>;

  constructor(
    private readonly shelf: Shelf | null,
    private readonly key: string,
  ) {
    let kept: string | null = null;
    try {
      kept = shelf?.getItem(key) ?? null;
    } catch {
      // as if nothing were kept
    }
    this.on = signal(kept === 'on');
  }

  set(on: boolean): void {
    this.on.value = on;
    try {
      this.shelf?.setItem(this.key, on ? 'on' : 'off');
    } catch {
      // It lasts as long as the page.
    }
  }
}

export class ViewSettings {
  readonly sound: KeptSwitch; // of a new alarm
  readonly notification: KeptSwitch;
  readonly threshold_mute: KeptSwitch; // thresholds are silent where alarms sound
  readonly hidden_robots: KeptSet;
  readonly dismissed: KeptSet;

  constructor(shelf: Shelf | null) {
    this.hidden_robots = new KeptSet(shelf, 'rheonaut.hidden_robots', kMaxNames);
    this.dismissed = new KeptSet(shelf, 'rheonaut.dismissed', kMaxDismissed);
    this.sound = new KeptSwitch(shelf, 'rheonaut.sound');
    this.notification = new KeptSwitch(shelf, 'rheonaut.notification');
    this.threshold_mute = new KeptSwitch(shelf, 'rheonaut.threshold_mute');
  }
}

// The browser's own; null where it is forbidden, for example by a setting against cookies.
export function browser_shelf(): Shelf | null {
  try {
    return localStorage;
  } catch {
    return null;
  }
}
