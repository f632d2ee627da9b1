// The view of a robot: its past and present in the plots, the setpoint that is dragged, and a gamepad.
import assert from 'node:assert/strict';
import { clear_by_script, clear_latch, drawn, held, in_auto, live as is_fresh, samples, seen_mode, shows, trace_pixels } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kSpan_ms = 60_000; // that the plots show at first
const bench = new Bench();
const faults = [];
let page;

const text = (selector) => page.locator(selector).first().innerText();
const robot = () => bench.ask(`/robots/${kRobot}`);
const command = (body) => bench.post(`/robots/${kRobot}/commands`, body);
const commands = async (kind) => (await bench.ask(`/robots/${kRobot}/commands?limit=50`)).commands.filter((each) => each.kind === kind);
const live = () => is_fresh(page);
const is_live = async () => (await page.getAttribute('#plots-live', 'aria-pressed')) === 'true';
const plot = () => page.locator('.strip-0 .plot').boundingBox();
const query = () => new URLSearchParams(page.url().split('?')[1] ?? '');
// The stretch that the address names, which follows the plots a moment later, when it is as asked.
const range = (what, is_so) =>
  until(what, async () => {
    const [from, to] = ['from', 'to'].map((name) => Number(query().get(name)));
    return (await is_so(from, to)) && { from, to };
  });

// Points at a share of the width of the plots, and gives what the first strip says there.
async function value_at(share) {
  const { x, y, width, height } = await plot();
  await page.mouse.move(x + 58 + share * (width - 58 - 18), y + height / 2);
  await page.waitForTimeout(250); // a cursor over plots that run is written ten times a second; who asks waits for what it must say
  return text('.strip-0 .cursor');
}

