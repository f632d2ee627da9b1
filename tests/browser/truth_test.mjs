// What the page shows is true: where a robot is that a disturbance moves, what is known while the station is silent, a
// run that was interrupted, an emergency in a tab that nobody looks at, and plots that never cover a control.
import assert from 'node:assert/strict';
import { clear_latch, commanded, drawn, in_auto, live as fresh, samples, seen_mode, shows, take_control } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const bench = new Bench();
let page;

const text = (selector) => page.locator(selector).first().innerText();
const number = async (name) => Number((await text(`#numeral-${name} output`)).replace('\u2212', '-'));
const robot = () => bench.ask(`/robots/${kRobot}`);
const live = async () => {
  await page.locator('.top-bar .lamp.good').waitFor();
  await fresh(page);
};
const phase = () => page.locator('#stop-line').getAttribute('data-phase');

async function start_run(name) {
  await page.fill('#run-name', name);
  await page.click('#start-run');
  await page.locator('#end-run').waitFor();
}

const steps = {
  async 'with a disturbance the page shows where the robot is, and what its controller sees'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live();
    await until('the robot is at 100 mm', async () => {
      await in_auto(bench, kRobot, 0.1);
      return Math.abs((await number('position')) - 100) < 2;
    });
    await shows(page, '#disturbance', 'disturbance 0.0 mm');
    await page.locator('#numeral-seen output').waitFor();
    const both = await page.locator('#numeral-position output').evaluate((position) => [document.querySelector('#numeral-seen output').textContent, position.textContent]);
    assert.equal(both[0], both[1], 'without a disturbance it sees where it is');
    await commanded(bench, kRobot, { kind: 'inject_disturbance', disturbance_m: -0.05 });
    await until('the robot stays at 150 mm', async () => {
      await in_auto(bench, kRobot, 0.1);
      const now = await robot();
      return Math.abs(now.sample.position_m - now.disturbance_m - 0.15) < 0.001 && Math.abs(now.sample.velocity_m_s) < 0.001;
    });
    await until('the page shows it there', async () => Math.abs((await number('position')) - 150) < 2);
    await until('and at 100 mm for its controller', async () => Math.abs((await number('seen')) - 100) < 2);
    await until('with the setpoint', async () => (await number('setpoint')) === 100);
    await shows(page, '#disturbance', 'disturbance \u221250.0 mm');
    await until('off by what is true', async () => /off by (4[89]|5[01])\.\d/.test(await text('#numeral-position .foot')));
    await until('off by nearly nothing', async () => /off by \u2212?[01]\.\d/.test(await text('#numeral-seen .foot')));
  },

  async 'wherever a position is shown it carries its ±'() {
    const { position_sd_m } = await robot();
    assert.ok(position_sd_m > 0);
    await shows(page, '#numeral-position .foot', /± \d+\.\d mm \(2 sd\), off by .*\smodel assumed/);
    await shows(page, '#numeral-seen .foot', /± \d+\.\d/);
    await shows(page, '.robot-entry .figure', /^1[45]\d\.\d ± \d+\.\d mm$/);
    await until('what it shows is two standard deviations', async () => {
      const shown_mm = Number(/± (\d+\.\d)/.exec(await text('#numeral-position .foot'))[1]);
      return Math.abs(shown_mm - 2000 * (await robot()).position_sd_m) < 0.3; // both change with time
    });
    for (const line of await page.locator('.log-strip .text').allInnerTexts()) {
      if (/ at .* mm/.test(line)) assert.match(line, /± (\d+\.\d mm|not known)/, line); // of an event that no samples surround
    }
    await samples(bench, kRobot, 200); // with the disturbance
    const plot = await page.locator('.strip-0 .plot').boundingBox();
    await page.mouse.move(plot.x + plot.width - 30, plot.y + plot.height / 2);
    await shows(page, '.strip-0 .cursor', /^1\d\d\.\d ± \d+\.\d, seen \d+\.\d, mm at/);
    await page.mouse.move(5, 5);
  },

  async 'nothing claims control or a recording while the page is cut off'() {
    await take_control(page, async () => (await text('#control-line')).includes('You are in control'));
    await start_run('cut off');
    await page.locator('.recording-lamp').waitFor();
    bench.station.process.kill('SIGSTOP');
    await until('the claims are gone', async () => (await page.locator('.recording-lamp').count()) === 0);
    const shown = await page.locator('body').innerText();
    assert.doesNotMatch(shown, /You are in control|is in control|Nobody is in control/);
    assert.doesNotMatch(shown, /“cut off”/, 'no run is said to be open');
    assert.equal(await page.locator('#control-line').getAttribute('data-holder'), '');
    await page.locator('#run-unknown').waitFor();
    assert.equal(await page.locator('.control.run.engaged').count(), 0);
    await until('its lamp is out', async () => (await page.locator('.robot-entry .dot.good').count()) === 0);
  },

  async 'a stop that may not have arrived is said for as long as the page is cut off'() {
    await page.keyboard.press('Escape');
    const started_ms = performance.now();
    await until('it says so', async () => /may not have arrived/.test(await text('#stop-line')));
    await until('both ways have failed', async () => (await phase()) === 'failed');
    while (performance.now() - started_ms < 9000) {
      assert.match(await text('#stop-line'), /may not have arrived/);
      await page.waitForTimeout(250);
    }
  },

  async 'and goes when telemetry shows the latch'() {
    bench.station.process.kill('SIGCONT');
    // By telemetry, or by the answer of the press, which the page sends again.
    await until('the page sees the latch', async () => ['seen', 'stopped'].includes(await phase()));
    await seen_mode(page, 'emergency'); // after the answer telemetry shows it
    await until('its motor is off', async () => (await robot()).sample.duty === 0);
    await live();
    await page.locator('.recording-lamp').waitFor(); // the run is open still
    await clear_latch(page);
    await until('the stop line is idle', async () => (await phase()) === 'idle');
    await page.click('#end-run');
  },

  async 'a run that was interrupted is told until it is dismissed'() {
    await start_run('doomed');
    await bench.station.end('SIGKILL');
    await bench.start_station();
    await live();
    const notice = page.locator('#interrupted-run');
    await notice.waitFor();
    assert.match(await notice.innerText(), /Run “doomed” was interrupted at \d\d:\d\d:\d\d/);
    await until('the log says it', async () => (await text('.log-strip ol')).includes('“doomed”'));
    await page.locator('.recording-lamp').waitFor({ state: 'detached' });
    await page.reload();
    await live();
    await notice.waitFor();
    await page.click('#dismiss-interrupted');
    await notice.waitFor({ state: 'detached' });
    await page.reload();
    await live();
    await page.locator('#start-run').waitFor();
    await until('the newest run was asked for', () => page.evaluate(() => performance.getEntriesByType('resource').some((each) => each.name.includes('limit=1'))));
    await drawn(page);
    assert.equal(await notice.count(), 0, 'it stays dismissed');
  },

  async 'or until a new one begins'() {
    await start_run('doomed as well');
    await bench.station.end('SIGKILL');
    await bench.start_station();
    await live();
    await page.locator('#interrupted-run').waitFor();
    await start_run('the next');
    await page.locator('#interrupted-run').waitFor({ state: 'detached' });
    await page.click('#end-run');
    await page.locator('#start-run').waitFor();
    assert.equal(await page.locator('#interrupted-run').count(), 0);
  },

  async 'an emergency in a tab in the background shows in its title and icon'() {
    const tab = () => page.evaluate(() => ({ title: document.title, icon: document.querySelector('link[rel=icon]').getAttribute('href') }));
    await until('neither says anything yet', async () => (await tab()).title === 'Rheonaut' && (await tab()).icon === '/favicon.svg');
    const other = await page.context().newPage();
    await other.bringToFront();
    await bench.post(`/robots/${kRobot}/emergency-stop`, undefined);
    await until('the title says it', async () => (await tab()).title === `EMERGENCY ${kRobot} · Rheonaut`);
    const icon = '/favicon_emergency.svg';
    await until('and the icon', async () => (await tab()).icon === icon);
    const answer = await fetch(bench.http + icon);
    assert.equal(answer.status, 200);
    assert.match(answer.headers.get('content-type'), /svg/);
    await other.close();
    await page.bringToFront();
    await clear_latch(page);
    await until('and takes it back', async () => (await tab()).title === 'Rheonaut');
  },

  async 'shrinking or turning the window never draws a plot over a control'() {
    const sizes = [[1440, 900], [1024, 768], [844, 390], [1440, 900], [390, 844], [844, 390], [1181, 640], [761, 701], [760, 1000], [1280, 500], [1000, 900]];
    for (const [width, height] of sizes) {
      await page.setViewportSize({ width, height });
      await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));
      const found = await page.evaluate(covered);
      assert.deepEqual(found, [], `at ${width} × ${height}`);
    }
    await page.setViewportSize({ width: 1440, height: 900 });
  },
};

