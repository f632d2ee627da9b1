// By which id the station knows this tab, and takes its signs of life for its own alone.
//
// SAFETY: the id survives a reload, so that what this tab has set going goes on. The copy of a tab would go by the same:
// the station, which sees both, gives it a new one with its welcome.
import { new_key } from './emergency';
import type { Shelf } from './settings';

const kKey = 'rheonaut-client';

// SAFETY: what is no id would make each request throw, a stop as well.
function kept_in(shelf: Shelf | null): string | null {
  try {
    const id = shelf?.getItem(kKey) ?? '';
    return /^[\w-]{8,64}$/.test(id) ? id : null;
  } catch {
    return null;
  }
}

export class TabClient {
  id: string;
  private readonly page = new_key(); // of this load: with it the station knows a connection that comes back

  constructor(private readonly shelf: Shelf | null) {
    this.id = kept_in(shelf) ?? new_key();
    this.keep(this.id);
  }

  keep(id: string): void {
    this.id = id;
    try {
      this.shelf?.setItem(kKey, id);
    } catch {
      // a full or closed storage: the id ends with this load
    }
  }

  // The query of the WebSocket, where a browser sends no headers of ours.
  query = (): string => `client=${this.id}&page=${this.page}`;
}

export function tab_shelf(): Shelf | null {
  try {
    return sessionStorage;
  } catch {
    return null;
  }
}
