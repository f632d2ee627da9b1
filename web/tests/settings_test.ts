// What a browser keeps of the view.
import { expect, test } from 'vitest';
import { ViewSettings, type Shelf } from '../src/settings';

function shelf_of(kept: Record<string, string> = {}): Shelf & { kept: Record<string, string> } {
  return { kept, getItem: (key) => kept[key] ?? null, setItem: (key, value) => void (kept[key] = value) };
}

test('hidden robots stay hidden over a reload', () => {
  const shelf = shelf_of();
  const { hidden_robots } = new ViewSettings(shelf);
  hidden_robots.add('a', 'b');
  hidden_robots.remove('a');
  expect([...new ViewSettings(shelf).hidden_robots.names.value]).toEqual(['b']);
});

test('a browser that keeps nothing, or nonsense, shows everything', () => {
  const refusing: Shelf = {
    getItem: () => {
      throw new Error('forbidden');
    },
    setItem: () => {
      throw new Error('full');
    },
  };
  for (const shelf of [
    null,
    refusing,
    shelf_of({ 'rheonaut.hidden_robots': '{"a":' }),
    shelf_of({ 'rheonaut.hidden_robots': '{"a":1}' }),
  ]) {
    const { hidden_robots } = new ViewSettings(shelf);
    expect(hidden_robots.names.value.size).toBe(0);
    hidden_robots.add('a');
    expect(hidden_robots.names.value.has('a')).toBe(true);
  }
});

test('what was dismissed first is forgotten first', () => {
  const { dismissed } = new ViewSettings(null);
  for (let n = 0; n < 500; ++n) dismissed.add(`run ${n}`);
  expect(dismissed.names.value.size).toBe(200);
  expect(dismissed.names.value.has('run 499')).toBe(true);
});
