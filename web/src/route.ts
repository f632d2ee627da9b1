// The address of what is shown: a view, what of it, and how it is looked at, all in the hash, so that a link leads back.
//
//   #/runs/12?from=1764120000000   →   { view: 'runs', parts: ['12'], query: { from: '1764120000000' } }
//   (nothing)                      →   { view: 'robot', parts: [], query: {} }
//
// Nothing that commands or stops reads it: which robot the stop button names is the store's (Store.want).

import { signal } from '@preact/signals';

export interface Route {
  view: string;
  parts: string[];
  query: Record<string, string>;
}

export type Target = Pick<Route, 'view'> & Partial<Route>;

export const kFirstView = 'robot';

// What the page shows now.
export const route = signal<Route>(parse(''));

export function parse(hash: string): Route {
  const [path = '', query = ''] = hash.replace(/^#\/?/, '').split(/\?(.*)/s);
  const [view = '', ...parts] = path.split('/').filter(Boolean).map(decoded);
  return { view: view || kFirstView, parts, query: Object.fromEntries(new URLSearchParams(query)) };
}

// Members of the query that are empty are left out.
export function format({ view, parts = [], query = {} }: Target): string {
  const said = new URLSearchParams(Object.entries(query).filter(([, value]) => value !== '')).toString();
  return `#/${[view, ...parts].map(encodeURIComponent).join('/')}${said && `?${said}`}`;
}

// `replace`: not a step that "back" leads to, for what changes while somebody drags or types.
// SAFETY: what is shown, and with it the robot that the stop button names, changes in this very call.
export function go_to(target: Target, replace = false): void {
  const hash = format(target);
  if (replace) history.replaceState(null, '', hash);
  else if (hash !== format(route.peek())) history.pushState(null, '', hash);
  route.value = parse(hash);
}

// Changes some members of the query of what is shown, without a step for "back"; '' takes one out.
export function change_query(change: Record<string, string>): void {
  const now = route.peek();
  go_to({ ...now, query: { ...now.query, ...change } }, true);
}

// Follows links, "back" and what is typed into the address.
export function follow_address(page: Pick<Window, 'addEventListener' | 'location'>): void {
  const follow = () => {
    const next = parse(page.location.hash);
    if (format(next) !== format(route.peek())) route.value = next;
  };
  page.addEventListener('hashchange', follow);
  page.addEventListener('popstate', follow);
  follow();
}

function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part; // a lone "%" that somebody typed
  }
}