const steps = {
  async 'after a reload the past is there'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live();
    await in_auto(bench, kRobot, 0.1);
    await samples(bench, kRobot, 500);
    const reloaded_ms = Date.now();
    await page.reload();
    await page.locator('.strip-0 canvas').waitFor();
    await live();
    const share = (before_s) => 1 - (Date.now() - reloaded_ms + 1000 * before_s) / kSpan_ms; // that many seconds before the reload
    await until('what was before the reload is drawn', async () => (await trace_pixels(page, share(3.5), share(0.5))) > 20);
    await until('and has a value, with its ±', async () => /^\d+\.\d ± \d+\.\d mm at /.test(await value_at(share(2))));
  },

  async 'the cursor says a value in every strip, also while the plots run'() {
    await value_at(0.95);
    assert.ok(await is_live());
    await until('each says one', async () => (await page.locator('.strip .cursor').allInnerTexts()).every((said) => /\d/.test(said)));
    const first = await text('.strip-0 .cursor');
    await until('and it follows what runs under it', async () => (await text('.strip-0 .cursor')) !== first);
  },

  async 'a drag holds the past, and stands in the address'() {
    const { x, y, width, height } = await plot();
    await page.mouse.move(x + 200, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + 200 + width / 8, y + height / 2, { steps: 5 });
    await page.mouse.up();
    await until('it is held', async () => !(await is_live()));
    const { from, to } = await range('it stands in the address', (from) => from > 0);
    assert.ok(Math.abs(to - from - kSpan_ms) < 50, `${to - from} ms`);
    const held_range = await text('#plots-range');
    await samples(bench, kRobot, 150);
    await drawn(page);
    assert.equal(await text('#plots-range'), held_range, 'it does not move on');
  },

  async 'the wheel zooms where the pointer is, keys as well, and a link shows the same'() {
    const { x, y, width, height } = await plot();
    await page.mouse.move(x + width * 0.6, y + height / 2);
    await page.mouse.wheel(0, -600);
    await page.focus('.strips');
    await page.keyboard.press('+');
    await page.keyboard.press('ArrowLeft');
    await range('the address names what is shown', async (from, to) => {
      const shown_s = [...(await text('#plots-range')).matchAll(/:(\d\d\.\d\d)\b/g)].map(([, seconds]) => Number(seconds));
      return to - from < 20_000 && [from, to].every((each_ms, at) => Math.abs(shown_s[at] - ((each_ms / 1000) % 60)) < 0.02);
    });
    const said = await text('#plots-range');
    await page.reload();
    await live();
    await shows(page, '#plots-range', said);
    assert.ok(!(await is_live()));
  },

  async 'back to live'() {
    await page.click('#plots-live');
    await until('they run', is_live);
    await until('the address names no stretch', () => query().get('from') === null);
  },

  async 'where nothing was sampled nothing is drawn'() {
    bench.robot.process.kill('SIGKILL');
    await until('it is away', async () => (await robot()).link === 'disconnected');
    const from_ms = Date.now();
    await page.waitForTimeout(2500); // in which there is no robot
    const to_ms = Date.now();
    bench.start_robot(kRobot);
    await until('it is back', async () => (await robot()).link === 'connected');
    await live();
    await page.reload(); // what is drawn now comes from the station as well
    await live();
    const share = (at_ms) => 1 - (Date.now() - at_ms) / kSpan_ms;
    const middle_ms = (from_ms + to_ms) / 2;
    await until('the cursor finds no sample there', async () => /^no sample/.test(await value_at(share(middle_ms))));
    await page.mouse.move(5, 5);
    await until('there is a trace before it', async () => (await trace_pixels(page, share(from_ms - 5000), share(from_ms - 2500))) > 20);
    await until('the gap is not bridged', async () => (await trace_pixels(page, share(middle_ms - 500), share(middle_ms + 500))) === 0);
  },

  async 'other traces can be chosen, and are kept'() {
    const strips = await page.locator('.strip').count();
    await page.click('#plots-traces');
    await page.check('#trace-list input[name=velocity]');
    const is_added = async () => (await page.locator('.strip').count()) === strips + 1;
    await until('one more is there', is_added);
    await page.reload();
    await live();
    await until('and after a reload', is_added);
    await page.click('#plots-traces');
    await page.uncheck('#trace-list input[name=velocity]');
    await page.keyboard.press('Escape'); // stops, and closes the list
    await page.locator('#trace-list').waitFor({ state: 'detached' });
    await until('it has stopped', async () => (await robot()).mode === 'emergency');
    await clear_by_script(bench, kRobot);
  },

  async 'the setpoint cannot be dragged in manual, and the page says why'() {
    await seen_mode(page, 'manual');
    await shows(page, '#ghost-note', /in auto/);
    await until('auto', async () => {
      if ((await robot()).mode === 'auto') return true;
      await command({ kind: 'set_mode', mode: 'auto', setpoint_m: 0.05 }); // one may expire on its way
      return false;
    });
  },

  async 'nor while somebody else is in control; a drag sends one setpoint, on release'() {
    const ghost = page.locator('#setpoint-ghost');
    await until('another is in control', async () => /is in control/.test(await text('#ghost-note')));
    assert.equal(await ghost.getAttribute('aria-disabled'), 'true');
    assert.equal((await bench.post(`/robots/${kRobot}/control`, { action: 'release' })).status, 200);
    await until('the handle is free', async () => (await ghost.getAttribute('aria-disabled')) === 'false');
    const before = (await commands('set_setpoint')).length;
    const { x, y, width, height } = await ghost.boundingBox();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width / 2 + 120, y, { steps: 12 });
    await shows(page, '#ghost-note', /Let go/);
    assert.equal((await commands('set_setpoint')).length, before, 'nothing is sent while it is held');
    await page.mouse.up();
    await until('it is sent', async () => (await commands('set_setpoint')).length === before + 1);
    await page.locator('#ghost-outcome.done').waitFor();
    await samples(bench, kRobot, 50);
    const sent = await commands('set_setpoint');
    assert.equal(sent.length, before + 1, 'once');
    assert.ok(sent[0].arguments.setpoint_m > 0.06);
  },

  async 'keys move it, Enter sends it, and leaving it sends nothing'() {
    const before = (await commands('set_setpoint')).length;
    await page.focus('#setpoint-ghost');
    for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowLeft');
    await page.focus('.strips');
    await samples(bench, kRobot, 50);
    assert.equal((await commands('set_setpoint')).length, before);
    await page.focus('#setpoint-ghost');
    await page.keyboard.press('PageDown');
    await page.keyboard.press('Enter');
    await until('it is sent', async () => (await commands('set_setpoint')).length === before + 1);
  },

  async 'Escape under the hand stops, and what was dragged is not sent'() {
    const before = (await commands('set_setpoint')).length;
    const { x, y, width, height } = await page.locator('#setpoint-ghost').boundingBox();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width / 2 + 80, y, { steps: 5 });
    await page.keyboard.press('Escape');
    await until('it has stopped', async () => (await robot()).mode === 'emergency');
    await page.mouse.up();
    await samples(bench, kRobot, 50);
    assert.equal((await commands('set_setpoint')).length, before);
    await clear_latch(page);
  },

  async 'a gamepad drives while its button is held, and no longer'() {
    await seen_mode(page, 'manual');
    await until('nobody else is in control', async () => !/in control\. You may/.test(await text('#control-line')));
    const pad = (change) =>
      page.evaluate((change) => {
        window.fake_pad ??= { index: 0, id: 'pad', connected: true, mapping: 'standard', axes: [0, 0, 0, 0], buttons: Array.from({ length: 16 }, () => ({ pressed: false })) };
        if ('axis' in change) window.fake_pad.axes[0] = change.axis;
        if ('held' in change) window.fake_pad.buttons[5].pressed = change.held;
        if ('plugged' in change) window.fake_pad.connected = change.plugged;
        navigator.getGamepads = () => [window.fake_pad.connected ? window.fake_pad : null];
        if (change.plugged) dispatchEvent(new Event('gamepadconnected'));
      }, change);
    const runs = async () => Math.abs((await robot()).sample.duty) > 0.1;
    const rests = () => until('the duty ends', async () => (await robot()).sample.duty === 0);
    const let_go = () => pad({ held: false, axis: 0 });
    const drive = () => held(page, runs, async () => {
      await let_go();
      await drawn(page); // the page looks at the pad in each frame
      await drawn(page);
      await pad({ held: true, axis: 1 });
    }, let_go);
    await pad({ plugged: true });
    await page.locator('#gamepad-line').waitFor();
    await drive();
    await pad({ held: false });
    await rests();
    await drive();
    await pad({ plugged: false });
    await rests();
    await pad({ plugged: true });
    await drive();
    await page.evaluate(() => dispatchEvent(new Event('blur')));
    await rests();
    await samples(bench, kRobot, 100, ({ sample }) => assert.equal(sample.duty, 0, 'the held button does not drive on'));
    await drive();
    await page.keyboard.press('Escape');
    await until('it has stopped', async () => (await robot()).mode === 'emergency');
    await rests();
  },

  async 'the stop button of a gamepad stops, in any view'() {
    await clear_latch(page);
    await page.evaluate(() => (location.hash = '#/runs'));
    await drawn(page);
    await page.evaluate(() => (window.fake_pad.buttons[1].pressed = true));
    await until('it has stopped', async () => (await robot()).mode === 'emergency');
    await page.evaluate(() => (window.fake_pad.buttons[1].pressed = false));
    await page.goBack();
  },

  async 'a value beyond a threshold is announced until it is acknowledged'() {
    await page.click('#plots-thresholds');
    const field = page.locator('input[name=impedance_mv-high]');
    await field.fill('much');
    await page.locator('#threshold-list .failed').waitFor();
    await field.fill('');
    await field.pressSequentially('10');
    await samples(bench, kRobot, 50);
    await drawn(page);
    assert.equal(await page.locator('#alert-line').count(), 0, 'a number that is still being typed alerts nobody');
    await field.pressSequentially(',5');
    await field.press('Enter');
    await page.locator('#alert-line').waitFor();
    await shows(page, '#alert-line', /Impedance above 10\.5 mV since/);
    await page.click('#acknowledge-alerts');
    await page.locator('#alert-line').waitFor({ state: 'detached' });
    assert.equal(await page.locator('#numeral-impedance.beyond').count(), 1, 'it is coloured still');
    await field.fill('');
    await field.press('Enter');
    await page.locator('#numeral-impedance.beyond').waitFor({ state: 'detached' });
    await page.click('#plots-thresholds');
  },

  async 'nothing is wider than the page'() {
    for (const [width, height] of [[1440, 900], [1024, 768], [768, 1024], [390, 844], [844, 390]]) {
      for (const colorScheme of ['dark', 'light']) {
        await page.setViewportSize({ width, height });
        await page.emulateMedia({ colorScheme });
        await drawn(page);
        await until(`all of it fits at ${width} × ${height}`, async () => (await page.evaluate(() => document.documentElement.scrollWidth)) <= width);
      }
    }
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => /Content.Security.Policy|violates/i.test(message.text()) && faults.push(message.text()));
};

export const story = { bench, steps, open: open_pages };
