// Two pages that fight for one robot, every way in which a hand leaves a held control, a tab that ends under it, and a page
// that slept: whatever happens, one commands at a time, a duty ends, and nothing that was held is sent afterwards.
import assert from 'node:assert/strict';
import { another_browser, Bench, run, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kPassword = 'correct horse battery';
const kLongestRest_samples = 150; // a renewal is worth 400 ms, the lease it gives 500 ms; the rest is for samples on their way
const kShown_ms = 300; // of the time in which the page runs
const bench = new Bench();
let anna, ben, sleeper, sleeping_browser;

const robot = () => bench.ask(`/robots/${kRobot}`);
const holder = async () => (await robot()).control?.holder ?? '';
const control = (page) => page.locator('#control-line');
const is_mine = async (page) => (await page.locator('#control-line.mine').count()) === 1;
const shown_holder = (page) => control(page).getAttribute('data-holder');
const mode = (page) => page.locator('.annunciator').getAttribute('data-mode');
const runs = async () => Math.abs((await robot()).sample.duty) > 0.1;
const rests = (what) => until(`the duty is 0: ${what}`, async () => (await robot()).sample.duty === 0);
const live = (page) => until('samples arrive', async () => (await page.locator('.readouts.stale').count()) === 0);

async function sign_in(page, user) {
  await page.goto(bench.http);
  const inside = page.locator('.annunciator h1').getByText(kRobot);
  await until('signed in', async () => {
    await page.fill('#user', user);
    await page.fill('#password', kPassword);
    await page.click('#sign-in');
    await inside.or(page.locator('#sign-in-error:not(:empty)')).first().waitFor(); // a busy machine may be late with an answer
    return (await inside.count()) === 1;
  });
  await live(page);
}

async function enter_setpoint(page, setpoint_mm) {
  await page.fill('#setpoint-entry', String(setpoint_mm));
  await page.press('#setpoint-entry', 'Enter');
}

// Until the robot's motor runs by this hand. A machine that stands still lets a lease lapse; then it is let go and held anew.
async function held(page, begin, end) {
  for (let attempt = 0; attempt < 6; ++attempt) {
    await begin();
    if (await until('the duty runs', runs, 4000).catch(() => false)) return;
    await end();
    await live(page);
  }
  assert.fail('the duty never ran');
}
const by_mouse = (page) =>
  held(page, () => page.locator('#hold-to-run').hover().then(() => page.mouse.down()), () => page.mouse.up());
const by_key = (page) =>
  held(page, () => page.focus('#hold-to-run').then(() => page.keyboard.down(' ')), () => page.keyboard.up(' '));

// The samples of the next second, each of them.
async function nothing_moves(what) {
  const { next_seq } = await robot();
  await until(`another second of samples (${what})`, async () => {
    const now = await robot();
    assert.equal(now.sample.duty, 0, what);
    return now.next_seq >= next_seq + 100;
  });
}

// Nobody is in control, in manual, with the motor off.
async function at_rest(page) {
  await rests('at the beginning');
  await until('nobody is in control', async () => {
    if ((await holder()) === '') return true;
    await page.click('#release-control', { timeout: 500 }).catch(() => undefined);
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
  await enter_setpoint(other, setpoint_mm + 5);
  await other.locator('#setpoint-outcome.failed').waitFor();
  await until('who is in control commands', async () => {
    await enter_setpoint(page, setpoint_mm);
    await page.locator('#setpoint-outcome:is(.done, .failed)').waitFor();
    return (await page.locator('#setpoint-outcome.done').count()) === 1; // one that is too old is refused on a slow machine
  });
  const now = await robot();
  assert.ok(Math.abs(now.setpoint_m - setpoint_mm / 1000) < 1e-6, `${now.setpoint_m} m`);
}

// ---- a page that sleeps

// In the page, before its own code: what it sends, and from when on it shows that it knows nothing of now.
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
  setInterval(() => {
    const now_ms = performance.now();
    const gap_ms = now_ms - last_ms;
    last_ms = now_ms;
    if (gap_ms > 1500) window.wakes.push({ at_ms: now_ms, ran_ms: 0, hindered_ms: null, stale_ms: null, falsely: 0 });
    const wake = window.wakes.at(-1);
    if (!wake) return;
    wake.ran_ms += Math.min(gap_ms, 50); // without the time in which the machine did not run the page
    const hindered = document.querySelector('#emergency-stop')?.dataset.works === 'false';
    if (hindered) wake.hindered_ms ??= wake.ran_ms;
    else if (wake.hindered_ms !== null) wake.falsely += 1;
    if (document.querySelector('.readouts.stale')) wake.stale_ms ??= wake.ran_ms;
  }, 10);
}

async function processes(of_all) {
  const session = await sleeping_browser.newBrowserCDPSession();
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
        await Promise.all([anna, ben].map((page) => page.click('#take-control', { timeout: 1000 }).catch(() => undefined)));
        return (await holder()) !== '';
      });
      const winner = (await holder()).includes('anna') ? 'anna' : 'ben';
      await agree(winner);
      const [page, other] = winner === 'anna' ? [anna, ben] : [ben, anna];
      await only_commands(page, other, setpoint_mm);
      await page.click('#release-control');
      await agree('');
    }
  },

  async 'control goes to and fro by asking and handing over, and only one ever commands'() {
    await until('anna has it', async () => (await anna.click('#take-control', { timeout: 1000 }).catch(() => undefined), (await holder()).includes('anna')));
    await agree('anna');
    for (const [from, to, name, setpoint_mm] of [[anna, ben, 'ben', 40], [ben, anna, 'anna', 50]]) {
      await to.click('#ask-for-control');
      await to.locator('#ask-for-control:disabled').waitFor(); // asked, and nothing more
      assert.equal(await is_mine(to), false);
      await from.click('#hand-over');
      await agree(name);
      await only_commands(to, from, setpoint_mm);
    }
    await anna.click('#to-manual');
    await until('manual', async () => (await mode(anna)) === 'manual');
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
    const { events } = await bench.ask(`/robots/${kRobot}/events?limit=100`);
    assert.ok(events.some((event) => JSON.stringify(event).includes('ben has left the room')), 'the reason is kept');
    await at_rest(anna);
  },

  async 'whatever becomes of the hand, the duty ends and does not come back'() {
    const page = ben;
    const ways = {
      'let go outside the button': [by_mouse, async () => (await page.mouse.move(5, 5), await page.mouse.up())],
      'the pointer is taken away': [by_mouse, () => page.evaluate(() => document.querySelector('#hold-to-run').dispatchEvent(new PointerEvent('pointercancel', { bubbles: true })))],
      'another window has the focus': [by_mouse, () => page.evaluate(() => dispatchEvent(new Event('blur')))],
      'the page is hidden': [by_mouse, () => page.evaluate(() => {
        Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
        document.dispatchEvent(new Event('visibilitychange'));
        delete document.hidden;
      })],
      'the key never comes up, the focus goes': [by_key, () => page.focus('#run-name')],
      'the key never comes up, another view opens': [by_key, () => page.evaluate(() => document.querySelector('#open-fleet').click())],
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
    const { emergency_id } = await robot();
    await at_rest(ben);
    assert.equal((await bench.post(`/robots/${kRobot}/commands`, { kind: 'clear_emergency', emergency_id })).status, 200);
    await bench.post(`/robots/${kRobot}/control`, { action: 'release' });
  },

  async 'a tab that is closed, or whose process crashes, under a held duty: it ends within its lease'() {
    const ends = {
      closed: (page) => page.close(),
      crashed: (page) => Promise.race([page.goto('chrome://crash').catch(() => undefined), page.waitForEvent('crash')]),
    };
    for (const [what, end] of Object.entries(ends)) {
      const page = await bench.open_page();
      await sign_in(page, 'ben');
      await by_mouse(page);
      await end(page);
      const { next_seq: ended_seq } = await robot();
      await rests(what);
      const at = await robot();
      console.log(`    ${what}: at rest ${at.next_seq - ended_seq} samples later`);
      assert.ok(at.next_seq - ended_seq < kLongestRest_samples, what);
      const again = await page.context().newPage();
      await again.goto(`${bench.http}/#/robot/${kRobot}`);
      await again.locator('.annunciator h1').getByText(kRobot).waitFor();
      await live(again);
      await nothing_moves(`${what}, and opened again`);
      assert.equal(await again.locator('#hold-to-run.running').count(), 0);
      await until('control has ended', async () => (await holder()) === '');
      await page.context().close();
    }
  },

  async 'a page that wakes while the station stands still shows in time that it knows nothing of now'() {
    sleeping_browser = await another_browser();
    sleeper = await (await sleeping_browser.newContext()).newPage();
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
      const shown = await until('it shows both', async () => {
        const now = await wake();
        return now.hindered_ms !== null && now.stale_ms !== null && now.ran_ms > 1000 && now;
      });
      console.log(`    ${what}: a stop that would not work is shown ${Math.round(shown.hindered_ms)} ms after it runs again, stale numerals after ${Math.round(shown.stale_ms)} ms`);
      assert.ok(shown.hindered_ms < kShown_ms, `${shown.hindered_ms} ms`);
      assert.ok(shown.stale_ms < kShown_ms, `${shown.stale_ms} ms`);
      assert.equal((await wake()).falsely, 0, 'and never that it would');
      bench.station.process.kill('SIGCONT');
      await live(sleeper);
      await nothing_moves(`${what}, and the button is still held`);
      const sent = await sent_since(shown.at_ms - 50);
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
    assert.deepEqual((await sent_since((await wake()).at_ms - 50)).filter((each) => each.duty), []);
    await sleeper.mouse.up();
    await at_rest(sleeper);

    await until('auto at 40 mm', async () => {
      await enter_setpoint(sleeper, 40);
      return until('auto', async () => (await robot()).mode === 'auto', 3000).catch(() => false);
    });
    await sleeper.click('#setpoint-ghost', { timeout: 5000, force: true }).catch(() => undefined);
    await sleeper.focus('#setpoint-ghost');
    await sleeper.keyboard.press('ArrowRight'); // moved, and not sent
    const woken = await asleep(true, async () => {
      await until('control has expired', async () => (await holder()) === '');
      assert.equal((await bench.post(`/robots/${kRobot}/commands`, { kind: 'set_setpoint', setpoint_m: 0.06 })).status, 200);
    });
    await live(sleeper);
    await until('the page shows the setpoint in force', async () => /60/.test(await sleeper.locator('#numeral-setpoint output').innerText()));
    const sent = await sent_since((await woken()).at_ms - 50);
    assert.deepEqual(sent.filter((each) => each.kind === 'set_setpoint' || each.kind === 'set_mode'), []);
    assert.ok(Math.abs((await robot()).setpoint_m - 0.06) < 1e-6);
    await sleeping_browser.close();
  },
};

await run(bench, steps, async () => {
  await bench.open_browser();
});
