// Addresses: what they mean, and how the page follows them.
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { change_query, follow_address, format, go_to, kFirstView, parse, route } from '../src/route';

// A browser's history, as much as is needed.
class FakePage {
  entries = [''];
  location = { hash: '' };
  listeners: (() => void)[] = [];
  history = {
    pushState: (_: unknown, __: string, hash: string) => void this.entries.push((this.location.hash = hash)),
    replaceState: (_: unknown, __: string, hash: string) =>
      void (this.entries[this.entries.length - 1] = this.location.hash = hash),
  };
  addEventListener = (_: string, listener: () => void) => void this.listeners.push(listener);
  back(): void {
    this.entries.pop();
    this.location.hash = this.entries[this.entries.length - 1] ?? '';
    this.listeners.forEach((listener) => listener());
  }
}

let page: FakePage;
beforeEach(() => {
  page = new FakePage();
  vi.stubGlobal('history', page.history);
  follow_address(page as never);
});
afterEach(() => vi.unstubAllGlobals());

test('an address is a view, what of it, and how it is looked at', () => {
  expect(parse('#/runs/12?from=1&search=a%20b')).toEqual({
    view: 'runs',
    parts: ['12'],
    query: { from: '1', search: 'a b' },
  });
  expect(parse('#/design')).toEqual({ view: 'design', parts: [], query: {} });
});

test('no address is the first view', () => {
  for (const hash of ['', '#', '#/', '#//']) expect(parse(hash)).toEqual({ view: kFirstView, parts: [], query: {} });
});

test('what is formatted is parsed to the same, whatever the names hold', () => {
  const routes = [
    { view: 'robot', parts: ['sim-1'], query: {} },
    { view: 'robot', parts: ['a/b?c#d%'], query: { q: 'x=1&y?z', 'ü ': '#' } },
    { view: 'runs', parts: ['12', 'replay'], query: { at: '0.5' } },
  ];
  for (const each of routes) expect(parse(format(each))).toEqual(each);
});

test('what somebody typed never throws', () => {
  expect(parse('#/runs/%zz?%').parts).toEqual(['%zz']);
});

test('an empty member of the query is left out', () => {
  expect(format({ view: 'runs', query: { search: '', from: '1' } })).toBe('#/runs?from=1');
});

test('going somewhere is a step that "back" undoes, the same again is none', () => {
  go_to({ view: 'runs' });
  expect(route.value.view).toBe('runs'); // in the very call
  go_to({ view: 'runs' });
  expect(page.entries).toEqual(['', '#/runs']);
  page.back();
  expect(route.value.view).toBe(kFirstView);
});

test('changing the query is no step, and keeps what else is said', () => {
  go_to({ view: 'runs', query: { search: 'x' } });
  change_query({ from: '5' });
  change_query({ search: '' });
  expect(page.entries).toEqual(['', '#/runs?from=5']);
  expect(route.value).toEqual({ view: 'runs', parts: [], query: { from: '5' } });
});
