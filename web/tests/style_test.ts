// Which classes a style sheet may style by themselves: those of one component, those that begin with the name of their view,
// and those that are listed here as shared. Another component's class of the same name gets these rules as well.
import { readdirSync, readFileSync } from 'node:fs';
import { expect, test } from 'vitest';

const kSources = new URL('../src/', import.meta.url);
const files = (folder: string, ending: string) =>
  (readdirSync(new URL(folder, kSources), { recursive: true }) as string[])
    .filter((name) => name.endsWith(ending))
    .map((name) => `${folder}${name}`);
const text_of = (file: string) => readFileSync(new URL(file, kSources), 'utf8');

// Used by several components on purpose. A component that is to look otherwise takes another name.
const kShared =
  `control cursor dot entry exposed facts field field-of figure figures files fleet-row free key lamp lamp-like
  log-strip outcome pair plot-tools plots presence problem quiet record recording-lamp run-name stale strip swatch table-box tick
  trace-choice track-legend unit unseen vessel view-body view-head waiting way-back wide-table`.split(/\s+/);
// Views whose classes begin with their name, and the folder of the view.
const kViews: Record<string, string> = { design: 'views/design/', run: 'views/runs/', station: 'views/station/' };

// The first class of each selector that has nothing before it.
function styled_alone(sheet: string): string[] {
  const rules = sheet.replace(/\/\*.*?\*\//gs, '').matchAll(/([^{}]+)\{/g);
  return [...rules]
    .flatMap(([, selectors]) => (selectors!.trim().startsWith('@') ? [] : selectors!.split(/,(?![^(]*\))/)))
    .flatMap((selector) => /^\s*\.([\w-]+)(?=$|[\s:>+~[])/.exec(selector)?.[1] ?? []);
}

// The words of every class attribute: in quotes, or in the strings of an expression.
function classes_of(source: string): string[] {
  const found: string[] = [];
  for (const { index, 0: before } of source.matchAll(/\bclass=(?=["{])/g)) {
    const rest = source.slice(index + before.length);
    const attribute = rest.startsWith('"') ? rest.slice(0, rest.indexOf('"', 1) + 1) : braces(rest);
    for (const [part] of attribute.matchAll(/'[^'\n]*'|"[^"\n]*"|`[^`]*`/g))
      found.push(...(strings_only(part).match(/[a-z][\w-]*/g) ?? []));
  }
  return found;
}

// Of a template: its own words, and the strings within ${…}.
const strings_only = (template: string) =>
  template.replace(/\$\{([^{}]*)\}/g, (_, inner: string) => ` ${(inner.match(/'[^']*'|"[^"]*"/g) ?? []).join(' ')} `);

function braces(text: string): string {
  let depth = 0;
  for (let at = 0; at < text.length; ++at) {
    if (text[at] === '{') depth += 1;
    if (text[at] === '}') depth -= 1;
    if (depth === 0) return text.slice(0, at + 1);
  }
  return text;
}

const users = new Map<string, Set<string>>();
for (const file of files('', '.tsx'))
  for (const name of classes_of(text_of(file))) users.set(name, (users.get(name) ?? new Set()).add(file));
const alone = new Map<string, Set<string>>();
for (const file of files('style/', '.css'))
  for (const name of styled_alone(text_of(file))) alone.set(name, (alone.get(name) ?? new Set()).add(file));

const is_of_view = (name: string, of: ReadonlySet<string>) => {
  const folder = kViews[name.split('-')[0]!];
  return folder !== undefined && name.includes('-') && [...of].every((file) => file.startsWith(folder));
};

test('what is read of sheets and components is what stands there', () => {
  expect(styled_alone('/* .a {} */ .b,\n.c .d:is(.e, .f) { } @media (x) { .g:hover { } p .h { } .i.j { } }')).toEqual([
    'b',
    'c',
    'g',
  ]);
  expect(classes_of('<p class="a b"><p class={`c ${x ? "h" : y} d`}><p class={is ? \'e\' : \'f g\'} id="i">')).toEqual(
    'abchdefg'.split(''),
  );
});

test('a class that a sheet styles by itself is of one component or of one view, or is listed as shared', () => {
  const collisions = [...alone]
    .filter(([name]) => !kShared.includes(name))
    .map(([name, sheets]) => ({ name, sheets, of: users.get(name) ?? new Set<string>() }))
    .filter(({ name, of }) => of.size > 1 && !is_of_view(name, of))
    .map(({ name, sheets, of }) => `.${name} of ${[...sheets].join(', ')} is used by ${[...of].join(', ')}`);
  expect(collisions).toEqual([]);
});

test('what is listed as shared is used by several components', () => {
  const needless = kShared.filter((name) => !alone.has(name) || (users.get(name)?.size ?? 0) < 2);
  expect(needless).toEqual([]);
});
