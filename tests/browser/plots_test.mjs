// The view of a robot: its past and present in the plots, the setpoint that is dragged, and a gamepad.
import assert from 'node:assert/strict';
import { Bench, clear_latch, run, trace_pixels, until } from './programs.mjs';

const kRobot = 'rheo-1';
const bench = new Bench();
const faults = [];
let page;

const text = (selector) => page.locator(selector).first().innerText();
const robot = () => bench.ask(`/robots/${kRobot}`);
const command = (body) => bench.post(`/robots/${kRobot}/commands`, body);
const commands = async (kind) => (await bench.ask(`/robots/${kRobot}/commands?limit=50`)).commands.filter((each) => each.kind === kind);
const live = () => until('samples arrive', async () => (await page.locator('.readouts.stale').count()) === 0);
const is_live = async () => (await page.getAttribute('#plots-live', 'aria-pressed')) === 'true';
const plot = () => page.locator('.strip-0 .plot').boundingBox();
const settled = () => page.evaluate(() => new Promise((done) => setTimeout(done, 400))); // the address follows 250 ms later
const query = () => new URLSearchParams(page.url().split('?')[1] ?? '');

// Points at a share of the width of the plots, and gives what the first strip says there.
async function value_at(share) {
  const { x, y, width, height } = await plot();
  await page.mouse.move(x + 58 + share * (width - 58 - 18), y + height / 2);
  await page.waitForTimeout(250);
  return text('.strip-0 .cursor');
}

