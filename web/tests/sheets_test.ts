// What the sheets promise of a part of the page, where no browser draws it: what has to be readable, whole or steady.
import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';

// The rules of a sheet, those of its media queries among them: selectors and declarations.
function rules_of(sheet: string): { selectors: string[]; text: string }[] {
  const text = readFileSync(new URL(`../src/style/${sheet}`, import.meta.url), 'utf8').replace(/\/\*.*?\*\//gs, '');
  return [...text.matchAll(/([^{};]+)\{([^{}]*)\}/g)].map(([, selectors, declarations]) => ({
    selectors: selectors!.split(',').map((selector) => selector.trim()),
    text: declarations!,
  }));
}
const declared = (sheet: string, selector: string) =>
  rules_of(sheet)
    .filter(({ selectors }) => selectors.includes(selector))
    .map(({ text }) => text)
    .join('');

test('in a line that is cut off all text has the colour of the ground, and its list of alarms keeps its own', () => {
  for (const part of ['> .lamp', '> .other-tabs', 'button.plain'])
    expect(declared('status.css', `.status-strip.cut-off ${part}`)).toContain('color: var(--ground)');
  expect(declared('status.css', '#alarm-list')).toContain('color: var(--ink)');
  const reaching_in = rules_of('status.css').flatMap(({ selectors }) =>
    selectors.filter((selector) => /\.cut-off \.lamp/.test(selector)),
  );
  expect(reaching_in).toEqual([]);
});

test('who is in control is as high in one line of text as in two, so that what is held below it stays', () => {
  for (const sheet of ['controls.css', 'small_screens.css'])
    expect(declared(sheet, '.control-line > p:first-child')).toMatch(/min-height: \d+px/);
  expect(declared('controls.css', '.control-line p')).toContain('flex: 1 1 150px'); // beside its button, not above it
});

test('on a small desk what is said of the recording wraps, and a list of many robots gives way to it', () => {
  expect(declared('small_screens.css', '.recording-figures')).not.toContain('nowrap');
  expect(declared('small_screens.css', '.side .robot-list')).toContain('flex: 0 1000 auto');
});