// In the page: what lies where it must not. A control that is scrolled out of sight is covered by nothing.
function covered() {
  const faults = [];
  const areas = ['.top-bar', '.side', '.stop-panel', '.emergency-stop', '.controls', '.log-strip'];
  for (const control of document.querySelectorAll(areas.map((area) => `${area} :is(button, input, h2, legend, p, li)`).join())) {
    if (!control.checkVisibility()) continue;
    const { left, top, width, height } = control.getBoundingClientRect();
    for (const [x, y] of [[left + width / 2, top + height / 2], [left + 3, top + height / 2], [left + width - 3, top + height / 2]]) {
      const hit = document.elementFromPoint(x, y);
      if (hit?.closest('.plots, .readouts, .annunciator')) faults.push(`${control.id || control.textContent.slice(0, 20)} under ${hit.closest('section, div').className}`);
    }
  }
  for (const canvas of document.querySelectorAll('.plots canvas')) {
    const host = canvas.closest('.plot').getBoundingClientRect();
    const scope = document.querySelector('.scope').getBoundingClientRect();
    if (host.right > scope.right + 0.5 || host.left < scope.left - 0.5) faults.push(`a plot is ${host.width} px wide in ${scope.width}`);
  }
  const stop = document.querySelector('#emergency-stop').getBoundingClientRect();
  const hit = document.elementFromPoint(stop.left + stop.width / 2, stop.top + stop.height / 2);
  if (!hit?.closest('#emergency-stop')) faults.push('the stop is out of reach');
  if (document.documentElement.scrollWidth > innerWidth + 1) faults.push(`the page is ${document.documentElement.scrollWidth} px wide`);
  return faults;
}

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
};

export const story = { bench, steps, open: open_pages };
