// What is the same in every view: addresses, the stop and what it says of its own way, the frame of a page that is cut
// off, every width, and accessibility by axe-core.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { count_running_time, drawn as drawn_on, running_time, shows } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'sim-1';
const kViews = ['fleet', 'robot', 'station'];
const kSizes = [[1440, 900], [1280, 800], [1024, 768], [768, 1024], [390, 844], [844, 390]];
const kAxe = readFileSync(new URL('../../web/node_modules/axe-core/axe.min.js', import.meta.url), 'utf8');
const bench = new Bench();
const faults = [];
let page;

const text = (selector) => page.locator(selector).first().innerText();
const works = () => page.locator('#emergency-stop').getAttribute('data-works');
const address = () => page.evaluate(() => location.hash);
const shown = {
  fleet: () => page.locator('#fleet-list li').first().waitFor(),
  robot: () => page.locator('.annunciator h1').getByText(kRobot).waitFor(),
  station: () => page.locator('#station-line-recording[data-word=good]').waitFor(),
};
const ready = () => until('a stop would work', async () => (await works()) === 'true');
const drawn = () => drawn_on(page);

// In the page: when the button was first seen not to work, by the page's own clock.
const note_when_hindered = () =>
  page.evaluate(() => {
    window.hindered_at_ms = null;
    const button = document.querySelector('#emergency-stop');
    new MutationObserver(() => {
      if (button.dataset.works === 'false') window.hindered_at_ms ??= performance.timeOrigin + performance.now();
    }).observe(button, { attributes: true });
  });
const hindered_at_ms = () => until('the button does not look as if it worked', () => page.evaluate(() => window.hindered_at_ms));

