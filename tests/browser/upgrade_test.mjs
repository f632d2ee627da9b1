// The page stays open while the station is replaced by one with another build of it: what runs goes on, the page says that
// it is older, and what is gone with its version is no broken page. Stop and Escape work all the time.
//
// The other build is this one under other names: a proxy in front of the station serves the files of the page from another
// folder, and nothing any more where they were.
import assert from 'node:assert/strict';
import { request as ask_http, createServer } from 'node:http';
import { connect } from 'node:net';
import { clear_by_script, drawn, hold_by_mouse, live as is_fresh, samples, shows } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'sim-1';
const bench = new Bench();
const faults = [];
let page, front, front_url;

const robot = () => bench.ask(`/robots/${kRobot}`);
const live = async () => {
  await page.locator('.top-bar .lamp.good').waitFor();
  await is_fresh(page);
};

// ---- the network in front of the station

let looks = 0; // of a page for what the station serves now
let build = ''; // the folder of the files of the page, below assets/; '': where they were built
const streams = new Set();

async function start_front() {
  front = createServer((asked, answer) => void pass(asked, answer).catch(() => answer.destroy()));
  front.on('upgrade', (asked, socket) => {
    const [host, port] = bench.endpoints.http.split(':');
    const to = connect(Number(port), host, () => {
      const headers = asked.rawHeaders.flatMap((each, at, all) => (at % 2 === 0 ? [`${each}: ${all[at + 1]}`] : []));
      to.write(`${asked.method} ${asked.url} HTTP/1.1\r\n${headers.join('\r\n')}\r\n\r\n`);
      to.pipe(socket).pipe(to);
    });
    for (const each of [to, socket]) {
      streams.add(each);
      each.on('error', () => undefined);
      each.on('close', () => (to.destroy(), socket.destroy(), streams.delete(each)));
    }
  });
  await new Promise((done) => front.listen(0, '127.0.0.1', done));
  front_url = `http://127.0.0.1:${front.address().port}`;
}

// What is of the page is renamed; all else passes as it is.
async function pass(asked, answer) {
  const [, file] = /^\/assets\/(.*)$/.exec(asked.url) ?? [];
  const is_gone = file !== undefined && !file.startsWith(build);
  if (is_gone) return void answer.writeHead(404).end();
  const path = file === undefined ? asked.url : `/assets/${file.slice(build.length)}`;
  if (asked.url === '/' && asked.headers['sec-fetch-dest'] === 'empty') ++looks;
  const is_page = file !== undefined || asked.url === '/';
  const headers = is_page ? { ...asked.headers, 'accept-encoding': 'identity' } : asked.headers;
  if (is_page) for (const each of ['if-none-match', 'if-modified-since']) delete headers[each];
  const [hostname, port] = bench.endpoints.http.split(':');
  const to = ask_http({ hostname, port, path, method: asked.method, headers }, (from) => {
    if (!is_page) return void from.pipe(answer.writeHead(from.statusCode, from.rawHeaders));
    const parts = [];
    from.on('data', (part) => parts.push(part));
    from.on('end', () => {
      const is_text = /javascript|html/.test(from.headers['content-type'] ?? '');
      const whole = Buffer.concat(parts);
      const body = is_text && build ? Buffer.from(whole.toString().replaceAll('assets/', `assets/${build}`)) : whole;
      const kept = { ...from.headers, 'content-length': body.length };
      for (const each of ['transfer-encoding', 'etag']) delete kept[each];
      answer.writeHead(from.statusCode, kept).end(body);
    });
  });
  to.on('error', () => answer.destroy());
  asked.pipe(to);
}

// The station ends, and one with that build begins on the same ports and data.
async function upgrade(to) {
  await bench.station.end();
  build = to;
  await bench.start_station();
}

// One press is one stop of the robot; then the latch is taken away again.
async function escape_stops(what) {
  await page.keyboard.press('Escape');
  await until(`Escape stops: ${what}`, async () => (await robot()).emergency_id !== null);
  await page.locator('#latch').waitFor();
  await clear_by_script(bench, kRobot);
  await bench.post(`/robots/${kRobot}/control`, { action: 'release' });
  await page.locator('#latch').waitFor({ state: 'detached' });
}

const steps = {
  async 'a page of the station’s own build says nothing, also after the station was started again'() {
    bench.start_robot(kRobot);
    await start_front();
    await bench.sign_in(page, (await bench.login_link()).replace(bench.http, front_url));
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live();
    await until('it has looked', () => looks > 0);
    const before = looks;
    await upgrade('');
    await until('it has looked again', () => looks > before);
    await live();
    await samples(bench, kRobot, 100);
    await drawn(page);
    assert.equal(await page.locator('#outdated').count(), 0);
  },

  async 'after an upgrade the page goes on and says that it is older; nothing that was typed is lost'() {
    await page.fill('#run-name', 'half a name');
    await page.evaluate(() => (window.loaded_once = true));
    await upgrade('second/');
    await page.locator('#outdated').waitFor();
    await shows(page, '#outdated', /The station has a newer version of this page/);
    await live();
    assert.equal(await page.inputValue('#run-name'), 'half a name');
    assert.ok(await page.evaluate(() => window.loaded_once), 'it was not loaded anew by itself');
    await escape_stops('on the older page');
  },

  async 'it drives, and does not load itself anew under the hand that holds a duty'() {
    await hold_by_mouse(page, async () => (await robot()).sample.duty > 0.1);
    await upgrade('third/');
    await until('the motor is off', async () => (await robot()).sample?.duty === 0);
    await page.locator('#outdated').waitFor();
    await live();
    assert.ok(await page.evaluate(() => window.loaded_once));
    await samples(bench, kRobot, 100, ({ sample }) => assert.equal(sample.duty, 0, 'what is still held moves nothing with another station'));
    await page.mouse.up();
  },

  async 'a view that was never opened is gone, the page says so, and the stop works there'() {
    await page.click('#open-station');
    await shows(page, '#not-loaded', /The station has a newer version of this page, and this view is gone/);
    await page.locator('.views #open-station[aria-current=page]').waitFor();
    await page.focus('#load-again');
    await escape_stops('in a view that is gone');
    await page.click('#open-robot');
    await live(); // what was loaded before is as it was
  },

  async 'a press loads the newer page, at the same address'() {
    await page.click('#open-station');
    await page.click('#load-again');
    await page.locator('#station-health').waitFor();
    assert.equal(await page.evaluate(() => window.loaded_once ?? false), false);
    assert.match(await page.evaluate(() => document.querySelector('script[type=module]').src), /\/assets\/third\//);
    assert.equal(await page.locator('#outdated').count(), 0);
    await page.click('#open-robot');
    await live();
  },

  async 'and so does the notice; a station that is put back is another build as well'() {
    await upgrade('');
    await page.locator('#outdated').waitFor();
    await page.click('#load-new-page');
    await page.locator('#outdated').waitFor({ state: 'detached' });
    await live();
    assert.doesNotMatch(await page.evaluate(() => document.querySelector('script[type=module]').src), /third/);
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
};

export const story = { bench, steps, open: open_pages };
