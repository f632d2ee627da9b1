// What a view owes to everybody who opens it: no violation of WCAG AA that axe-core finds, no horizontal scrolling.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { drawn } from './hands.mjs';
import { until } from './programs.mjs';

const axe_path = createRequire(new URL('../../web/package.json', import.meta.url)).resolve('axe-core/axe.min.js');
const axe_source = readFileSync(axe_path, 'utf8');
const kSizes = [[1440, 900], [1024, 768], [768, 1024], [390, 844], [844, 390]];
const kAll = { type: 'tag', values: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'] };
const kOfColours = { type: 'rule', values: ['color-contrast', 'link-in-text-block'] };

const both_at_widest = (width) => (width === 1440 ? ['light', 'dark'] : ['dark']);

// At each size, and in both themes at the widest one if nothing else is said. The page keeps the last size.
export async function assert_accessible(page, what, sizes = kSizes, themes_at = both_at_widest) {
  for (const [width, height] of sizes) {
    await page.setViewportSize({ width, height });
    await drawn(page);
    // Themes differ in colours alone, so what has nothing to do with colours is looked for in the first.
    for (const [number, colorScheme] of themes_at(width).entries()) {
      await page.emulateMedia({ colorScheme });
      const at = `${what} at ${width}x${height}, ${colorScheme}`;
      // Plots follow a moment later.
      await until(`${at}: nothing is wider than the page`, async () => (await page.evaluate(() => document.documentElement.scrollWidth)) <= width);
      assert.deepEqual(await violations(page, number === 0 ? kAll : kOfColours), [], at);
    }
  }
}

// The content security policy of the page forbids scripts from elsewhere; axe-core is evaluated by the browser's own hand.
async function violations(page, rules) {
  if (!(await page.evaluate(() => 'axe' in globalThis))) await page.evaluate(axe_source);
  const found = await page.evaluate(async (runOnly) => {
    const { violations: list } = await globalThis.axe.run(document, { runOnly });
    return list.map(({ id, help, nodes }) => ({ id, help, nodes: nodes.slice(0, 5).map(({ html, failureSummary }) => `${html.slice(0, 160)} ${failureSummary}`) }));
  }, rules);
  return found;
}
