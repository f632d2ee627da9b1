// The real programs that the browser test drives: station, simulated robot and Chromium, each ended by its own id.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { mkdirSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { setTimeout as delay } from 'node:timers/promises';

export const bin = process.env.RHEONAUT_BIN ?? new URL('../../build/dev/bin', import.meta.url).pathname;
const kFleetConfig = new URL('../../deploy/fleet.toml', import.meta.url).pathname; // a whole fleet may enrol itself
const { chromium } = createRequire(new URL('../../web/package.json', import.meta.url))('playwright-core');

const kChromium = {
  executablePath: process.env.RHEONAUT_CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage', '--disable-background-networking',
         '--disable-component-update', '--disable-sync', '--no-first-run'],
};

// Ends a wait for what never comes. It judges no time limit: a busy machine may take many seconds over what the product
// does in milliseconds.
const kLongestWait_ms = 60_000;

// Waits until probe() gives something true, and returns that; fails with `what` after a bound.
export async function until(what, probe, bound_ms = kLongestWait_ms) {
  const end_ms = performance.now() + bound_ms;
  for (;;) {
    const found = await probe();
    if (found) return found;
    if (performance.now() > end_ms) throw new Error(`not within ${bound_ms} ms: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

// What a file says; null when it is not there yet, or not written to its end.
export function read_json(file) {
  try {
    return JSON.parse(readFileSync(file, 'utf8'));
  } catch (error) {
    if (error.code === 'ENOENT' || error instanceof SyntaxError) return null;
    throw error;
  }
}

// Holds the button that clears the latch until the robot is in manual. A browser that draws without a graphics card may
// stand still for so long that what it shows is no longer current; then the hold ends, as it must, and is begun again.
export async function clear_latch(page) {
  const button = page.locator('#clear-emergency');
  const is_manual = async () => (await page.locator('.annunciator').getAttribute('data-mode')) === 'manual';
  await page.locator('#latch').waitFor();
  await until('the latch is cleared', async () => {
    if (await is_manual()) return true;
    if ((await button.count()) === 0 || !(await button.isEnabled())) return false;
    await button.hover();
    await page.mouse.down();
    await until('manual', is_manual, 3000).catch(() => undefined);
    await page.mouse.up();
    return is_manual();
  });
}

// How much of the estimate's trace, the brightest colour of the dark page, is in a share of the first strip.
export const trace_pixels = (page, from, to) =>
  page.evaluate(
    ([from, to]) => {
      const canvas = document.querySelector('.strip-0 canvas');
      const ratio = devicePixelRatio;
      const [left, width] = [58 * ratio, canvas.width - 76 * ratio];
      const x = Math.round(left + from * width);
      const image = canvas.getContext('2d').getImageData(x, 20 * ratio, Math.max(1, Math.round((to - from) * width)), canvas.height - 60 * ratio);
      let bright = 0;
      for (let at = 0; at < image.data.length; at += 4) if (image.data[at] > 225 && image.data[at + 1] > 225 && image.data[at + 3] > 200) bright += 1;
      return bright;
    },
    [from, to],
  );

const kLongestEnd_ms = 30_000;

class Program {
  output = '';

  constructor(name, ...args) {
    this.name = name;
    this.process = spawn(join(bin, name), args, { stdio: ['pipe', 'pipe', 'pipe'] });
    this.process.on('error', (error) => (this.output += `${error}\n`));
    for (const stream of [this.process.stdout, this.process.stderr]) stream.on('data', (text) => (this.output += text));
  }
  get runs() {
    return this.process.exitCode === null && this.process.signalCode === null;
  }
  say(line) {
    this.process.stdin.write(`${line}\n`);
  }
  async end(signal = 'SIGTERM') {
    if (!this.runs) return;
    const ended = once(this.process, 'exit');
    this.process.kill('SIGCONT'); // one that a failed test has stopped ends as well; after the end it would stall LeakSanitizer
    this.process.kill(signal);
    const late = setTimeout(() => this.process.kill('SIGKILL'), kLongestEnd_ms);
    await ended;
    clearTimeout(late);
    if (this.process.signalCode === 'SIGKILL' && signal !== 'SIGKILL') {
      throw new Error(`${this.name} did not end within ${kLongestEnd_ms} ms of ${signal}:\n${this.output.slice(-4000)}`);
    }
  }
}

// A folder for one station; the station can be killed and started again on the same ports.
export class Bench {
  data = mkdtempSync(join(tmpdir(), 'rheonaut-browser-'));
  endpoints = null;
  station = null;
  robot = null;
  fleet = null;
  proxy = null;
  browser = null;

  async start_station() {
    const { http = '127.0.0.1:0', robots = '127.0.0.1:0' } = this.endpoints ?? {};
    const file = join(this.data, 'endpoints.json');
    this.station = new Program('rheonaut', 'serve', '--data', this.data, '--http', http, '--robots', robots,
                               '--config', kFleetConfig);
    const pid = this.station.process.pid;
    this.endpoints = await until('the station announces its endpoints', () => {
      if (!this.station.runs) throw new Error('the station ended');
      const said = read_json(file);
      return said?.pid === pid ? said : null;
    });
  }

  login_link() {
    return until('the login link is printed', () => /https?:\/\/\S+\/login\?code=\S+/.exec(this.station.output)?.[0]);
  }

  start_robot(id, ...options) {
    this.robot = new Program('rheonaut-sim', '--station', this.endpoints.robots, '--id', id, ...options);
  }

  // Robots ID-1 to ID-SIZE in one process.
  start_fleet(id, size) {
    this.fleet = new Program('rheonaut-sim', '--station', this.endpoints.robots, '--id', id, '--robots', String(size));
  }

  // A robot whose samples were recorded, `rate` times as fast: ID without its number, which is 1.
  start_replay(id, rate) {
    this.fleet = new Program('rheonaut-sim', 'replay', '--station', this.endpoints.robots, '--robots', '1',
                             '--id', id.replace(/-1$/, ''), '--rate', String(rate));
  }

  // The network between a page and the station: `rheonaut-sim proxy`, and the words it is told.
  async start_proxy() {
    this.proxy = new Program('rheonaut-sim', 'proxy', '--to', this.endpoints.http);
    const address = await until('the proxy listens', () => /listening on (\S+)/.exec(this.proxy.output)?.[1]);
    return `http://${address}`;
  }

  // One `rheonaut` command about this station, and what it reads.
  async cli(args, input = '') {
    const tool = spawn(join(bin, 'rheonaut'), [...args, '--data', this.data], { stdio: ['pipe', 'ignore', 'inherit'] });
    tool.stdin.end(`${input}\n`);
    const [code] = await once(tool, 'exit');
    if (code !== 0) throw new Error(`rheonaut ${args.join(' ')}: exit status ${code}`);
  }

  // Another page, of a browser of its own as far as cookies go.
  async open_page(options) {
    const context = await this.browser.newContext(options);
    context.setDefaultTimeout(kLongestWait_ms);
    return context.newPage();
  }

  async open_browser(options) {
    this.browser = await chromium.launch(kChromium);
    return this.open_page(options);
  }

  get http() {
    return `http://${this.endpoints.http}`;
  }

  // Asks the station as a script does, to see what the page does not say.
  async ask(path) {
    const token = readFileSync(join(this.data, 'rheonaut.token'), 'utf8').trim();
    const answer = await fetch(`${this.http}/api/v1${path}`, { headers: { Authorization: `Bearer ${token}` } });
    return answer.json();
  }

  // The same for what changes something: its status and its answer.
  async post(path, body) {
    const token = readFileSync(join(this.data, 'rheonaut.token'), 'utf8').trim();
    const headers = { Authorization: `Bearer ${token}`, 'Content-Type': 'application/json' };
    const answer = await fetch(`${this.http}/api/v1${path}`, { method: 'POST', headers, body: JSON.stringify(body) });
    return { status: answer.status, answer: await answer.json() };
  }

  async close() {
    // Chromium may never answer that it is closed; it ends with this program.
    const closed = this.browser?.close().then(() => true, () => true);
    if (closed && !(await Promise.race([closed, delay(kLongestEnd_ms, false)]))) console.error('the browser did not close');
    await this.proxy?.end();
    await this.robot?.end();
    await this.fleet?.end();
    await this.station?.end();
    rmSync(this.data, { recursive: true, force: true });
  }
}

// Runs the steps in order, in a browser that `open` opens, and ends this program: 1 when one of them failed.
export async function run(bench, steps, open) {
  let failed = false;
  try {
    await bench.start_station();
    await open();
    for (const [name, step] of Object.entries(steps)) {
      const start_ms = performance.now();
      await step();
      console.log(`ok  ${name} (${Math.round(performance.now() - start_ms)} ms)`);
    }
  } catch (error) {
    failed = true;
    console.error(error);
    const out = new URL('out/', import.meta.url).pathname;
    mkdirSync(out, { recursive: true });
    const pages = bench.browser?.contexts().flatMap((context) => context.pages()) ?? [];
    for (const [number, page] of pages.entries()) {
      await page.screenshot({ path: `${out}failed_${number}.png` }).catch(() => undefined);
    }
    console.error(`station:\n${bench.station?.output}\nrobot:\n${bench.robot?.output}\nfleet:\n${bench.fleet?.output}`);
  } finally {
    await bench.close();
  }
  process.exit(failed ? 1 : 0);
}
