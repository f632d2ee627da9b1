// Tells stories of the page, each with a station and robots of its own, in one Chromium.
//
//   stories.mjs [--at-once N] [--pictures FOLDER] [NAME...]
//
// NAME is that of a file NAME_test.mjs beside this one, which exports `story`: its bench, its steps in order, and what
// opens its first page. All are told if none is named. A story that fails leaves pictures of its pages in out/ and what its
// programs have said, and the next one begins; the exit status is 1 then.
import { mkdirSync, readdirSync } from 'node:fs';
import { parseArgs } from 'node:util';
import { close_chromium, open_chromium } from './programs.mjs';

const folder = new URL('.', import.meta.url);
const out = new URL('out/', import.meta.url).pathname;
const { values: options, positionals } = parseArgs({
  allowPositionals: true,
  options: { 'at-once': { type: 'string', default: '1' }, pictures: { type: 'string' } }, // stories read --pictures themselves
});
const all = readdirSync(folder).flatMap((file) => /^(\w+)_test\.mjs$/.exec(file)?.[1] ?? []).filter((name) => name !== 'programs');
const names = positionals.length > 0 ? positionals : all;
const failed = new Set();
const since = (start_ms) => Math.round(performance.now() - start_ms);

let chromium = null;
async function shared_browser() {
  if (!chromium?.isConnected()) chromium = await open_chromium(); // also after one that has crashed under a story
  return chromium;
}

async function report(name, bench, error) {
  console.error(`${name} failed:`, error);
  mkdirSync(out, { recursive: true });
  for (const [number, page] of (bench?.pages ?? []).entries()) {
    await page.screenshot({ path: `${out}failed_${name}_${number}.png`, timeout: 20_000 }).catch(() => undefined);
    const said = await page.locator('[role=alert]').allInnerTexts().catch(() => []);
    console.error(`${name}, page ${number} at ${page.url()} says: ${said.filter((text) => text !== '').join(' | ') || 'nothing'}`);
  }
  console.error(`${name}, station:\n${bench?.station?.output}\nrobot:\n${bench?.robot?.output}\nfleet:\n${bench?.fleet?.output}`);
}

async function tell(name) {
  const start_ms = performance.now();
  let bench = null;
  try {
    const { story } = await import(new URL(`${name}_test.mjs`, folder));
    bench = story.bench;
    bench.browser = await shared_browser();
    await bench.start_station();
    await story.open?.();
    for (const [title, step] of Object.entries(story.steps)) {
      const begun_ms = performance.now();
      await step();
      console.log(`ok  ${name}: ${title} (${since(begun_ms)} ms)`);
    }
  } catch (error) {
    failed.add(name);
    await report(name, bench, error);
  }
  await bench?.close().catch((error) => {
    failed.add(name);
    console.error(`${name} did not end:`, error);
  });
  console.log(`${failed.has(name) ? 'FAILED' : '=='}  ${name} (${since(start_ms)} ms)`);
}

process.on('unhandledRejection', (error) => {
  failed.add('a promise that nobody waited for');
  console.error(error);
});

const waiting = [...names];
const start_ms = performance.now();
async function tell_next() {
  for (let name = waiting.shift(); name; name = waiting.shift()) await tell(name);
}
await Promise.all(Array.from({ length: Number(options['at-once']) }, tell_next));
if (chromium) await close_chromium(chromium);
console.log(`${names.length} stories in ${since(start_ms)} ms; failed: ${[...failed].join(', ') || 'none'}`);
process.exit(failed.size > 0 ? 1 : 0);
