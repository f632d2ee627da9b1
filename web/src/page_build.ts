// Whether the station serves another build of this page than the one that runs here, as it does after an upgrade.
//
// The names of built files contain digests of their contents, so index.html names other files after any change.

import { effect, signal } from '@preact/signals';
import type { LinkPhase } from './live';

export const is_outdated = signal(false);

export const kLookAgain_ms = 5000; // after a look that failed

// The built files that a page loads; '' for one that was not built, as in development.
export function files_of(html: string): string {
  const found = [...html.matchAll(/(?:src|href)="(\/assets\/[^"]+)"/g)].map(([, file]) => file);
  return found.sort().join(' ');
}

export interface BuildWays {
  own_html: string; // of the page as it was loaded, before it has loaded any view
  phase: { readonly value: LinkPhase };
  served_html(): Promise<string>;
  set_timer(callback: () => void, delay_ms: number): unknown;
}

// Looks with each new connection: a station that was upgraded has ended those of its predecessor.
// SAFETY: the page never loads itself anew: somebody may be holding a control, or rely on what is shown.
export function follow_build(ways: BuildWays): void {
  const own = files_of(ways.own_html);
  const look = async () => {
    if (ways.phase.value !== 'live') return;
    try {
      const served = files_of(await ways.served_html());
      is_outdated.value = served !== '' && served !== own;
    } catch {
      ways.set_timer(() => void look(), kLookAgain_ms);
    }
  };
  effect(() => void (ways.phase.value === 'live' && void look()));
}

export async function served_html(): Promise<string> {
  const answer = await fetch('/', { cache: 'no-store' });
  if (!answer.ok) throw new Error(`the station answered ${answer.status}`);
  return answer.text();
}
