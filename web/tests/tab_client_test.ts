// By which id a tab goes: over a reload, as the copy of another, and without a storage.
import { expect, test } from 'vitest';
import type { Shelf } from '../src/settings';
import { TabClient } from '../src/tab_client';

function shelf(): Shelf {
  const kept = new Map<string, string>();
  return {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
  } as Shelf;
}

const page_of = (tab: TabClient) => new URLSearchParams(tab.query()).get('page');

test('the id survives a reload, and each load is another page', () => {
  const of_tab = shelf();
  const before = new TabClient(of_tab);
  const after = new TabClient(of_tab);
  expect(before.id).toMatch(/^[0-9a-f-]{8,64}$/);
  expect(after.id).toBe(before.id);
  expect(new URLSearchParams(after.query()).get('client')).toBe(before.id);
  expect(page_of(after)).not.toBe(page_of(before));
  expect(new TabClient(shelf()).id).not.toBe(before.id);
});

test('the id that the station gives to the copy of a tab is kept for the next load', () => {
  const of_tab = shelf();
  const copy = new TabClient(of_tab);
  copy.keep('given-by-the-station');
  expect(new TabClient(of_tab).id).toBe('given-by-the-station');
});

test('without a storage, or with a full one, the id holds as long as the page', () => {
  const full: Shelf = {
    ...shelf(),
    setItem: () => {
      throw new Error('full');
    },
  };
  expect(new TabClient(full).id).not.toBe('');
  expect(new TabClient(null).id).not.toBe('');
});

test('what is kept and is no id is replaced, and a storage that throws is none', () => {
  const of_tab = shelf();
  for (const wrong of ['', 'short', 'a\r\nX-Other: 1', 'é'.repeat(9), 'a'.repeat(65)]) {
    of_tab.setItem('rheonaut-client', wrong);
    expect(new TabClient(of_tab).id).toMatch(/^[0-9a-f-]{8,64}$/);
  }
  const broken: Shelf = {
    getItem: () => {
      throw new Error('closed');
    },
    setItem: () => {
      throw new Error('closed');
    },
  } as Shelf;
  expect(new TabClient(broken).id).toMatch(/^[0-9a-f-]{8,64}$/);
});
