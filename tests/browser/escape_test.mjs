// Escape stops the robot also when something on the page would take the key, once for each press; Space never does. Each
// control of each view: escape_everywhere_test.mjs.
import assert from 'node:assert/strict';
import { clear_latch, engage_auto, hold_by_mouse, live, mode_of, samples, seen_mode, shows } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const bench = new Bench();
let page;

const robot = () => bench.ask(`/robots/${kRobot}`);
const stops = async () =>
  (await bench.ask(`/robots/${kRobot}/commands?limit=1000`)).commands.filter((command) => command.kind === 'emergency_stop').length;

// One press of Escape is one stop, no more and no less.
async function escape_stops(what, press = () => page.keyboard.press('Escape')) {
  const before = await stops();
  await press();
  await until(`Escape stops with ${what}`, async () => (await stops()) > before);
  // The stop is in the list when it is sent, the latch when the robot has answered.
  await until(`the robot is latched with ${what}`, async () => (await robot()).emergency_id !== null);
  assert.equal(await stops(), before + 1, `${what}: one stop`);
}

const steps = {
  async 'the page opens no menu of the browser'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live(page);
    const kept_shut = await page.locator('#run-name').evaluate((field) => new Promise((done) => {
      addEventListener('contextmenu', (event) => done(event.defaultPrevented), { once: true });
      field.dispatchEvent(new MouseEvent('contextmenu', { bubbles: true, cancelable: true }));
    }));
    assert.ok(kept_shut);
  },

  async 'Escape stops a robot that runs, from each control of auto and manual'() {
    for (const id of ['setpoint-entry', 'run-name', 'duty-entry', 'run-fluid', 'to-manual', 'stop-all', 'show-keys']) {
      await engage_auto(page, 40);
      await page.focus(`#${id}`);
      await escape_stops(`${id} focused, in auto`);
      await clear_latch(page);
    }
    await hold_by_mouse(page, async () => (await robot()).sample.duty > 0.1);
    await escape_stops('a duty held');
    await page.mouse.up();
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
  },

  async 'the list of fluids stops at the first Escape, and closes as well'() {
    const list = page.locator('#run-fluid-list');
    await page.focus('#run-fluid');
    await page.keyboard.press('ArrowDown');
    await list.waitFor();
    await escape_stops('the list of fluids open');
    await list.waitFor({ state: 'hidden' });
    await until('the focus stays', () => page.evaluate(() => document.activeElement.id === 'run-fluid'));
    await page.keyboard.press('w');
    await shows(page, '#run-fluid-list .at', 'water');
    await page.keyboard.press('Enter');
    await list.waitFor({ state: 'hidden' });
    await shows(page, '#run-fluid', 'water');
    await page.waitForFunction(async () => (await (await fetch('/api/v1/robots/rheo-1')).json()).fluid === 'water');
    await page.click('#run-fluid');
    await page.locator('#run-fluid-list [role=option]').first().click();
    await page.waitForFunction(() => document.querySelector('#run-fluid').innerText === 'non-Newtonian');
    await page.waitForFunction(async () => (await (await fetch('/api/v1/robots/rheo-1')).json()).fluid === 'non_newtonian');
  },

  async 'the list of keys stops and closes, and says what Space does and what full screen takes'() {
    await page.click('#show-keys');
    const list = page.locator('#key-list');
    await list.waitFor();
    const text = await list.innerText();
    assert.match(text, /Space\s+Never stops/);
    assert.match(text, /full screen/);
    for (const [width, height] of [[1024, 768], [844, 390], [1440, 900]]) {
      await page.setViewportSize({ width, height });
      await page.locator('#stop-all').waitFor();
      const over = await list.evaluate((key_list) => {
        const [panel, stop, all] = [key_list, ...['#emergency-stop', '#stop-all'].map((each) => document.querySelector(each))].map((each) => each.getBoundingClientRect());
        return [stop, all].some((each) => panel.right > each.left && panel.bottom > each.top && panel.left < each.right && panel.top < each.bottom);
      });
      assert.ok(!over, `it never lies over a button that stops, at ${width} × ${height}`);
    }
    await escape_stops('the list of keys open');
    await list.waitFor({ state: 'hidden' });
  },

  async 'nothing on a page can take the key first: details, dialog, text area, a listener that swallows it'() {
    await page.evaluate(() => {
      document.body.insertAdjacentHTML('beforeend', '<div id="added"><textarea></textarea><details open><summary>x</summary></details><dialog><input></dialog></div>');
      for (const target of [window, document, document.body, document.querySelector('#added')]) {
        target.addEventListener('keydown', (event) => event.stopImmediatePropagation(), true);
      }
    });
    for (const where of ['textarea', 'summary']) {
      await page.focus(`#added ${where}`);
      await escape_stops(where);
    }
    await page.locator('#added dialog').evaluate((dialog) => dialog.showModal());
    await page.focus('#added dialog input');
    await escape_stops('a modal dialog');
    await page.reload();
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
  },

  async 'a key that is held down is one stop'() {
    await page.focus('#run-name');
    await escape_stops('Escape held', async () => {
      for (let i = 0; i < 20; ++i) await page.keyboard.down('Escape'); // each but the first repeats
      await page.keyboard.up('Escape');
    });
    await clear_latch(page);
  },

  async 'Space never stops, not even on a button that stops; Enter does'() {
    await engage_auto(page, 40);
    const before = await stops();
    for (const id of ['emergency-stop', 'stop-all']) {
      await page.focus(`#${id}`);
      await page.keyboard.press(' ');
      await page.keyboard.press('Space', { delay: 30 });
    }
    await page.focus('#run-name');
    await page.keyboard.press(' ');
    assert.equal(await page.inputValue('#run-name'), ' ', 'it belongs to text');
    await page.evaluate(() => document.activeElement.blur());
    await page.keyboard.press(' ');
    await samples(bench, kRobot, 100);
    assert.equal(await stops(), before);
    assert.equal(await mode_of(page), 'auto');
    await page.focus('#emergency-stop');
    await escape_stops('Enter on the button', () => page.keyboard.press('Enter'));
    await seen_mode(page, 'emergency');
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
};

export const story = { bench, steps, open: open_pages };