const steps = {
  async 'after a reload the past is there'() {
    await page.goto(await bench.login_link());
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live();
    assert.equal((await command({ kind: 'set_mode', mode: 'auto', setpoint_m: 0.1 })).status, 200);
    const began = (await robot()).next_seq;
    await until('fifteen seconds are recorded', async () => (await robot()).next_seq > began + 1500);
    await page.reload();
    await page.locator('.strip-0 canvas').waitFor();
    await live();
    await until('what was before the reload is drawn', async () => (await trace_pixels(page, 0.78, 0.9)) > 20);
    await until('and has a value, with its ±', async () => /^\d+\.\d ± \d+\.\d mm at /.test(await value_at(0.88)));
  },

  async 'the cursor says a value in every strip, also while the plots run'() {
    await value_at(0.95);
    assert.ok(await is_live());
    const first = await text('.strip-0 .cursor');
    for (const strip of await page.locator('.strip .cursor').allInnerTexts()) assert.match(strip, /\d/);
    await until('and it follows what runs under it', async () => (await text('.strip-0 .cursor')) !== first);
  },

  async 'a drag holds the past, and stands in the address'() {
    const { x, y, width, height } = await plot();
    await page.mouse.move(x + 200, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + 200 + width / 8, y + height / 2, { steps: 5 });
    await page.mouse.up();
    assert.ok(!(await is_live()));
    await settled();
    const [from, to] = [Number(query().get('from')), Number(query().get('to'))];
    assert.ok(Math.abs(to - from - 60_000) < 50, `${to - from} ms`);
    const held = await text('#plots-range');
    await page.waitForTimeout(1500);
    assert.equal(await text('#plots-range'), held, 'it does not move on');
  },

  async 'the wheel zooms where the pointer is, keys as well, and a link shows the same'() {
    const { x, y, width, height } = await plot();
    await page.mouse.move(x + width * 0.6, y + height / 2);
    await page.mouse.wheel(0, -600);
    await page.focus('.strips');
    await page.keyboard.press('+');
    await page.keyboard.press('ArrowLeft');
    await settled();
    const [from, to] = [Number(query().get('from')), Number(query().get('to'))];
    assert.ok(to - from < 20_000, `${to - from} ms`);
    const said = await text('#plots-range');
    await page.reload();
    await live();
    assert.equal(await text('#plots-range'), said);
    assert.ok(!(await is_live()));
  },

  async 'back to live'() {
    await page.click('#plots-live');
    assert.ok(await is_live());
    await settled();
    assert.equal(query().get('from'), null);
  },

  async 'where nothing was sampled nothing is drawn'() {
    bench.robot.process.kill('SIGKILL');
    await until('it is away', async () => (await robot()).link === 'disconnected');
    await page.waitForTimeout(5000);
    bench.start_robot(kRobot);
    await until('it is back', async () => (await robot()).link === 'connected');
    await live();
    await page.reload(); // what is drawn now comes from the station as well
    await live();
    let gap = null;
    await until('the gap is found', async () => {
      for (let share = 0.99; share > 0.7; share -= 0.02) {
        if (/^no sample/.test(await value_at(share))) return (gap = share);
      }
      return false;
    });
    await page.mouse.move(5, 5);
    assert.equal(await trace_pixels(page, gap - 0.005, gap + 0.005), 0, 'the gap is not bridged');
  },

  async 'other traces can be chosen, and are kept'() {
    const strips = await page.locator('.strip').count();
    await page.click('#plots-traces');
    await page.check('#trace-list input[name=velocity]');
    assert.equal(await page.locator('.strip').count(), strips + 1);
    await page.reload();
    await live();
    assert.equal(await page.locator('.strip').count(), strips + 1);
    await page.click('#plots-traces');
    await page.uncheck('#trace-list input[name=velocity]');
    await page.keyboard.press('Escape'); // stops, and closes the list
    await page.locator('#trace-list').waitFor({ state: 'detached' });
    await until('it has stopped', async () => (await robot()).mode === 'emergency');
    // The page may have sent the stop a second time when the machine stood still: the one in force is cleared.
    await until('it is cleared', async () => {
      const { mode, emergency_id } = await robot();
      if (mode === 'emergency') await command({ kind: 'clear_emergency', emergency_id });
      return mode === 'manual';
    });
  },

  async 'the setpoint cannot be dragged in manual, and the page says why'() {
    await until('manual', async () => (await page.locator('.annunciator').getAttribute('data-mode')) === 'manual');
    assert.match(await text('#ghost-note'), /in auto/);
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
    assert.match(await text('#ghost-note'), /Let go/);
    assert.equal((await commands('set_setpoint')).length, before, 'nothing is sent while it is held');
    await page.mouse.up();
    await until('it is sent', async () => (await commands('set_setpoint')).length === before + 1);
    await page.locator('#ghost-outcome.done').waitFor();
    await page.waitForTimeout(500);
    const sent = await commands('set_setpoint');
    assert.equal(sent.length, before + 1, 'once');
    assert.ok(sent[0].arguments.setpoint_m > 0.06);
  },

  async 'keys move it, Enter sends it, and leaving it sends nothing'() {
    const before = (await commands('set_setpoint')).length;
    await page.focus('#setpoint-ghost');
    for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowLeft');
    await page.focus('.strips');
    await page.waitForTimeout(300);
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
    await page.waitForTimeout(500);
    assert.equal((await commands('set_setpoint')).length, before);
    await clear_latch(page);
  },

  async 'a gamepad drives while its button is held, and no longer'() {
    await until('manual', async () => (await page.locator('.annunciator').getAttribute('data-mode')) === 'manual');
    await until('nobody else is in control', async () => !/in control\. You may/.test(await text('#control-line')));
    const pad = (change) =>
      page.evaluate((change) => {
        window.fake_pad ??= { index: 0, id: 'pad', connected: true, axes: [0, 0, 0, 0], buttons: Array.from({ length: 16 }, () => ({ pressed: false })) };
        if ('axis' in change) window.fake_pad.axes[0] = change.axis;
        if ('held' in change) window.fake_pad.buttons[5].pressed = change.held;
        if ('plugged' in change) window.fake_pad.connected = change.plugged;
        navigator.getGamepads = () => [window.fake_pad.connected ? window.fake_pad : null];
        if (change.plugged) dispatchEvent(new Event('gamepadconnected'));
      }, change);
    const runs = () => until('the duty runs', async () => Math.abs((await robot()).sample.duty) > 0.1);
    const rests = () => until('the duty ends', async () => (await robot()).sample.duty === 0);
    const drive = async () => {
      await pad({ held: false, axis: 0 });
      await page.waitForTimeout(150);
      await pad({ held: true, axis: 1 });
      await runs();
    };
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
    await page.waitForTimeout(500);
    assert.equal((await robot()).sample.duty, 0, 'the held button does not drive on');
    await drive();
    await page.keyboard.press('Escape');
    await until('it has stopped', async () => (await robot()).mode === 'emergency');
    await rests();
  },

  async 'a value beyond a threshold is announced until it is acknowledged'() {
    await page.click('#plots-thresholds');
    const field = page.locator('input[name=impedance_mv-high]');
    await field.fill('much');
    await page.locator('#threshold-list .failed').waitFor();
    await field.fill('');
    await field.pressSequentially('10');
    await page.waitForTimeout(300);
    assert.equal(await page.locator('#alert-line').count(), 0, 'a number that is still being typed alerts nobody');
    await field.pressSequentially(',5');
    await field.press('Enter');
    await page.locator('#alert-line').waitFor();
    assert.match(await text('#alert-line'), /Impedance above 10\.5 mV since/);
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
        await page.waitForTimeout(200);
        assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= width, `at ${width} × ${height}`);
      }
    }
    assert.deepEqual(faults, []);
  },
};

await run(bench, steps, async () => {
  page = await bench.open_browser({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => /Content.Security.Policy|violates/i.test(message.text()) && faults.push(message.text()));
});
