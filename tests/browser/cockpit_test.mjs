// Drives the cockpit in a real browser, from the login link to a station that was killed and came back.
//
//   stories.mjs [--pictures FOLDER] cockpit
//
// FOLDER gets pictures of signing in.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { clear_latch as hold_to_clear, engage_auto, hold, hold_by_mouse, live, mode_of, samples, seen_mode, send_setpoint } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const pictures_at = process.argv.indexOf('--pictures');
const pictures = pictures_at > 0 ? process.argv[pictures_at + 1] : null;
const bench = new Bench();
const faults = []; // errors of the pages themselves, and what their security policy has refused
let page;

function watch(of, into = faults) {
  of.on('pageerror', (error) => into.push(error.message));
  of.on('console', (message) => /Content.Security.Policy|violates/i.test(message.text()) && into.push(message.text()));
  return of;
}

// ---- a small vocabulary

const text = (selector) => page.locator(selector).first().innerText();
const number = async (name) => Number((await text(`#numeral-${name} output`)).replace('\u2212', '-'));
const robot = () => bench.ask(`/robots/${kRobot}`);
const picture = async (of, name) => pictures && of.screenshot({ path: join(pictures, `${name}.png`) });

// The samples of a second, as the station has them: the motor is off and the position is the same.
async function nothing_moves(what) {
  await samples(bench, kRobot, 100, ({ sample }) => assert.equal(sample.duty, 0, what));
  const after = await robot();
  assert.ok(Math.abs(after.sample.velocity_m_s) < 2e-3, `${what}: velocity ${after.sample.velocity_m_s} m/s`);
  assert.equal(after.setpoint_m, null, what);
}

async function latched() {
  await seen_mode(page, 'emergency');
  await until('the page shows duty 0', async () => (await number('duty')) === 0);
  // A press goes two ways and each gives the latch a new id, so the page is asked for the station's latest one.
  await until('the page names the latch the station knows', async () => {
    const now = await robot();
    const shown = await page.locator('#latch').getAttribute('data-emergency-id');
    return now.mode === 'emergency' && now.sample.duty === 0 && shown === now.emergency_id;
  });
}

// Lets go of the button too early, which clears nothing, and then clears the latch.
async function clear_latch() {
  await page.locator('#clear-emergency').evaluate((button) => {
    button.addEventListener('pointerdown', () => (window.pressed_at_ms = performance.now()));
    addEventListener('pointerup', () => (window.held_ms = performance.now() - window.pressed_at_ms), { once: true });
  });
  await page.locator('#clear-emergency').hover();
  await page.mouse.down();
  await page.mouse.up();
  const held_ms = await page.evaluate(() => window.held_ms);
  if (held_ms > 900) return hold_to_clear(page); // the machine stood still, and that was a second
  await samples(bench, kRobot, 20);
  assert.equal(await mode_of(page), 'emergency', `held for ${held_ms} ms`);
  return hold_to_clear(page);
}

// ---- what an operator does, in order

