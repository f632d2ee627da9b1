// Two people, one robot: who is in control, what the other may do, a tab that is killed, a script without a lease, and a
// page whose network stands still while it drives.
import assert from 'node:assert/strict';
import { clear_latch, click_if_offered, hold_by_mouse, live, mode_of as mode, samples, sign_in, take_control } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kPassword = 'correct horse battery';
const bench = new Bench();
let anna, ben, slow;

const robot = () => bench.ask(`/robots/${kRobot}`);
const holder = async () => (await robot()).control?.holder ?? '';
const control = (page) => page.locator('#control-line');
const runs = async () => (await robot()).sample.duty > 0.1;
const events = async (kind) => (await bench.ask(`/robots/${kRobot}/events?limit=100`)).events.filter((event) => event.kind === kind);

async function enter(page, at, user) {
  await sign_in(page, at, user, kPassword, page.locator('.annunciator h1').getByText(kRobot));
  await live(page);
}

// A page may know a little later than the station who is in control. `is_offered`: that the page offers it is waited for.
async function enter_setpoint(page, setpoint_mm, is_offered = true) {
  if (is_offered) await page.locator('#send-setpoint:enabled').waitFor();
  await page.fill('#setpoint-entry', String(setpoint_mm));
  await page.press('#setpoint-entry', 'Enter');
}

// By a setpoint. A machine that stood still for 400 ms has the command refused, as it must be; then it is given again.
async function command_until(page, setpoint_mm, is_so) {
  await enter_setpoint(page, setpoint_mm);
  await until(`${setpoint_mm} mm is commanded`, async () => {
    if ((await page.locator('#setpoint-outcome.failed').count()) > 0) await enter_setpoint(page, setpoint_mm);
    return is_so();
  });
}

const steps = {
  async 'two operators look at one robot, and nobody is in control'() {
    for (const user of ['anna', 'ben']) await bench.cli(['user', 'add', user, '--role', 'operator'], kPassword);
    bench.start_robot(kRobot);
    anna = await bench.open_page();
    ben = await bench.open_page();
    await enter(anna, bench.http, 'anna');
    await enter(ben, bench.http, 'ben');
    assert.equal(await holder(), '');
  },

  async 'who commands takes control, and the other is not offered to command'() {
    await command_until(anna, 40, async () => (await control(anna).innerText()).includes('You are in control'));
    await until('ben sees who is', async () => /anna.*is in control/.test(await control(ben).innerText()));
    await ben.locator('#send-setpoint:disabled').waitFor();
    await until('and why', async () => /anna.*is in control/.test(await ben.locator('#setpoint-reason').innerText()));
    await until('the setpoint is anna’s', async () => Math.abs((await robot()).setpoint_m - 0.04) < 1e-6);
    await enter_setpoint(ben, -300, false); // by Enter
    await samples(bench, kRobot, 100, ({ setpoint_m }) => assert.ok(Math.abs(setpoint_m - 0.04) < 1e-6, `it is still: ${setpoint_m}`));
    assert.equal(await ben.locator('#setpoint-outcome').innerText(), '');
  },

  async 'a command that is refused for its value takes no control'() {
    await anna.click('#release-control');
    await until('nobody is in control', async () => (await holder()) === '');
    await enter_setpoint(ben, 99999);
    await ben.locator('#setpoint-outcome.failed').waitFor();
    assert.equal(await holder(), '');
  },

  async 'a script without a lease is refused while somebody is in control'() {
    await take_control(anna, async () => (await holder()).includes('anna'));
    const { status, answer } = await bench.post(`/robots/${kRobot}/commands`, { kind: 'set_mode', mode: 'auto', setpoint_m: 0.2 });
    assert.equal(status, 409);
    assert.equal(answer.reason, 'not_in_control');
    assert.ok(Math.abs((await robot()).setpoint_m - 0.04) < 1e-6);
  },

  async 'who is not in control stops the robot all the same'() {
    await ben.click('#emergency-stop');
    await until('the robot is latched', async () => (await mode(ben)) === 'emergency');
    assert.ok((await holder()).includes('anna'), 'and a stop takes no control');
    await until('anna sees it', async () => (await mode(anna)) === 'emergency');
    await clear_latch(anna);
  },

  async 'control is asked for and handed over'() {
    await ben.click('#ask-for-control');
    await anna.locator('#hand-over').click();
    await until('ben is in control', async () => (await control(ben).innerText()).includes('You are in control'));
  },

  async 'a tab that is killed loses control within seconds, and the motor its duty'() {
    await hold_by_mouse(ben, runs);
    await kill(ben);
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
    await until('control has expired', async () => (await holder()) === '');
    await until('and that is an event', async () => (await events('control_expired')).length > 0);
    await command_until(anna, 60, async () => (await holder()).includes('anna') && (await mode(anna)) === 'auto');
    await until('manual', async () => {
      await click_if_offered(anna, '#to-manual');
      return (await mode(anna)) === 'manual';
    });
    await anna.click('#release-control');
  },

  async 'a hold that takes control leaves its button under the pointer'() {
    await until('nobody is in control', async () => /^Nobody/.test(await control(anna).innerText()));
    const hold = anna.locator('#hold-to-run');
    let before;
    await until('anna is in control', async () => {
      await hold.hover();
      before = await hold.boundingBox();
      await anna.mouse.down();
      const is_hers = await until('it is hers', async () => (await control(anna).innerText()).includes('You are in control'), 4000).catch(() => false);
      if (!is_hers) await anna.mouse.up(); // her picture was too old to take control by
      return is_hers;
    });
    const after = await hold.boundingBox();
    await anna.mouse.up();
    assert.ok(Math.abs(after.y - before.y) < 1, `from ${before.y} to ${after.y}`);
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
  },

  async 'a key that gives or takes control leaves the focus where it was pressed'() {
    for (const id of ['release-control', 'take-control', 'release-control']) {
      await until(`${id} by its key`, async () => {
        await anna.locator(`#${id}:enabled`).focus();
        await anna.keyboard.press('Enter');
        return anna.locator(`#${id}`).waitFor({ state: 'detached', timeout: 4000 }).then(() => true, () => false);
      });
      await until(`the focus is there after ${id}`, () => anna.evaluate(() => document.activeElement.id === 'control-line'));
    }
    await until('nobody is in control', async () => (await holder()) === '');
  },

  async 'a page whose network stands still for 5 s renews nothing and moves nothing afterwards'() {
    slow = await bench.open_page();
    await enter(slow, await bench.start_proxy(), 'ben');
    await hold_by_mouse(slow, runs);
    bench.proxy.say('outage 5');
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
    await until('control has expired', async () => (await holder()) === '');
    await slow.mouse.up();
    const moves_nothing = ({ sample }) => assert.equal(sample.duty, 0, 'nothing stale moves the motor');
    await slow.locator('.readouts.stale').waitFor();
    await until('the page has healed, so the late bytes have passed', async () => {
      moves_nothing(await robot());
      return (await slow.locator('.readouts.stale').count()) === 0;
    });
    await samples(bench, kRobot, 300, moves_nothing);
    assert.equal(await holder(), '', 'and nothing stale takes control');
  },
};

// As when the browser dies: no word to the station, not even the end of the connection. Chromium's process of the page
// ends at once.
async function kill(page) {
  const session = await page.context().newCDPSession(page);
  await Promise.race([session.send('Page.crash').catch(() => undefined), page.waitForEvent('crash')]);
}

export const story = { bench, steps };
