// What title and icon of the tab say.
import { expect, test } from 'vitest';
import { tab_title } from '../src/tab';

test('an emergency is named, several are counted, and nothing hides one', () => {
  expect(tab_title([], false)).toBe('Rheonaut');
  expect(tab_title(['rheo-1'], false)).toBe('EMERGENCY rheo-1 · Rheonaut');
  expect(tab_title(['a', 'b'], false)).toBe('EMERGENCY 2 robots · Rheonaut');
  expect(tab_title([], true)).toBe('Cut off · Rheonaut');
  expect(tab_title(['rheo-1'], true)).toContain('EMERGENCY');
});
