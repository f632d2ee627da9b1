// A run that is replayed: its numbers are the recorded ones, it moves as it is told, and nothing in it acts on a robot but
// the stop.
//
//   stories.mjs [--pictures FOLDER] replay
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { assert_accessible } from './accessible.mjs';
import { clear_by_script, commanded, drawn, go_to, hold_by_mouse, samples, watch_attribute } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const pictures_at = process.argv.indexOf('--pictures');
const pictures = pictures_at > 0 ? process.argv[pictures_at + 1] : null;
const bench = new Bench();
const faults = [];
const posted = []; // by the page
let page;
let recorded; // the samples of run 1

// ---- a small vocabulary

const text = (selector) => page.locator(selector).first().innerText();
const robot = () => bench.ask(`/robots/${kRobot}`);
const picture = async (name) => pictures && page.screenshot({ path: join(pictures, `${name}.png`) });
const open = (hash) => go_to(page, hash);
const query = () => new URLSearchParams(page.url().split('?')[1] ?? '');
const at_s = () => Number(query().get('at'));
const command_rows = async () => (await bench.ask(`/robots/${kRobot}/commands?limit=1000`)).commands.length;
const length_s = () => (recorded.at(-1).utc_us - recorded[0].utc_us) / 1e6;
const command = (body) => commanded(bench, kRobot, body);
const seconds = (count) => samples(bench, kRobot, count * 100);

// The sample at or next before a moment of the run.
const sample_at = (moment_s) => {
  const utc_us = Math.round(recorded[0].utc_us + moment_s * 1e6);
  return recorded.filter((sample) => sample.utc_us <= utc_us).at(-1);
};
const number = (value, decimals = 1) => {
  const said = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(said) !== 0 ? `\u2212${said}` : said;
};

// What the numerals must be at a moment, by the recording.
function numerals_of(sample) {
  const millimetres = (value_m) => (value_m === null ? '–' : number(value_m * 1e3));
  return {
    position: millimetres(sample.position_m - sample.disturbance_m),
    seen: millimetres(sample.position_m),
    setpoint: millimetres(sample.setpoint_m),
    duty: number(sample.duty * 100),
    velocity: millimetres(sample.velocity_m_s),
    impedance: number(sample.impedance_mv),
  };
}
const numerals = () =>
  page.evaluate(() =>
    Object.fromEntries(
      [...document.querySelectorAll('.replay .numeral[id]')].map((each) => [
        each.id.replace('numeral-', ''),
        each.querySelector('output').textContent,
      ]),
    ),
  );
async function assert_numerals(moment_s) {
  const wanted = numerals_of(sample_at(moment_s));
  await until(`the numerals of ${moment_s} s: ${JSON.stringify(wanted)}`, async () =>
    JSON.stringify(await numerals()) === JSON.stringify(wanted)).catch(async (error) => {
    assert.deepEqual(await numerals(), wanted, `at ${moment_s} s (${error.message})`);
  });
}
// The first moment after which nothing was recorded for a second.
const gap = () => {
  const at = recorded.findIndex((sample, i) => i > 0 && sample.utc_us - recorded[i - 1].utc_us > 1e6);
  const since = (utc_us) => (utc_us - recorded[0].utc_us) / 1e6;
  return { from_s: since(recorded[at - 1].utc_us), to_s: since(recorded[at].utc_us) };
};

