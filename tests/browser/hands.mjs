// What hands do on a page that a busy machine may stop for a moment at any time: what such a moment has ended, as it must, is
// begun again.
import assert from 'node:assert/strict';
import { until } from './programs.mjs';

export const mode_of = (page) => page.locator('.annunciator').getAttribute('data-mode');
export const seen_mode = (page, wanted) => until(`the page shows ${wanted}`, async () => (await mode_of(page)) === wanted);
export const live = (page) => until('samples arrive', async () => (await page.locator('.readouts.stale').count()) === 0);

// The page has drawn what it knew when this was called.
export const drawn = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done)))));

// Goes to an address within the page; the page has followed it when this returns, so that a key after it is pressed there.
export const go_to = (page, hash) =>
  page.evaluate((hash) => new Promise((done) => {
    if (location.hash === hash) return done();
    addEventListener('hashchange', () => setTimeout(done), { once: true });
    location.hash = hash;
  }), hash);

// What the page shows of it becomes this.
export async function shows(page, selector, wanted) {
  const is_wanted = (said) => (wanted instanceof RegExp ? wanted.test(said) : said === wanted);
  let said = null;
  await until(`${selector} says ${wanted}`, async () => is_wanted((said = await page.locator(selector).first().innerText()))).catch((error) => {
    throw new Error(`${error.message}; it says ${said}`);
  });
}

// Until so many more samples of a robot are at the station, and `assert_so` holds of it all the while: by then the page
// has received, drawn and sent whatever it was going to, since samples pass through it in the same order.
export async function samples(bench, robot_id, count, assert_so = () => undefined) {
  const { next_seq } = await bench.ask(`/robots/${robot_id}`);
  await until(`${count} samples more`, async () => {
    const now = await bench.ask(`/robots/${robot_id}`);
    assert_so(now);
    return now.next_seq >= next_seq + count;
  });
}

// Signs in by name and password, at an address of the station, until `inside` is there.
export async function sign_in(page, at, user, password, inside) {
  await page.goto(at);
  await until(`${user} is signed in`, async () => {
    await page.fill('#user', user);
    await page.fill('#password', password);
    await page.click('#sign-in');
    await inside.or(page.locator('#sign-in-error:not(:empty)')).first().waitFor(); // a busy machine may be late with an answer
    return (await inside.count()) > 0;
  });
}

// Clicks it if it is there and can be clicked now. A click in a slow browser takes seconds, so it is not cut short.
export async function click_if_offered(page, selector) {
  if ((await page.locator(`${selector}:enabled`).count()) > 0) await page.click(selector, { timeout: 20_000 }).catch(() => undefined);
}

// Clicks what takes control, until `is_taken`: a picture that is too old to take control by is refused.
export const take_control = (page, is_taken) =>
  until('control is taken', async () => {
    if (await is_taken()) return true;
    await click_if_offered(page, '#take-control');
    return until('it is', is_taken, 2000).catch(() => false);
  });

// Sends a setpoint until the page says that it is in force: a command that is too old when it arrives is refused.
export const send_setpoint = (page, setpoint_mm) =>
  until(`the setpoint ${setpoint_mm} mm is in force`, async () => {
    await page.locator('#send-setpoint:enabled').waitFor();
    await page.fill('#setpoint-entry', String(setpoint_mm));
    await page.press('#setpoint-entry', 'Enter');
    const outcome = page.locator('#setpoint-outcome');
    const phase = await until('its outcome', async () => /done|failed/.exec(await outcome.getAttribute('class'))?.[0], 10_000).catch(() => null);
    return phase === 'done';
  });

export async function engage_auto(page, setpoint_mm) {
  await send_setpoint(page, setpoint_mm);
  await seen_mode(page, 'auto');
}

// Until the robot's motor runs by this hand: a lease that lapses meanwhile has let go of it.
export const held = (page, runs, begin, end) =>
  until('the duty runs', async () => {
    await begin();
    if (await until('it runs', runs, 8000).catch(() => false)) return true;
    await end();
    await live(page);
    return false;
  });
export const hold_by_mouse = (page, runs) =>
  held(page, runs, () => page.locator('#hold-to-run').hover().then(() => page.mouse.down()), () => page.mouse.up());

// Holds a guarded button until `done`.
export const hold = (page, selector, what, done) =>
  until(what, async () => {
    if (await done()) return true;
    const button = page.locator(selector);
    if ((await button.count()) === 0) return false;
    const at_hand = async () => {
      if (!(await button.isEnabled({ timeout: 2000 }))) return false;
      await button.scrollIntoViewIfNeeded({ timeout: 2000 });
      await button.hover({ timeout: 2000 });
      return true;
    };
    if (!(await at_hand().catch(() => false))) return false; // it was drawn anew, or has gone
    await page.mouse.down();
    await until(what, done, 8000).catch(() => undefined);
    await page.mouse.up();
    return done();
  });

