// What this browser keeps of the view: which robots are not listed, and which notices were dismissed.
//
// Both only change what is drawn. SAFETY: nothing that commands or stops reads them.

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

export class ViewSettings {
  readonly hidden_robots: KeptSet;
  readonly dismissed: KeptSet;

  constructor(shelf: Shelf | null) {
    this.hidden_robots = new KeptSet(shelf, 'rheonaut.hidden_robots', kMaxNames);
    this.dismissed = new KeptSet(shelf, 'rheonaut.dismissed', kMaxDismissed);
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
