// The real programs that a story of the page drives: station, simulated robot and Chromium, each ended by its own id.
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { setTimeout as delay } from 'node:timers/promises';
import { feel_clicks } from './felt_clicks.mjs';

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
export const kLongestWait_ms = 120_000;

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

export const open_chromium = () => chromium.launch(kChromium);

// Chromium may never answer that it is closed; it ends with this program.
export async function close_chromium(browser) {
  const closed = browser.close().then(() => true, () => true);
  if (!(await Promise.race([closed, delay(kLongestEnd_ms, false, { ref: false })]))) console.error('the browser did not close');
}

// A folder for one station; the station can be killed and started again on the same ports. Its pages are in a Chromium
// that is given to it, which others may use as well, or in one of its own.
export class Bench {
  data = null;
  endpoints = null;
  station = null;
  robot = null;
  fleet = null;
  proxy = null;
  browser = null;
  has_own_browser = false;
  contexts = [];

  async start_station() {
    this.data ??= mkdtempSync(join(tmpdir(), 'rheonaut-browser-'));
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

  async sign_in(page, link = null) {
    await page.goto(link ?? (await this.login_link()));
    await page.click('#use-link');
    await page.waitForURL((url) => url.pathname === '/');
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
    this.contexts.push(context);
    context.setDefaultTimeout(kLongestWait_ms);
    const page = await context.newPage();
    await feel_clicks(context, page);
    return page;
  }

  async open_browser(options) {
    this.browser = await open_chromium();
    this.has_own_browser = true;
    return this.open_page(options);
  }

  get pages() {
    return this.contexts.flatMap((context) => context.pages());
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
    if (this.has_own_browser) await close_chromium(this.browser);
    else await Promise.race([Promise.allSettled(this.contexts.map((context) => context.close())), delay(kLongestEnd_ms)]);
    await Promise.all([this.proxy?.end(), this.robot?.end(), this.fleet?.end()]);
    await this.station?.end();
    if (this.data) rmSync(this.data, { recursive: true, force: true });
  }
}
