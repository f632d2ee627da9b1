// Two pages that fight for one robot, every way in which a hand leaves a held control, a tab that is closed under it, and a
// page that slept: whatever happens, one commands at a time, a duty ends, and nothing that was held is sent afterwards.
import assert from 'node:assert/strict';
import { clear_by_script, click_if_offered, held as held_by, hold_by_mouse, in_auto, live, mode_of as mode, samples, sign_in as sign_in_by } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kPassword = 'correct horse battery';
const kShown_ms = 300; // of the time in which the page runs
const bench = new Bench();
let anna, ben, sleeper;

const robot = () => bench.ask(`/robots/${kRobot}`);
const holder = async () => (await robot()).control?.holder ?? '';
const control = (page) => page.locator('#control-line');
const is_mine = async (page) => (await page.locator('#control-line.mine').count()) === 1;
const shown_holder = (page) => control(page).getAttribute('data-holder');
const runs = async () => Math.abs((await robot()).sample.duty) > 0.1;
const rests = (what) => until(`the duty is 0: ${what}`, async () => (await robot()).sample.duty === 0);

async function sign_in(page, user) {
  await sign_in_by(page, bench.http, user, kPassword, page.locator('.annunciator h1').getByText(kRobot));
  await live(page);
}

// A page may know a little later than the station who is in control. `is_offered`: that the page offers it is waited for.
async function enter_setpoint(page, setpoint_mm, is_offered = true) {
  if (is_offered) await page.locator('#send-setpoint:enabled').waitFor();
  await page.fill('#setpoint-entry', String(setpoint_mm));
  await page.press('#setpoint-entry', 'Enter');
}

const by_mouse = (page) => hold_by_mouse(page, runs);
const by_key = (page) =>
  held_by(page, runs, () => page.focus('#hold-to-run').then(() => page.keyboard.down(' ')), () => page.keyboard.up(' '));

// For another second of samples.
const nothing_moves = (what) => samples(bench, kRobot, 100, ({ sample }) => assert.equal(sample.duty, 0, what));

// Nobody is in control, in manual, with the motor off.
async function at_rest(page) {
  await rests('at the beginning');
  await until('nobody is in control', async () => {
    if ((await holder()) === '') return true;
    await click_if_offered(page, '#release-control');
    return false;
  });
  await live(page);
}

// Both pages and the station name the same holder, and one page at most says that it is this one.
async function agree(who) {
  await until(`everybody knows that ${who || 'nobody'} is in control`, async () => {
    const now = await holder();
    return (who === '' ? now === '' : now.includes(who)) && (await shown_holder(anna)) === now && (await shown_holder(ben)) === now;
  });
  assert.deepEqual([await is_mine(anna), await is_mine(ben)], [who === 'anna', who === 'ben']);
}

async function only_commands(page, other, setpoint_mm) {
  // The page of the other does not offer it, also by Enter, and the station refuses it from anybody else.
  await other.locator('#send-setpoint:disabled').waitFor();
  await enter_setpoint(other, setpoint_mm + 5, false);
  const asked = { kind: 'set_mode', mode: 'auto', setpoint_m: (setpoint_mm + 5) / 1000 };
  const { status, answer } = await bench.post(`/robots/${kRobot}/commands`, asked);
  assert.deepEqual([status, answer.reason], [409, 'not_in_control']);
  await until('who is in control commands', async () => {
    await enter_setpoint(page, setpoint_mm);
    await page.locator('#setpoint-outcome:is(.done, .failed)').waitFor();
    return (await page.locator('#setpoint-outcome.done').count()) === 1; // one that is too old is refused on a slow machine
  });
  await until(`${setpoint_mm} mm is in force`, async () => Math.abs((await robot()).setpoint_m - setpoint_mm / 1000) < 1e-6);
}

// ---- a page that sleeps

// In the page, before its own code: what it sends, and after how much time in which it ran it shows, in the frames that it
// draws, that it knows nothing of now.
function watch_page() {
  window.sent = [];
  const { fetch } = window;
  window.fetch = (path, options) => {
    if (options?.body) window.sent.push({ at_ms: performance.now(), ...JSON.parse(options.body) });
    return fetch(path, options);
  };
  const { send } = WebSocket.prototype;
  WebSocket.prototype.send = function (text) {
    const { type, ...rest } = JSON.parse(text);
    if (type === 'renew_lease') window.sent.push({ at_ms: performance.now(), kind: type, ...rest });
    return send.call(this, text);
  };
  let last_ms = performance.now();
  window.wakes = [];
  const look = () => {
    requestAnimationFrame(look);
    const now_ms = performance.now();
    const gap_ms = now_ms - last_ms;
    last_ms = now_ms;
    if (gap_ms > 1500) window.wakes.push({ at_ms: now_ms - gap_ms / 2, ran_ms: 0, worked_ms: 0, is_stale: false });
    const wake = window.wakes.at(-1);
    if (!wake) return;
    if (gap_ms <= 1500) wake.ran_ms += Math.min(gap_ms, 50); // without the time in which the machine did not run the page
    if (document.querySelector('#emergency-stop')?.dataset.works !== 'false') wake.worked_ms = wake.ran_ms;
    wake.is_stale = document.querySelector('.readouts.stale') !== null;
  };
  requestAnimationFrame(look);
}

