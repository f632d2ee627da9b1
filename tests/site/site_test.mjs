// The site that deploy/site makes: no link of it is dead, every document is reached from its first page, its search finds
// words, no request leaves its origin, and no page is wider than the window.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { dirname, extname, join, posix } from 'node:path';
import { fileURLToPath } from 'node:url';

const root = join(dirname(fileURLToPath(import.meta.url)), '../..');
const { chromium } = createRequire(join(root, 'web/package.json'))('playwright-core');
const kBase = '/docs-of-rheonaut/'; // not at the root of its server: so links that forget it are found
const kTypes = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml', '.webp': 'image/webp' };

const pages_of = (site) => readdirSync(site, { recursive: true }).filter((name) => name.endsWith('.html') && name !== '404.html');

// What a page points to, as paths in the site: [path, anchor]; and the addresses of its pictures, scripts and styles.
function targets_of(html, page) {
  const found = [];
  for (const [, , address] of html.matchAll(/<(?:a|link|script|img)\b[^>]*?\b(href|src)="([^"]+)"/g)) {
    if (/^(\w+:|\/\/)/.test(address)) continue;
    const [path, anchor = ''] = address.replaceAll('&amp;', '&').split('#');
    if (path.startsWith('/')) assert.ok(path.startsWith(kBase), `${page}: ${address} leaves the site`);
    const inside = path.startsWith('/') ? path.slice(kBase.length) : path && posix.join(posix.dirname(page), path);
    found.push([path ? inside.replace(/(^|\/)$/, '$1index.html') : page, decodeURIComponent(anchor)]);
  }
  return found;
}

function follow_links(site) {
  const html = new Map(pages_of(site).map((page) => [page, readFileSync(join(site, page), 'utf8')]));
  const reached = new Set(['index.html']);
  for (const page of reached) { // grows while it is walked
    for (const [path, anchor] of targets_of(html.get(page), page)) {
      assert.ok(existsSync(join(site, path)), `${page}: the link to ${path} leads nowhere`);
      if (!html.has(path)) continue;
      reached.add(path);
      if (anchor) assert.ok(html.get(path).includes(`id="${anchor}"`), `${page}: ${path} has no #${anchor}`);
    }
  }
  const documents = readdirSync(join(root, 'docs'), { recursive: true }).filter((name) => name.endsWith('.md'));
  assert.ok(html.size > documents.length, `${html.size} pages of ${documents.length} documents and those above them`);
  assert.deepEqual([...html.keys()].filter((page) => !reached.has(page)), [], 'every page is reached from the first one');
  return html.size;
}

function serve(site) {
  const server = createServer((request, response) => {
    const path = new URL(request.url, 'http://here').pathname;
    const file = join(site, path.slice(kBase.length).replace(/(^|\/)$/, '$1index.html'));
    const is_there = path.startsWith(kBase) && existsSync(file) && statSync(file).isFile();
    response.writeHead(is_there ? 200 : 404, { 'content-type': kTypes[extname(file)] ?? 'application/octet-stream' });
    response.end(is_there ? readFileSync(file) : 'not here');
  });
  return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server)));
}

async function look(origin) {
  const browser = await chromium.launch({
    executablePath: process.env.RHEONAUT_CHROMIUM ?? '/usr/bin/chromium',
    args: ['--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage'],
  });
  try {
    const page = await browser.newPage();
    const elsewhere = [], failed = [], wrong = [];
    page.on('request', (request) => /^(data|blob):/.test(request.url()) || request.url().startsWith(origin) || elsewhere.push(request.url()));
    page.on('response', (response) => response.status() < 400 || failed.push(response.url()));
    page.on('pageerror', (error) => wrong.push(String(error)));
    for (const [width, height] of [[1440, 900], [390, 844]]) {
      await page.setViewportSize({ width, height });
      for (const path of ['', 'docs/concepts.html', 'docs/troubleshooting.html', 'docs/first_robot.html', 'docs/hardware.html', 'ARCHITECTURE.html']) {
        await page.goto(`${origin}${kBase}${path}`);
        await page.locator('.vp-doc h1').waitFor();
        const wide = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(wide <= width, `${path} is ${wide} pixels wide in a window of ${width}`);
        if (process.env.SITE_PICTURES) {
          for (const colorScheme of ['light', 'dark']) {
            await page.emulateMedia({ colorScheme });
            await page.screenshot({ path: join(process.env.SITE_PICTURES, `${path.replaceAll('/', '_') || 'index'}_${width}_${colorScheme}.png`) });
          }
        }
      }
    }
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.goto(`${origin}${kBase}`);
    await page.locator('.VPNavBarSearch button').first().click();
    await page.locator('.search-input').fill('iso-damping');
    const result = page.locator('.results a', { hasText: 'Glossary' }).first();
    await result.waitFor();
    await result.click();
    await page.locator('.vp-doc td', { hasText: 'a phase of the open loop that is flat at the crossover' }).waitFor();
    assert.deepEqual({ elsewhere, failed, wrong }, { elsewhere: [], failed: [], wrong: [] });
  } finally {
    await browser.close();
  }
}

const folder = mkdtempSync(join(tmpdir(), 'rheonaut-site-'));
try {
  const site = join(folder, 'site');
  const made = spawnSync(join(root, 'deploy/site'), [site, kBase], { encoding: 'utf8' });
  assert.equal(made.status, 0, made.stdout + made.stderr);
  console.log(`${follow_links(site)} pages, all reached, no dead link`);
  const server = await serve(site);
  try {
    await look(`http://127.0.0.1:${server.address().port}`);
  } finally {
    server.closeAllConnections();
    server.close();
  }
  console.log('its search finds a word, and no request leaves its origin');
} finally {
  rmSync(folder, { recursive: true, force: true });
}