const steps = {
  async 'a run with a step, a disturbance and a gap is recorded'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await command({ kind: 'zero_position' });
    assert.equal((await bench.post('/runs', { robot_id: kRobot, name: 'Step in water', fluid: 'water' })).status, 201);
    await seconds(1);
    await bench.post(`/robots/${kRobot}/markers`, { text: 'light on' });
    await command({ kind: 'set_mode', mode: 'auto', setpoint_m: 0.05 });
    await seconds(4);
    await command({ kind: 'inject_disturbance', disturbance_m: -0.02 });
    await seconds(3);
    await bench.robot.end();
    await page.waitForTimeout(2500); // in which there is no robot
    bench.start_robot(kRobot);
    await until('it is back', async () => (await robot()).link === 'connected');
    await seconds(3);
    await bench.post('/runs/1/end', {});
    recorded = (await bench.ask('/runs/1/samples?limit=10000')).samples;
    assert.ok(recorded.length > 1000 && length_s() > 12, `${recorded.length} samples, ${length_s()} s`);
  },

  async 'its page leads to the replay, which says that it is the past'() {
    await open('#/runs/1');
    await page.click('#open-replay');
    await page.locator('#scrub-bar').waitFor();
    assert.match(await text('#replay-sign'), /^replay · run 1 · \d{4}-\d\d-\d\d \d\d:\d\d · past$/i);
    assert.equal(await page.locator('.annunciator small').innerText(), 'past');
    await assert_numerals(0);
    await picture('replay');
  },

  async 'no control of a robot is in the page but the stop'() {
    const found = await page.evaluate(() => {
      const interactive = 'button, input, select, textarea, [role=slider], [role=combobox], [tabindex], a[href]';
      return [...document.querySelectorAll(interactive)].map((each) => {
        const place = each.parentElement.closest('[class]').className;
        return each.matches('a[href^="#"]') ? 'link' : each.id || `${each.tagName.toLowerCase()} in ${place}`;
      });
    });
    const allowed =
      /^(link|log-out|show-keys|stop-all|emergency-stop|show-stop-note|show-alarms|alert-(sound|notification)|replay-[a-z-]+|scrub-bar|plots-(clock|xy|traces)|button in (spans|bar)|div in plots|ol in replay-log log-strip)$/;
    const others = found.filter((each) => !allowed.test(each));
    assert.deepEqual(others, []);
    for (const id of ['#setpoint-ghost', '#hold-to-run', '#clear-emergency', '#control-line', '#gamepad-line', '.controls'])
      assert.equal(await page.locator(id).count(), 0, id);
    assert.equal(await page.locator('.emergency-stop').count(), 1);
  },

  async 'numbers at a moment are those of the sample that was recorded then'() {
    for (const moment_s of [0.5, 2.345, 3, 6.42, length_s() - 1]) {
      await open(`#/runs/1/replay?at=${moment_s}`);
      await assert_numerals(moment_s);
    }
    const last = recorded.at(-1);
    await page.locator('body').press('End');
    await assert_numerals((last.utc_us - recorded[0].utc_us) / 1e6);
    assert.equal(await page.locator('.replay .annunciator').getAttribute('data-mode'), last.mode);
  },

  async 'a link leads to a moment and a speed'() {
    await open('#/runs/1/replay?at=3.21&speed=10');
    await page.reload();
    await page.locator('#scrub-bar').waitFor();
    await assert_numerals(3.21);
    assert.match(await text('#replay-speed'), /^10 ×/);
    assert.match(await text('#replay-moment'), /^3\.21 s of/);
  },

  async 'what an address cannot mean is said with its value'() {
    await open('#/runs/1/replay?at=soon&speed=1000');
    await page.locator('#replay-note').getByText('“at=soon” in the address is no moment').waitFor();
    await seconds(1);
    assert.match(await text('#replay-note'), /“at=soon”.*“speed=1000” in the address is no speed from 0\.1 to 100/, 'it stays until somebody moves');
    await assert_numerals(0);
  },

  async 'it plays ten times as fast, to the end'() {
    await open('#/runs/1/replay?at=0&speed=10');
    await assert_numerals(0);
    const presses = await watch_attribute(page, '#replay-play', 'aria-pressed');
    const began_ms = performance.now();
    await page.locator('body').press(' ');
    await until('it has begun, and is at its end', async () => (await presses()).join() === 'false,true,false');
    const took_s = (performance.now() - began_ms) / 1000;
    assert.ok(took_s > (length_s() / 10) * 0.9, `${took_s} s for ${length_s()} s`);
    await assert_numerals(length_s());
    await until('the address follows', async () => Math.abs(at_s() - length_s()) < 1e-3);
  },

  async 'the bar is dragged to a moment'() {
    const { x, y, width, height } = await page.locator('#scrub-bar').boundingBox();
    await page.mouse.move(x + width * 0.1, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width * 0.4, y + height / 2, { steps: 8 });
    await page.mouse.up();
    await until('the address follows', async () => Math.abs(at_s() - 0.4 * length_s()) < 0.05);
    await assert_numerals(at_s());
    assert.ok((await page.locator('#scrub-bar i.marker').count()) >= 1);
    assert.ok((await page.locator('#scrub-bar .scrub-gap').count()) >= 1);
  },

  async 'keys step from sample to sample, and to the next thing that happened'() {
    await open('#/runs/1/replay?at=3');
    await assert_numerals(3);
    const before = recorded.indexOf(sample_at(3));
    const since = (sample) => (sample.utc_us - recorded[0].utc_us) / 1e6;
    await page.locator('body').press('ArrowRight');
    await until('the next sample', async () => Math.abs(at_s() - since(recorded[before + 1])) < 2e-6);
    await page.locator('body').press('ArrowLeft');
    await until('the one before', async () => Math.abs(at_s() - since(recorded[before])) < 2e-6);
    const disturbed = (await bench.ask(`/robots/${kRobot}/commands?limit=1000`)).commands.find(({ kind }) => kind === 'inject_disturbance');
    const disturbed_s = (disturbed.submitted_at_us - recorded[0].utc_us) / 1e6; // a busy machine may carry it out later
    await open(`#/runs/1/replay?at=${disturbed_s - 0.2}`);
    await assert_numerals(disturbed_s - 0.2);
    await page.locator('.replay-log li').first().waitFor(); // what happened is known
    // A gap of a busy machine may come before it; and the robot's event, by its clock, just before the command, by the
    // station's.
    const listed = page.locator('.replay-log').getByText('disturbance −20.0 mm').first();
    do {
      const from_s = at_s();
      await page.locator('body').press('PageDown');
      await until('the next thing that happened', async () => at_s() > from_s);
      await drawn(page);
    } while (!(await listed.isVisible()) && at_s() < disturbed_s);
    assert.ok(Math.abs(at_s() - disturbed_s) < 0.1, `it stepped to ${at_s()} s, and not to ${disturbed_s} s`);
    await listed.waitFor();
    const shown = await page.locator('.replay-log li').allInnerTexts();
    assert.ok(!shown.some((line) => /disconnected|connection/.test(line)), 'nothing of later is listed');
  },

  async 'a gap is a gap: no value, a word, and nothing drawn'() {
    const { from_s, to_s } = gap();
    await open(`#/runs/1/replay?at=${((from_s + to_s) / 2).toFixed(3)}`);
    await page.locator('.replay .readouts.stale').waitFor();
    await page.locator('.replay .silent').getByText('no sample for').waitFor();
    const long = (to_s - from_s).toFixed(2).replace(/0$/, '');
    assert.match(await text('#replay-note'), new RegExp(`^A gap, ${long} s long: no sample was recorded here since .* The robot made none`));
    const { x, y, width, height } = await page.locator('.strip-0 .plot').boundingBox();
    await page.mouse.move(x + width - 20, y + height / 2); // at the moment itself
    await until('the cursor finds none', async () => /^no sample/.test(await text('.strip-0 .cursor')));
    await page.mouse.move(5, 5);
    await page.locator('body').press('ArrowRight');
    await until('a step leads over it', async () => Math.abs(at_s() - to_s) < 2e-6);
    await picture('gap');
  },

  async 'no key and no gamepad sends anything'() {
    await open('#/runs/1/replay?at=3');
    await assert_numerals(3);
    const rows = await command_rows();
    posted.length = 0;
    await page.evaluate(() => {
      const pad = { index: 0, id: 'pad', connected: true, mapping: 'standard', axes: [1, 1, 0, 0], buttons: Array.from({ length: 16 }, (_, at) => ({ pressed: at !== 1 })) };
      navigator.getGamepads = () => [pad];
      dispatchEvent(new Event('gamepadconnected'));
    });
    const letters = [...'abcdefhijklmnopqrstuvwxyz0123456789+-.,/ ']; // g leads to another view
    const named = ['ArrowUp', 'ArrowDown', 'ArrowLeft', 'ArrowRight', 'PageUp', 'PageDown', 'Home', 'End', 'Enter', 'Backspace', 'Delete', 'Insert'];
    for (const place of ['body', '.replay .strips', '#scrub-bar', '.emergency-stop']) {
      if (place !== 'body') await page.focus(place);
      for (const key of [...letters, ...named]) {
        if (place === '.emergency-stop' && key === 'Enter') continue; // presses it
        await page.keyboard.down(key);
        await page.keyboard.up(key);
      }
    }
    for (const key of ['Shift+ArrowRight', 'Shift+ArrowLeft', 'Control+Enter', 'Shift+PageUp']) await page.keyboard.press(key);
    await seconds(1);
    assert.equal(await command_rows(), rows);
    assert.deepEqual(posted, []);
    assert.equal((await robot()).control, null);
    assert.match(page.url(), /runs\/1\/replay/);
  },

  async 'Escape stops the robot that is live, and the replay stays where it is'() {
    await open('#/runs/1/replay?at=3');
    await assert_numerals(3);
    await page.keyboard.press('Escape');
    await until('the robot is latched', async () => (await robot()).mode === 'emergency');
    await page.locator('#latch').getByText('A replay is shown.').waitFor();
    assert.equal(await page.locator('#clear-emergency').count(), 0);
    assert.equal(await page.locator('.replay .annunciator').getAttribute('data-mode'), sample_at(3).mode);
    await assert_numerals(3);
    await clear_by_script(bench, kRobot);
    assert.equal((await bench.post(`/robots/${kRobot}/control`, { action: 'release' })).status, 200);
  },

  async 'a duty that is held ends when a replay is opened, and is not renewed from there'() {
    await open(`#/robot/${kRobot}`);
    await until('it can be driven', async () => (await page.locator('#hold-to-run:enabled').count()) === 1);
    await hold_by_mouse(page, async () => Math.abs((await robot()).sample.duty) > 0.1);
    await open('#/runs/1/replay?at=2');
    await until('the duty ends', async () => (await robot()).sample.duty === 0);
    await samples(bench, kRobot, 100, ({ sample }) => assert.equal(sample.duty, 0));
    await page.mouse.up();
  },

  async 'a run that is not there says so, and where to go on'() {
    await open('#/runs/99/replay');
    await page.locator('#no-replay').getByText('This run cannot be replayed').waitFor();
    await open('#/runs/1/replay?at=6');
    await assert_numerals(6);
  },

  async 'everybody can use it, at every size'() {
    await assert_accessible(page, 'a replay');
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => /Content.Security.Policy|violates/i.test(message.text()) && faults.push(message.text()));
  page.on('request', (request) => request.method() !== 'GET' && posted.push(`${request.method()} ${request.url()}`));
};

export const story = { bench, steps, open: open_pages };
