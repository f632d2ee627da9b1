// Two people, one robot: who is in control, what the other may do, a tab that is killed, a script without a lease, and a
// page whose network stands still while it drives.
import assert from 'node:assert/strict';
import { Bench, clear_latch, run, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kPassword = 'correct horse battery';
const bench = new Bench();
let anna, ben, slow;

const robot = () => bench.ask(`/robots/${kRobot}`);
const holder = async () => (await robot()).control?.holder ?? '';
const control = (page) => page.locator('#control-line');
const mode = (page) => page.locator('.annunciator').getAttribute('data-mode');
const events = async (kind) => (await bench.ask(`/robots/${kRobot}/events?limit=100`)).events.filter((event) => event.kind === kind);

async function sign_in(page, at, user) {
  await page.goto(at);
  await page.fill('#user', user);
  await page.fill('#password', kPassword);
  await page.click('#sign-in');
  await page.locator('.annunciator h1').getByText(kRobot).waitFor();
  await until('samples arrive', async () => (await page.locator('.readouts.stale').count()) === 0);
}

// A page may know a little later than the station who is in control. `is_offered`: that the page offers it is waited for.
async function enter_setpoint(page, setpoint_mm, is_offered = true) {
  if (is_offered) await page.locator('#send-setpoint:enabled').waitFor();
  await page.fill('#setpoint-entry', String(setpoint_mm));
  await page.press('#setpoint-entry', 'Enter');
}

const steps = {
  async 'two operators look at one robot, and nobody is in control'() {
    for (const user of ['anna', 'ben']) await bench.cli(['user', 'add', user, '--role', 'operator'], kPassword);
    bench.start_robot(kRobot);
    anna = await bench.open_page();
    ben = await bench.open_page();
    await sign_in(anna, bench.http, 'anna');
    await sign_in(ben, bench.http, 'ben');
    assert.equal(await holder(), '');
  },

  async 'who commands takes control, and the other is not offered to command'() {
    await enter_setpoint(anna, 40);
    await until('anna is in control', async () => {
      // A machine that stood still for 400 ms has the command refused, as it must be; then it is given again.
      if ((await anna.locator('#setpoint-outcome.failed').count()) > 0) await enter_setpoint(anna, 40);
      return (await control(anna).innerText()).includes('You are in control');
    });
    await until('ben sees who is', async () => /anna.*is in control/.test(await control(ben).innerText()));
    await ben.locator('#send-setpoint:disabled').waitFor();
    assert.match(await ben.locator('#setpoint-reason').innerText(), /anna.*is in control/);
    await enter_setpoint(ben, -300, false); // by Enter
    assert.equal(await ben.locator('#setpoint-outcome').innerText(), '');
    const now = await robot();
    assert.ok(Math.abs(now.setpoint_m - 0.04) < 1e-6, `the setpoint is still anna's: ${now.setpoint_m}`);
  },

  async 'a command that is refused for its value takes no control'() {
    await anna.click('#release-control');
    await until('nobody is in control', async () => (await holder()) === '');
    await enter_setpoint(ben, 99999);
    await ben.locator('#setpoint-outcome.failed').waitFor();
    assert.equal(await holder(), '');
  },

  async 'a script without a lease is refused while somebody is in control'() {
    // A machine that stands still shows the page a picture that is too old to take control by: then once more.
    await until('anna is in control', async () => {
      if ((await holder()).includes('anna')) return true;
      const refusal = anna.locator('#control-line .failed');
      if ((await refusal.count()) > 0) assert.match(await refusal.innerText(), /too old/);
      await anna.click('#take-control', { timeout: 500 }).catch(() => {});
      return false;
    });
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
    const hold = ben.locator('#hold-to-run');
    await hold.hover();
    await ben.mouse.down();
    await until('the duty runs', async () => (await robot()).sample.duty > 0.1);
    await kill(ben);
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
    await until('control has expired', async () => (await holder()) === '');
    assert.ok((await events('control_expired')).length > 0);
    await enter_setpoint(anna, 60);
    await until('anna is in control', async () => (await holder()).includes('anna'));
    await anna.click('#to-manual');
    await until('manual', async () => (await mode(anna)) === 'manual');
    await anna.click('#release-control');
  },

  async 'a hold that takes control leaves its button under the pointer'() {
    await until('nobody is in control', async () => /^Nobody/.test(await control(anna).innerText()));
    const hold = anna.locator('#hold-to-run');
    await hold.hover();
    const before = await hold.boundingBox();
    await anna.mouse.down();
    await until('anna is in control', async () => (await control(anna).innerText()).includes('You are in control'));
    const after = await hold.boundingBox();
    await anna.mouse.up();
    assert.ok(Math.abs(after.y - before.y) < 1, `from ${before.y} to ${after.y}`);
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
  },

  async 'a key that gives or takes control leaves the focus where it was pressed'() {
    for (const id of ['release-control', 'take-control', 'release-control']) {
      await anna.locator(`#${id}:enabled`).focus();
      await anna.keyboard.press('Enter');
      await anna.locator(`#${id}`).waitFor({ state: 'detached' });
      assert.equal(await anna.evaluate(() => document.activeElement.id), 'control-line', id);
    }
    await until('nobody is in control', async () => (await holder()) === '');
  },

  async 'a page whose network stands still for 5 s renews nothing and moves nothing afterwards'() {
    slow = await bench.open_page();
    await sign_in(slow, await bench.start_proxy(), 'ben');
    const hold = slow.locator('#hold-to-run');
    await hold.hover();
    await slow.mouse.down();
    await until('the duty runs', async () => (await robot()).sample.duty > 0.1);
    bench.proxy.say('outage 5');
    await until('the motor is off', async () => (await robot()).sample.duty === 0);
    await until('control has expired', async () => (await holder()) === '');
    await slow.mouse.up();
    const off = await robot();
    await until('ten seconds of samples, the late bytes among them', async () => {
      const now = await robot();
      assert.equal(now.sample.duty, 0, 'nothing stale moves the motor');
      return now.next_seq > off.next_seq + 1000;
    });
    assert.equal(await holder(), '', 'and nothing stale takes control');
    await until('the page has healed', async () => (await slow.locator('.readouts.stale').count()) === 0);
  },
};

// As when the browser dies: no word to the station, not even the end of the connection. Chromium's process of the page
// ends at once.
async function kill(page) {
  const session = await page.context().newCDPSession(page);
  await Promise.race([session.send('Page.crash').catch(() => undefined), page.waitForEvent('crash')]);
}

await run(bench, steps, async () => {
  await bench.open_browser();
});