async function processes(of_all) {
  const session = await bench.browser.newBrowserCDPSession();
  const { processInfo } = await session.send('SystemInfo.getProcessInfo');
  await session.detach();
  const found = processInfo.filter(({ type }) => of_all || type === 'renderer').map(({ id }) => id);
  assert.ok(found.length > 0);
  return found.sort((a, b) => b - a); // the browser itself last
}
const signal = (ids, name) => ids.forEach((id) => process.kill(id, name));

// The page does not run during `meanwhile`; then it does, and has noticed.
async function asleep(of_all, meanwhile, before_waking = () => undefined) {
  const wakes = await sleeper.evaluate(() => window.wakes.length);
  const ids = await processes(of_all);
  signal(ids, 'SIGSTOP');
  try {
    await meanwhile();
    await new Promise((done) => setTimeout(done, 2500)); // long enough to be known as a sleep
    await before_waking();
  } finally {
    signal([...ids].reverse(), 'SIGCONT');
  }
  await until('the page has woken', () => sleeper.evaluate((wakes) => window.wakes.length > wakes, wakes));
  return () => sleeper.evaluate(() => window.wakes.at(-1));
}
const sent_since = (at_ms) => sleeper.evaluate((at_ms) => window.sent.filter((each) => each.at_ms >= at_ms), at_ms);