const steps = {
  async 'each view is reached by its link, its keys and its address, and "back" leads back'() {
    bench.start_robot(kRobot);
    await bench.sign_in(page);
    await shown.robot();
    await until('the robot stands in the address', async () => (await address()) === `#/robot/${kRobot}`);
    for (const view of kViews) {
      await page.click(`#open-${view}`);
      await shown[view]();
      await page.locator(`.views #open-${view}[aria-current=page]`).waitFor();
    }
    await page.goBack();
    await shown.robot();
    await page.goBack();
    await shown.fleet();
    for (const [key, view] of [['s', 'station'], ['r', 'robot'], ['f', 'fleet']]) {
      await page.keyboard.press('g');
      await page.keyboard.press(key);
      await shown[view]();
    }
    await page.fill('#fleet-search', 'gs');
    await until('letters in a field are text', async () => (await address()) === '#/fleet?search=gs');
    await page.locator('#none-listed').waitFor();
    await page.reload();
    await page.locator('#none-listed').waitFor();
    assert.equal(await page.inputValue('#fleet-search'), 'gs', 'an address leads back to what was looked at');
    await page.click('#none-listed button');
    await page.click(`#fleet-list li[data-robot="${kRobot}"] a`);
    await shown.robot();
  },

  async 'an address of nothing, and of no robot, says so'() {
    await page.goto(`${bench.http}/#/nowhere`);
    await page.locator('#no-such-view').waitFor();
    await page.locator('#no-such-view a').first().click();
    await shown.fleet();
    await page.goto(`${bench.http}/#/robot/nobody`);
    await page.getByText('The station knows no robot “nobody”').waitFor();
    await shows(page, '#emergency-stop .whom', /stops sim-1/); // it keeps its robot
    await page.click('#open-robot');
    await shown.robot();
  },

  async 'the stop shows how long its way is'() {
    await ready();
    await until('both parts are measured', async () => /^path \d+(\.\d)? ms$/.test(await text('#stop-path')));
    await until('and the status line the ways and the age', async () =>
      /ms$/.test(await text('#page-round-trip')) && /ms$/.test(await text('#robot-round-trip')) && /ms old$/.test(await text('#seen-age')));
    await page.click('#show-stop-note');
    assert.match(await text('#stop-note'), /does not replace a device that cuts the power/);
    await page.click('#show-stop-note');
  },

  async 'a station that stands still is shown in time, on every view, and so is that it goes on'() {
    for (const view of kViews) {
      await page.click(`#open-${view}`);
      await shown[view]();
      await ready();
      await note_when_hindered();
      await count_running_time(page);
      const stopped_at_ms = Date.now();
      bench.station.process.kill('SIGSTOP');
      const seen_at_ms = await hindered_at_ms();
      const after_ms = await until('the page has counted that far', async () => {
        const { counted_ms, ran_ms: ran } = await running_time(page, stopped_at_ms, seen_at_ms);
        return counted_ms >= seen_at_ms && ran;
      });
      console.log(`    ${view}: ${Math.round(after_ms)} ms after SIGSTOP, ${Math.round(seen_at_ms - stopped_at_ms)} ms by the clock`);
      assert.match(await text('#stop-path'), /^will be sent when the station (answers|is reached)$/); // which is noticed first
      assert.ok(await page.locator('#emergency-stop').isEnabled(), 'it can be pressed');
      // The limit is the page's: the time in which the machine did not run it does not count.
      assert.ok(after_ms < 1000, `${after_ms} ms`);
      bench.station.process.kill('SIGCONT');
      await ready();
    }
  },

  async 'a robot that stands still is shown, and its return'() {
    await page.click('#open-robot');
    await ready();
    bench.robot.process.kill('SIGSTOP');
    await until('the button says so', async () => /will be sent when sim-1/.test(await text('#stop-path')));
    await until('it does not look as if it worked', async () => (await works()) === 'false');
    bench.robot.process.kill('SIGCONT');
    await ready();
  },

  async 'a killed station is a frame around the page, on every view, and it heals by itself'() {
    await page.click('#open-fleet');
    await shown.fleet();
    await bench.station.end('SIGKILL');
    for (const view of kViews) {
      await page.click(`#open-${view}`);
      await page.locator('#cut-off-frame').waitFor();
      await shows(page, '#status', /Cut off from the station\s+since \d\d:\d\d:\d\d/);
      await until('the button does not look as if it worked', async () => (await works()) === 'false');
    }
    await until('the title says it', async () => (await page.title()) === 'Cut off · Rheonaut');
    await page.click('#open-robot');
    await page.keyboard.press('Escape'); // kept by the page
    await until('it is kept', async () => /goes again by itself/.test(await text('#stop-line')));
    await bench.start_station();
    await page.locator('#cut-off-frame').waitFor({ state: 'detached' });
    await until('what was pressed has stopped the robot', async () => (await bench.ask(`/robots/${kRobot}`)).emergency_id !== null);
    await ready();
    await page.locator('#latch').waitFor();
    await shows(page, '#clear-emergency', /^Hold 1 s to clear: operator, (before )?\d\d:\d\d:\d\d$/);
  },

  async 'a view that cannot be loaded comes by itself when the station is back'() {
    const other = await page.context().newPage();
    await other.goto(`${bench.http}/#/robot/${kRobot}`);
    await other.locator('.annunciator h1').waitFor();
    await other.locator('.log-strip').getByText('emergency stop').first().waitFor(); // of before it was opened
    await until('two tabs know of each other', async () => (await other.locator('#other-tabs').count()) === 1);
    await bench.station.end('SIGKILL');
    await other.locator('#cut-off-frame').waitFor();
    await other.click('#show-alarms');
    for (const colorScheme of ['light', 'dark']) {
      await other.emulateMedia({ colorScheme });
      await other.evaluate(kAxe);
      const { violations } = await other.evaluate(() => window.axe.run('#status', { runOnly: ['color-contrast'] }));
      assert.deepEqual(violations.flatMap(({ nodes }) => nodes.map(({ html }) => html)), [], `cut off, ${colorScheme}`);
    }
    await other.route('**/*.js', (asked) => asked.abort()); // the browser may have kept the file of the view
    await other.click('#open-fleet');
    await other.locator('#not-loaded').waitFor();
    assert.match(await other.locator('#not-loaded').innerText(), /tried again each second/);
    await bench.start_station();
    await other.unroute('**/*.js');
    await other.locator('#fleet-list li').first().waitFor();
    await until('two tabs know of each other', async () => (await other.locator('#other-tabs').count()) === 1);
    await other.close();
  },

  async 'at every width the stop, the status and the alarms are in reach, and nothing is wider than the page'() {
    for (const view of kViews) {
      await page.click(`#open-${view}`);
      await shown[view]();
      for (const [width, height] of kSizes) {
        await page.setViewportSize({ width, height });
        await drawn();
        const look = () => page.evaluate(() => {
          const reached = (selector) => {
            const element = document.querySelector(selector); // null for a moment when the station was silent
            if (element === null) return false;
            const { left, top, width, height } = element.getBoundingClientRect();
            return Boolean(document.elementFromPoint(left + width / 2, top + height / 2)?.closest(selector));
          };
          return {
            wide: document.documentElement.scrollWidth - innerWidth,
            out_of_reach: ['#emergency-stop', '#stop-all', '#show-alarms', '#seen-age'].filter((each) => !reached(each)),
          };
        });
        await until(`nothing is out of reach in ${view} at ${width} × ${height}`, async () => {
          const { wide, out_of_reach } = await look();
          return wide <= 0 && out_of_reach.length === 0;
        });
      }
      await page.setViewportSize({ width: 1440, height: 900 });
    }
  },

  async 'on a phone whatever Tab leads to is in sight, forward and back'() {
    await page.setViewportSize({ width: 390, height: 844 });
    for (const view of kViews) {
      await page.click(`#open-${view}`);
      await shown[view]();
      await page.evaluate(() => document.activeElement.blur());
      const hidden = [];
      let reached = 0;
      for (const key of [...Array(60).fill('Tab'), ...Array(60).fill('Shift+Tab')]) {
        await page.keyboard.press(key);
        const found = await page.evaluate(() => {
          const focused = document.activeElement;
          const { left, top, width, height } = focused.getBoundingClientRect();
          const middle = (from, size, end) => Math.min(end - 1, Math.max(0, from + size / 2));
          const over = document.elementFromPoint(middle(left, width, innerWidth), middle(top, height, innerHeight));
          const is_seen = !over || focused.contains(over) || over.contains(focused);
          return { is_body: focused === document.body, under: is_seen ? '' : `${focused.outerHTML.slice(0, 80)} under ${over.outerHTML.slice(0, 80)}` };
        });
        if (!found.is_body) reached += 1;
        if (found.under !== '') hidden.push(found.under);
      }
      assert.ok(reached > 20, `${view}: ${reached}`);
      assert.deepEqual(hidden, [], view);
    }
    await page.setViewportSize({ width: 1440, height: 900 });
  },

  async 'axe finds nothing, in light and in dark'() {
    for (const view of kViews) {
      await page.click(`#open-${view}`);
      await shown[view]();
      for (const colorScheme of ['dark', 'light']) {
        await page.emulateMedia({ colorScheme });
        for (const [width, height] of [[1440, 900], [390, 844]]) {
          await page.setViewportSize({ width, height });
          await drawn();
          await page.evaluate(kAxe);
          const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
          const found = violations.map(({ id, nodes }) => `${id}: ${nodes.slice(0, 4).map((node) => `${node.html.slice(0, 110)} ${node.any[0]?.message ?? ''}`).join(' | ')}`);
          assert.deepEqual(found, [], `${view}, ${colorScheme}, ${width} × ${height}`);
        }
      }
      await page.setViewportSize({ width: 1440, height: 900 });
    }
  },

  async 'the page made no error of its own'() {
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
};

export const story = { bench, steps, open: open_pages };
