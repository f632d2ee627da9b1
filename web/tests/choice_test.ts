// The list to choose from: where keys and typed letters lead; and that no part of the page opens a list of the browser's.
import { readdirSync, readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { move, search } from '../src/parts/choice';

const fluids = ['non-Newtonian', 'water', 'glycerine', 'gel', 'fluid not known'].map((text) => ({ value: text, text }));

test('arrows open the list at what is chosen, and move in it without leaving it', () => {
  expect(move('ArrowDown', false, 1, 5)).toEqual({ open: true, at: 1 });
  expect(move('ArrowDown', true, 1, 5)).toEqual({ open: true, at: 2 });
  expect(move('ArrowDown', true, 4, 5)).toEqual({ open: true, at: 4 });
  expect(move('ArrowUp', true, 0, 5)).toEqual({ open: true, at: 0 });
  expect(move('End', true, 0, 5)).toEqual({ open: true, at: 4 });
  expect(move('Home', true, 3, 5)).toEqual({ open: true, at: 0 });
});

test('Enter, Space and Tab choose in an open list; Tab opens none', () => {
  for (const key of ['Enter', ' ', 'Tab']) expect(move(key, true, 2, 5)).toBe('choose');
  expect(move('Tab', false, 2, 5)).toBeNull();
});

test('Escape is left to the stop', () => {
  expect(move('Escape', true, 2, 5)).toBeNull();
});

test('typed letters search, a repeated one goes on to the next', () => {
  expect(search(fluids, 'w', 0)).toBe(1);
  expect(search(fluids, 'gl', 0)).toBe(2);
  expect(search(fluids, 'g', 0)).toBe(2);
  expect(search(fluids, 'gg', 2)).toBe(3);
  expect(search(fluids, 'g', 3)).toBe(2);
  expect(search(fluids, 'x', 3)).toBe(3);
});

// SAFETY: while a native pop-up is open the browser keeps the first Escape, and the robot runs on.
test('nothing on the page opens a native pop-up', () => {
  const native =
    /<select|<datalist|<dialog|\blist=|popover|showModal|type="(date|time|month|week|datetime-local|color|file|search|email)|\b(alert|confirm|prompt)\(/;
  const sources = readdirSync('src', { recursive: true, encoding: 'utf8' }).filter((name) => name.endsWith('.tsx'));
  expect(sources.length).toBeGreaterThan(15);
  for (const name of sources) {
    const source = readFileSync(`src/${name}`, 'utf8');
    expect(source.match(native)?.[0], name).toBeUndefined();
    if (name.endsWith('signed_out.tsx')) continue; // nothing can be stopped from there
    for (const [input] of source.matchAll(/<input[^>]*>?/g)) {
      if (!input.includes('type="range"'))
        expect(input, `${name}: earlier entries would be listed`).toContain('autoComplete="off"');
    }
  }
});