const steps = {
  async 'two pages take control at the same moment: one gets it, both say who, and one commands'() {
    await bench.cli(['user', 'add', 'anna', '--role', 'admin'], kPassword);
    await bench.cli(['user', 'add', 'ben', '--role', 'operator'], kPassword);
    bench.start_robot(kRobot);
    anna = await bench.open_page();
    ben = await bench.open_page();
    await sign_in(anna, 'anna');
    await sign_in(ben, 'ben');
    for (const setpoint_mm of [20, 30]) {
      await until('one of them has it', async () => {
        await Promise.all([anna, ben].map((page) => click_if_offered(page, '#take-control')));
        return (await holder()) !== '';
      });
      const winner = (await holder()).includes('anna') ? 'anna' : 'ben';
      await agree(winner);
      const [page, other] = winner === 'anna' ? [anna, ben] : [ben, anna];
      await only_commands(page, other, setpoint_mm);
      await page.click('#release-control');
      await agree('');
    }
    await until('manual', async () => {
      await click_if_offered(anna, '#to-manual');
      return (await mode(anna)) === 'manual';
    });
    await at_rest(anna);
  },

  async 'by force: an admin with a reason and a held button, while the other drives'() {
    await by_mouse(ben);
    await agree('ben');
    assert.equal(await ben.locator('#force-control').count(), 0);
    await anna.click('#force-control');
    assert.ok(await anna.locator('#force-now').isDisabled());
    await anna.fill('#force-reason', 'ben has left the room');
    await until('anna has it', async () => {
      if ((await holder()).includes('anna')) return true;
      if ((await holder()) === '') await ben.mouse.up().then(() => by_mouse(ben)); // the lease and control had ended
      await anna.locator('#force-now').hover({ timeout: 1000 }).catch(() => undefined);
      await anna.mouse.down();
      await until('taken', async () => (await holder()).includes('anna'), 2500).catch(() => undefined);
      await anna.mouse.up();
      return false;
    });
    await agree('anna');
    await rests('the one who was driving is not in control');
    await until('ben’s button does not say that it runs', async () => (await ben.locator('#hold-to-run.running').count()) === 0);
    await nothing_moves('ben still holds his button');
    await ben.mouse.up();
    await until('the reason is kept', async () => {
      const { events } = await bench.ask(`/robots/${kRobot}/events?limit=100`);
      return events.some((event) => JSON.stringify(event).includes('ben has left the room'));
    });
    await at_rest(anna);
  },

  async 'whatever becomes of the hand, the duty ends and does not come back'() {
    const page = ben;
    const ways = {
      'let go outside the button': [by_mouse, async () => (await page.mouse.move(5, 5), await page.mouse.up())],
      'the pointer is taken away': [by_mouse, () => page.locator('#hold-to-run').evaluate((button) => button.dispatchEvent(new PointerEvent('pointercancel', { bubbles: true })))],
      'another window has the focus': [by_mouse, () => page.evaluate(() => dispatchEvent(new Event('blur')))],
      'the page is hidden': [by_mouse, () => page.evaluate(() => {
        Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
        document.dispatchEvent(new Event('visibilitychange'));
        delete document.hidden;
      })],
      'the key never comes up, the focus goes': [by_key, () => page.focus('#run-name')],
      'the key is down still when the focus comes back': [by_key, async () => (await page.focus('#run-name'), await page.focus('#hold-to-run'), await page.keyboard.down(' '))],
      'the key never comes up, another view opens': [by_key, () => page.locator('#open-fleet').evaluate((link) => link.click())],
      'the robot is stopped by somebody else': [by_mouse, () => bench.post(`/robots/${kRobot}/emergency-stop`)],
    };
    for (const [what, [begin, end]] of Object.entries(ways)) {
      await begin(page);
      await end();
      await rests(what);
      await nothing_moves(what); // while the button or the key is still down
      await page.mouse.up();
      await page.keyboard.up(' ');
      await page.click('#open-robot');
      assert.equal(await page.locator('#hold-to-run.running').count(), 0, what);
    }
    await at_rest(ben);
    await clear_by_script(bench, kRobot);
    await bench.post(`/robots/${kRobot}/control`, { action: 'release' });
  },

  async 'a tab that is closed or loaded anew under a held duty drives nothing on'() {
    const page = await bench.open_page();
    await sign_in(page, 'ben');
    await by_mouse(page);
    await page.reload();
    await rests('loaded anew');
    await live(page);
    await nothing_moves('loaded anew, and the button is still held');
    await page.mouse.up();
    await at_rest(page);
    await by_mouse(page);
    const again = await page.context().newPage();
    await page.close();
    await rests('closed');
    await again.goto(bench.http);
    await again.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live(again);
    await nothing_moves('closed, and opened again');
    assert.equal(await again.locator('#hold-to-run.running').count(), 0);
    await again.context().close();
    await until('control has ended', async () => (await holder()) === '');
  },

  async 'a page that wakes while the station stands still shows in time that a stop would not work, and never that it would'() {
    for (const page of [anna, ben]) await page.context().close(); // what sleeps now is all that the browser has
    sleeper = await bench.open_page();
    await sleeper.addInitScript(watch_page);
    await sign_in(sleeper, 'ben');
    for (const of_all of [false, true]) {
      const what = of_all ? 'the computer slept' : 'the tab was frozen';
      await by_mouse(sleeper);
      const wake = await asleep(
        of_all,
        async () => (await rests(what), await until('control has expired', async () => (await holder()) === '')),
        () => bench.station.process.kill('SIGSTOP'),
      );
      const shown = await until('it has run for two seconds', async () => {
        const now = await wake();
        return now.ran_ms > 2000 && now;
      });
      console.log(`    ${what}: the last frame in which a stop seems to work comes ${Math.round(shown.worked_ms)} ms after the page runs again`);
      assert.ok(shown.worked_ms < kShown_ms, `${shown.worked_ms} ms`);
      assert.ok(shown.is_stale, 'the numerals are marked');
      bench.station.process.kill('SIGCONT');
      await live(sleeper);
      await nothing_moves(`${what}, and the button is still held`);
      const sent = await sent_since(shown.at_ms);
      assert.deepEqual(sent.filter((each) => each.kind === 'renew_lease' || each.duty), [], 'nothing that was held is sent');
      assert.equal(await sleeper.locator('#hold-to-run.running').count(), 0);
      await sleeper.mouse.up();
      await at_rest(sleeper);
    }
  },

  async 'a page that wakes beside a station that runs drives nothing on, and shows what has become of its setpoint'() {
    await by_mouse(sleeper);
    const wake = await asleep(false, () => rests('the tab was frozen'));
    await live(sleeper);
    await nothing_moves('the button is still held');
    await until('the button does not say that it runs', async () => (await sleeper.locator('#hold-to-run.running').count()) === 0);
    assert.deepEqual((await sent_since((await wake()).at_ms)).filter((each) => each.duty), []);
    await sleeper.mouse.up();
    await at_rest(sleeper);

    await until('auto at 40 mm', async () => {
      await enter_setpoint(sleeper, 40);
      return until('auto', async () => (await robot()).mode === 'auto', 3000).catch(() => false);
    });
    await sleeper.focus('#setpoint-ghost');
    await sleeper.keyboard.press('ArrowRight'); // moved, and not sent
    const woken = await asleep(true, async () => {
      await until('control has expired', async () => (await holder()) === '');
      await in_auto(bench, kRobot, 0.06);
    });
    await live(sleeper);
    await until('the page shows the setpoint in force', async () => /60/.test(await sleeper.locator('#numeral-setpoint output').innerText()));
    const sent = await sent_since((await woken()).at_ms);
    assert.deepEqual(sent.filter((each) => each.kind === 'set_setpoint' || each.kind === 'set_mode'), []);
    assert.ok(Math.abs((await robot()).setpoint_m - 0.06) < 1e-6);
  },
};

// A Chromium of its own: it is stopped as a whole.
const open_pages = async () => {
  await bench.open_browser();
};

export const story = { bench, steps, open: open_pages };
