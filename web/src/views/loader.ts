// Loads the code of a view when it is first opened, and again and again while the station cannot be reached.

import { signal, type Signal } from '@preact/signals';
import type { View, ViewModule } from './table';

export const kTryAgain_ms = 1000;

export interface Loading {
  module: ViewModule | null;
  failures: number; // in a row
}

export class ViewLoader {
  private readonly known = new Map<string, Signal<Loading>>();

  constructor(private readonly set_timer: (callback: () => void, delay_ms: number) => unknown) {}

  // Begins to load at the first call; the signal changes when it is there, and when it has failed.
  of(view: View): Signal<Loading> {
    const known = this.known.get(view.name);
    if (known) return known;
    const made = signal<Loading>({ module: null, failures: 0 });
    this.known.set(view.name, made);
    void this.load(view, made);
    return made;
  }

  private async load(view: View, into: Signal<Loading>): Promise<void> {
    try {
      into.value = { module: await view.load(), failures: 0 };
    } catch {
      into.value = { module: null, failures: into.peek().failures + 1 };
      this.set_timer(() => void this.load(view, into), kTryAgain_ms);
    }
  }
}