// Clears the latch until the page shows manual.
export async function clear_latch(page) {
  await page.locator('#latch').waitFor();
  await hold(page, '#clear-emergency', 'the latch is cleared', async () => (await mode_of(page)) === 'manual');
}

// The answer to a script's command, 200. A machine that stood still may have ended the robot's link, or have let the command
// expire: then it is given again once the robot is there, and has sent what a step counts from.
export async function commanded(bench, robot_id, body) {
  return until(`${JSON.stringify(body)} is carried out`, async () => {
    const { status, answer } = await bench.post(`/robots/${robot_id}/commands`, body);
    if (status === 504 || answer.reason === 'not_connected' || / has just connected,/.test(answer.detail)) return false;
    assert.equal(status, 200, JSON.stringify(answer));
    return answer;
  });
}

// The robot in auto with this setpoint, sent there by a script. A link that a busy machine broke has ended auto: it is sent
// there again.
export const in_auto = (bench, robot_id, setpoint_m) =>
  until(`${robot_id} is in auto at ${setpoint_m} m`, async () => {
    const now = await bench.ask(`/robots/${robot_id}`);
    if (now.mode === 'auto' && Math.abs(now.setpoint_m - setpoint_m) < 1e-6) return true;
    await commanded(bench, robot_id, { kind: 'set_mode', mode: 'auto', setpoint_m });
    return false;
  });

// The same as a script does it. The page may send a stop a second time, which may come after the first clear: the robot stays
// in manual for a second of samples, by which the page knows that it was stopped.
export const clear_by_script = (bench, robot_id) =>
  until('the latch is cleared', async () => {
    const { mode, emergency_id } = await bench.ask(`/robots/${robot_id}`);
    if (mode === 'manual') {
      await samples(bench, robot_id, 100);
      return (await bench.ask(`/robots/${robot_id}`)).mode === 'manual';
    }
    if (emergency_id !== null) await bench.post(`/robots/${robot_id}/commands`, { kind: 'clear_emergency', emergency_id });
    return false;
  });

// In the page: how long it has run since a moment by its clock (performance.timeOrigin + performance.now()), without the
// time in which the machine did not run it. A time limit of the page itself is compared with this.
export const count_running_time = (page) =>
  page.evaluate(() => {
    if (window.running) return;
    window.running = [];
    let last_ms = performance.now();
    setInterval(() => {
      const now_ms = performance.now();
      window.running.push({ at_ms: performance.timeOrigin + now_ms, ran_ms: Math.min(now_ms - last_ms, 50) });
      last_ms = now_ms;
    }, 20);
  });
export const running_time = (page, from_ms, to_ms) =>
  page.evaluate(([from_ms, to_ms]) => ({
    counted_ms: window.running.at(-1)?.at_ms ?? 0,
    ran_ms: window.running.filter(({ at_ms, ran_ms }) => at_ms > from_ms && at_ms - ran_ms < to_ms).reduce((sum, each) => sum + each.ran_ms, 0),
  }), [from_ms, to_ms]);

// From now on each value that an attribute of it has, in the order in which it had them: one that a busy machine shows for
// a moment only is not missed.
export async function watch_attribute(page, selector, name) {
  const values = await page.locator(selector).first().evaluateHandle((element, name) => {
    const values = [element.getAttribute(name)];
    new MutationObserver(() => values.push(element.getAttribute(name))).observe(element, { attributes: true, attributeFilter: [name] });
    return values;
  }, name);
  return () => values.jsonValue();
}

// How much of the estimate's trace, the brightest colour of the dark page, is in a share of the first strip.
export const trace_pixels = (page, from, to) =>
  page.locator('.strip-0 canvas').first().evaluate(
    (canvas, [from, to]) => {
      const ratio = devicePixelRatio;
      const [left, width] = [58 * ratio, canvas.width - 76 * ratio];
      const x = Math.round(left + from * width);
      const image = canvas.getContext('2d').getImageData(x, 20 * ratio, Math.max(1, Math.round((to - from) * width)), canvas.height - 60 * ratio);
      let bright = 0;
      for (let at = 0; at < image.data.length; at += 4) if (image.data[at] > 225 && image.data[at + 1] > 225 && image.data[at + 3] > 200) bright += 1;
      return bright;
    },
    [from, to],
  );

export const assert_near = (value, wanted, by, what) => assert.ok(Math.abs(value - wanted) < by, `${what}: ${value}, not ${wanted}`);