const steps = {
  async 'without the link there is one calm screen'() {
    await page.goto(bench.http);
    await page.getByText('Open the link that the station printed').waitFor();
  },

  async 'the link opens the cockpit, and the robot selects itself'() {
    await bench.sign_in(page);
    await page.getByText('No robot yet').waitFor();
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live(page);
    await seen_mode(page, 'manual');
  },

  async 'a setpoint out of range is refused in words'() {
    await page.locator('#send-setpoint:enabled').waitFor();
    await page.fill('#setpoint-entry', '99999');
    await page.press('#setpoint-entry', 'Enter');
    await page.locator('#setpoint-outcome.failed').waitFor();
    await seen_mode(page, 'manual');
  },

  async 'auto brings the robot to 100 mm'() {
    await engage_auto(page, 100);
    await until('the position arrives', async () => Math.abs((await number('position')) - 100) < 2);
    await until('the setpoint is shown', async () => (await number('setpoint')) === 100);
    const colours = () => page.locator('.strip-0 canvas').first().evaluate((canvas) => {
      const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
      return new Set(Uint32Array.from(new Uint32Array(pixels.buffer))).size;
    });
    await until('the plot has traces', async () => (await colours()) > 10);
  },

  async 'Escape stops, also from inside a field; the time is shown'() {
    await send_setpoint(page, 30);
    await until('the motor runs', async () => Math.abs((await robot()).sample.duty) > 0.05);
    await page.press('#setpoint-entry', 'Escape');
    await latched();
    await page.locator('#stop-line[data-phase=stopped]').waitFor();
    console.log(`    ${await text('#stop-line')}`);
  },

  async 'while latched nothing can be engaged, and clearing is guarded'() {
    assert.ok(await page.locator('#send-setpoint').isDisabled());
    const size = page.viewportSize();
    for (const width of [1280, 768, 390]) {
      await page.setViewportSize({ width, height: size.height });
      const button = page.locator('#clear-emergency');
      const fits = await button.evaluate((one) => one.lastElementChild.offsetHeight <= one.clientHeight && one.offsetHeight >= 48);
      assert.ok(fits, `“${await text('#clear-emergency')}” in ${width} px`);
    }
    await page.setViewportSize(size);
    await clear_latch();
    await nothing_moves('after the clear');
  },

  async 'the button stops'() {
    await engage_auto(page, 120);
    await until('the motor runs', async () => Math.abs((await robot()).sample.duty) > 0.05);
    await page.click('#emergency-stop');
    await latched();
    await clear_latch();
    await nothing_moves('after the second clear');
  },

  async 'a duty runs while its key is held and no longer'() {
    const outlives_its_first_lease = async () => {
      await hold_by_mouse(page, async () => (await robot()).sample.duty > 0.1);
      const running = await robot();
      const lasted = await until('the lease is renewed, or lapses', async () => {
        const now = await robot();
        if (now.sample.duty <= 0.1) return 'lapsed';
        return now.next_seq > running.next_seq + 120 && 'renewed';
      });
      if (lasted === 'lapsed') await page.mouse.up();
      return lasted === 'renewed';
    };
    // A browser that draws without a graphics card stands still for half a second now and then; then a lease lapses, as
    // it must.
    await until('a lease was renewed', outlives_its_first_lease);
    await page.mouse.up();
    await until('the duty ends', async () => (await robot()).sample.duty === 0);
    await until('the page shows it', async () => (await number('duty')) === 0);
  },

  async 'a killed station is waited for, and the page heals by itself'() {
    await bench.station.end('SIGKILL');
    await page.locator('#status.cut-off').waitFor();
    await page.locator('#cut-off-frame').waitFor();
    await page.locator('.readouts.stale').waitFor();
    await bench.start_station();
    await page.locator('.top-bar .lamp.good').waitFor();
    await live(page);
    await seen_mode(page, 'manual');
    await nothing_moves('after the station came back');
    await engage_auto(page, 50);
  },

  async 'a stop for a robot that is away is kept, and delivered first when it returns'() {
    bench.robot.process.kill('SIGSTOP');
    await until('the station misses the robot', async () => (await robot()).link === 'disconnected');
    await page.keyboard.press('Escape');
    await page.locator('#stop-line[data-phase=kept]').waitFor();
    bench.robot.process.kill('SIGCONT');
    await latched();
  },

  async 'an admin sees who has access, and signs another page out'() {
    await bench.cli(['user', 'add', 'anna', '--role', 'viewer'], 'correct horse battery');
    const other = watch(await bench.open_page({ viewport: { width: 1280, height: 800 } }));
    await other.goto(bench.http);
    await other.fill('#user', 'anna');
    await other.fill('#password', 'wrong');
    await other.click('#sign-in');
    await other.getByText('The user or the password is wrong.').waitFor();
    await picture(other, 'sign_in');
    await other.fill('#password', 'correct horse battery');
    await other.click('#sign-in');
    await other.locator('.top-bar .lamp.good').waitFor();
    assert.equal(await other.locator('#who').innerText(), 'anna viewer');
    assert.equal(await other.locator('#send-setpoint').count(), 0, 'a viewer has no controls');
    await other.locator('#emergency-stop').waitFor(); // and may stop
    await other.click('#emergency-stop');
    await other.locator('#stop-line[data-phase=stopped]').waitFor();
    await picture(other, 'viewer');

    await page.click('#open-station');
    await page.click('#station-open-sessions');
    const mark = page.locator('#station-session-list tr[data-session]', { hasText: 'anna' });
    await mark.waitFor();
    await page.locator('#emergency-stop').waitFor(); // stays in reach
    await picture(page, 'access');
    const number = await mark.getAttribute('data-session');
    await hold(page, `#station-sign-out-${number}`, 'the list forgets it', async () => (await mark.count()) === 0);
    await other.getByText('Open the link that the station printed').waitFor();
    await page.click('#open-robot');
    await page.locator('.annunciator h1').waitFor();
    await other.close();
  },

  async 'signing out leaves the calm screen'() {
    await page.click('#log-out');
    await page.getByText('Open the link that the station printed').waitFor();
    await bench.cli(['user', 'role', 'anna', 'operator']);
    await page.fill('#user', 'anna');
    await page.fill('#password', 'correct horse battery');
    await page.press('#password', 'Enter');
    await page.locator('.top-bar .lamp.good').waitFor();
    await page.locator('#send-setpoint').waitFor(); // an operator has the controls
    await page.click('#open-station');
    await page.click('#station-open-sessions');
    await page.locator('#station-forbidden').waitFor();
    assert.equal(await page.locator('#station-sessions').count(), 0, 'and not the access of others');
    await page.click('#open-robot');
  },

  async 'nothing that is smuggled into the page runs or leads elsewhere'() {
    const refused = [];
    const other = watch(await bench.open_page(), refused);
    await other.goto(bench.http);
    const ran = await other.evaluate(() => {
      const add = (tag, set) => document.head.append(Object.assign(document.createElement(tag), set));
      add('script', { textContent: 'window.smuggled = 1' });
      add('style', { textContent: 'body { color: red }' });
      add('script', { src: 'https://example.org/a.js' });
      add('base', { href: 'https://example.org/' });
      document.body.setAttribute('onclick', 'window.smuggled = 2');
      document.body.click();
      return [window.smuggled ?? null, getComputedStyle(document.body).color, document.baseURI.startsWith(location.origin)];
    });
    assert.equal(ran[0], null, 'no script');
    assert.notEqual(ran[1], 'rgb(255, 0, 0)', 'no style');
    assert.ok(ran[2], 'no other base');
    await until('the browser says each time why', async () => refused.length >= 5);
    await other.close();
  },

  async 'the page itself made no error, and its policy refused nothing'() {
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  watch(page);
};

export const story = { bench, steps, open: open_pages };
