// Design on the page: from runs that a simulated robot records to a model, a controller, its way to the robot and back,
// and the comparison with what was predicted; links, undo, the stop, and how it fits on every screen.
import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { assert_accessible } from './accessible.mjs';
import { clear_by_script, drawn, shows, watch_attribute } from './hands.mjs';
import { Bench, kLongestWait_ms, until } from './programs.mjs';

const kRobot = 'sim-1';
const bench = new Bench();
let page;
let fitted_run;

const text = (selector) => page.locator(selector).first().innerText();
const state = (step) => page.locator(`#design-part-${step}`).getAttribute('data-state');
const is_in_state = (step, wanted) => until(`step ${step} is ${wanted}`, async () => (await state(step)) === wanted);
const address = () => page.evaluate(() => decodeURIComponent(location.hash));
const says = (what) => until(`the address says ${what}`, async () => (await address()).includes(what));
const of_station = () => until('the station has answered', async () => (await page.locator('#design-achieved').getAttribute('data-source')) === 'station');
const law_of = (said) => /kp ([\d.]+), kd ([\d.]+), μ ([\d.]+)/.exec(said)?.slice(1).map(Number);
const law = async () => law_of(await text('#design-law'));
const in_force = async () => (await bench.ask(`/robots/${kRobot}/controller`)).controller;

async function choose(id, option) {
  await page.click(`#${id}`);
  await page.locator(`#${id}-list li`).getByText(option).click();
}

// A robot that does what the profile says, as a script begins it; its run.
async function recorded(name, limits, steps) {
  const file = join(bench.data, `${name}.toml`);
  writeFileSync(file, `name = "${name}"\npurpose = "For the test of the page."\n\n[limits]\n${limits}\n\n${steps}`);
  // A machine that lets the script give no sign of life for seconds has the experiment aborted, as it must be.
  const begin = () => bench.cli(['experiment', 'begin', file, '--robot', kRobot, '--wait']).then(() => true, (error) => void console.error(error.message));
  await until(`${name} is done`, begin, 3 * kLongestWait_ms);
  return (await bench.ask('/runs?limit=1')).runs[0];
}

const steps = {
  async 'without a run the view says how to get one, and a model of the paper is there to begin with'() {
    bench.start_robot(kRobot);
    await bench.sign_in(page);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await page.keyboard.press('g');
    await page.keyboard.press('d');
    await page.locator('#design-part-runs a', { hasText: 'Record an identification set' }).waitFor();
    for (const step of ['runs', 'identify', 'tune', 'push']) await is_in_state(step, 'needs');
    await choose('design-plant', 'fabric softener');
    await of_station();
    await shows(page, '#design-tune-state', /^done in \d/);
    const [kp, kd, mu] = await law(); // tests/data/tuning_solutions.json, 3 rad/s and 90 degrees
    assert.ok(Math.abs(kp - 29.971) < 1e-3 && Math.abs(kd - 0.10524) < 1e-4 && Math.abs(mu - 0.9455) < 1e-4, `${kp}, ${kd}, ${mu}`);
    await page.locator('#design-map .feasible').first().waitFor();
    await page.locator('#design-step path.curve').waitFor();
    await shows(page, '#design-predicted', /tuned for\s+1\.8\d/);
  },

  async 'a slider is followed at once by the page, and when it rests by the station; each rest is a step that is undone'() {
    const slider = page.locator('#design-margin-slider');
    const box = await slider.boundingBox();
    await page.mouse.move(box.x + box.width * 0.52, box.y + box.height / 2);
    await page.mouse.down();
    // The slider rests when it was not moved for a moment: what the page says until then is read in one look at it.
    let at = 0;
    const own = await until('the page answers at once', async () => {
      const share = [0.54, 0.56, 0.58][at++ % 3];
      await page.mouse.move(box.x + box.width * share, box.y + box.height / 2);
      await drawn(page);
      const [source, caption, preliminary, said] = await page.evaluate(() => {
        const said = (selector) => document.querySelector(selector)?.innerText ?? '';
        return [document.querySelector('#design-achieved')?.dataset.source, said('#design-achieved caption'),
                document.querySelectorAll('#design-bode-phase path.loop.preliminary').length, said('#design-law')];
      });
      return at > 3 && source === 'page' && /by this page, until the slider rests/.test(caption) && preliminary === 1 && law_of(said);
    });
    await page.mouse.up();
    await says('margin=');
    await of_station();
    const answered = await law();
    own.forEach((value, at) => assert.ok(Math.abs(value / answered[at] - 1) < 1e-3, `the page ${own}, the station ${answered}`));
    const margin_now = () => page.locator('#design-margin').inputValue();
    const changes = async (how) => {
      const before = await margin_now();
      await how();
      return until('the margin changes', async () => (await margin_now()) !== before && margin_now());
    };
    const margin = await margin_now();
    let rests = 1; // more where the machine stood still while the slider was moved
    while ((await changes(() => page.click('#design-undo'))) !== '90') ++rests;
    for (let n = 1; n < rests; ++n) await changes(() => page.click('#design-redo'));
    assert.equal(await changes(() => page.click('#design-redo')), margin);
    for (let n = 1; n < rests; ++n) await changes(() => page.goBack());
    assert.equal(await changes(() => page.goBack()), '90', '"back" is the same undo');
    assert.ok(await page.locator('#design-undo').isEnabled());
    assert.ok(await page.locator('#design-redo').isEnabled());
  },

  async 'what cannot be had says why, what is near, and the map takes a press'() {
    await page.fill('#design-crossover', '65');
    await page.press('#design-crossover', 'Enter');
    await says('crossover=65');
    await page.fill('#design-margin', '72');
    await page.press('#design-margin', 'Enter');
    await is_in_state('tune', 'failed');
    await shows(page, '#design-refused', /theta = 107\.\d+ degrees/);
    await shows(page, '#design-map-note', /outside of the region/);
    await page.locator('#design-refused button').first().click();
    await is_in_state('tune', 'done');
    await page.fill('#design-margin', '500');
    await page.press('#design-margin', 'Enter');
    await shows(page, '.design-slider .problem', /“500” is no number from 1 to 170 °/);
    const map = page.locator('#design-map');
    const { width, height } = await map.boundingBox();
    await map.click({ position: { x: width * 0.3, y: height * 0.35 } });
    await until('the map was asked', async () => Number(await page.locator('#design-margin').inputValue()) > 95);
    await is_in_state('tune', 'done');
    await choose('design-plant', 'water');
    await says('paper=28');
    await of_station();
  },

  async 'a model is identified from a run, with its progress, and validated on what was not fitted'() {
    const { status } = await bench.post(`/robots/${kRobot}/fluid`, { fluid: 'non_newtonian' });
    assert.equal(status, 200);
    const { run_id } = await recorded('Excited', 'duty_max = 0.6', '[[step]]\nkind = "rest"\nfor_s = 1\n\n[[step]]\nkind = "prbs"\namplitude = 0.6\nbit_s = 0.2\nfor_s = 10\n');
    fitted_run = run_id;
    await page.goto(`${bench.http}/#/runs/${run_id}`);
    await page.click('#run-to-design');
    await page.locator(`#design-run-${run_id}:checked`).waitFor();
    await choose('design-structure', 'second order');
    await page.fill('#design-to', '8');
    await page.press('#design-to', 'Enter');
    await says('to=8');
    await page.fill('#design-limit', '290');
    await page.press('#design-limit', 'Enter');
    await says('limit=290');
    await choose('design-validation', `the rest of run ${run_id}`);
    await says(`validation=${run_id}`);
    const states = await watch_attribute(page, '#design-part-identify', 'data-state');
    await page.click('#design-identify');
    await until('the page says that it runs', async () => (await states()).includes('running'));
    await says('fit=');
    await is_in_state('identify', 'done');
    const [, kp, sigma] = /kp m\/s per duty\s+([\d.]+) ± ([\d.]+)/.exec(await text('#design-parameters'));
    assert.ok(Math.abs(kp - 0.1) < 0.05 && sigma > 0, `kp ${kp} ± ${sigma}`);
    await shows(page, '#design-validated', /validated on run \d+, not fitted\s+\d\d\.\d/);
    await page.locator('.design-fit-rest canvas').waitFor(); // recorded values are above it if no tick was missed
    await shows(page, '.design-sentences', /the robot’s position is an estimate/);
    const shown = await text('#design-parameters');
    await page.reload();
    await is_in_state('identify', 'done');
    await shows(page, '#design-parameters', shown); // a link leads to the same fit
    await until('with its interval', async () => (await page.locator('#design-to').inputValue()) === '8');
  },

  async 'the model is kept, tuned for, and the controller goes to the robot and is read back bit for bit'() {
    await page.fill('#design-model-name', 'softener');
    await page.click('#design-keep-model');
    await says('model=1');
    // What the recording gives is not the same each time: the specification may be out of reach, and what is near is taken.
    if (await until('it is tuned, or refused', async () => /done|failed/.exec(await state('tune'))?.[0]) === 'failed') {
      await page.locator('#design-refused button').first().click();
    }
    await of_station();
    await shows(page, '#design-achieved', /Crossover, rad\/s\s+[\d.]+\s+[\d.]+ ± [\d.]+[\s\S]*Phase margin, °\s+[\d.]+\s+[\d.]+ ± [\d.]+/);
    await page.locator('#design-keep-controller:enabled').click();
    await says('controller=2');
    await page.locator('#design-coefficients').waitFor();
    await is_in_state('push', 'ready');
    const before = await in_force();
    await page.locator('#design-push:enabled').click();
    await is_in_state('push', 'done');
    await shows(page, '#design-read-back', /^(\d+) of \1 coefficients are the same bit for bit/);
    const after = await in_force();
    assert.notEqual(after.checksum, before.checksum);
    assert.equal(Math.fround(after.kp), Math.fround((await bench.ask('/designs/2')).document.kp));
    await until('the page says who is in control', async () =>
      (await page.locator('#control-line').getAttribute('data-holder')) === (await bench.ask(`/robots/${kRobot}`)).control?.holder);
    await page.click('#design-restore');
    await is_in_state('push', 'ready');
    assert.equal((await in_force()).checksum, before.checksum);
    await page.locator('#design-push:enabled').click();
    await is_in_state('push', 'done');
  },

  async 'the model goes to the robot, too, which holds it, assumes it, or cannot take it'() {
    const { estimator } = (await bench.ask('/designs/1')).document;
    if (estimator.refused) {
      await shows(page, '#design-model-note', /cannot take softener: /);
      return assert.ok(await page.locator('#design-send-model').isDisabled());
    }
    await page.locator('#design-send-model:enabled').click();
    await shows(page, '#design-model-note', /sim-1 (holds|assumes) the model of non-Newtonian \(fit error [\d.]+ %\)/);
    const { model } = await bench.ask(`/robots/${kRobot}`);
    assert.equal(model.fit_error, estimator.fit_error);
  },

  async 'what the robot did stands beside what was predicted, and as its belief'() {
    await page.locator('#release-control').click();
    await page.locator('#take-control').waitFor();
    const { run_id } = await recorded('Step', 'position_min_m = -0.3\nposition_max_m = 0.3', '[[step]]\nkind = "setpoint"\nsetpoint_m = 0.1\nfor_s = 4\n');
    await choose('design-verified', `run ${run_id}: Step`);
    await page.locator('#design-compared').waitFor();
    await shows(page, '#design-compared', /setpoint, [−\d]+ to 100 mm[\s\S]*estimate ± \d/);
    await page.locator('#design-verify-0 path.measured').first().waitFor();
    await page.locator('#design-verify-0 path.spread').first().waitFor();
    await shows(page, '#design-part-verify', /says what the robot believed, not where it was/);
    await page.locator('#design-verify-link[href*="profile=figure_7&robot=sim-1"]').waitFor();
    await says(`verified=${run_id}`);
  },

  async 'a link repeats all of it on another page, and models and controllers are listed with their origin'() {
    const link = await page.evaluate(() => location.href);
    await page.goto(`${bench.http}/#/fleet`);
    await page.goto(link);
    for (const step of ['runs', 'identify', 'tune', 'push', 'verify']) await is_in_state(step, 'done');
    await shows(page, '#design-list', new RegExp(`controller\\s+model 1, softener[\\s\\S]*softener\\s+model\\s+run ${fitted_run}\\b`));
    assert.ok(await page.locator('#design-undo').isDisabled(), 'what lies before the view is no step of it');
    await page.click('#design-to-verify');
    await until('the step is in sight', async () => (await page.locator('#design-part-verify').boundingBox()).y < 600);
    assert.ok((await page.locator('#emergency-stop').boundingBox()).y > 0, 'SAFETY: a jump to a step leaves the stop button in sight');
    await page.click('#open-fleet');
    await page.locator('#fleet-list li').first().waitFor();
    await page.click('#open-design');
    await is_in_state('verify', 'done');
    await says('controller=2'); // the view goes on where it was left
  },

  async 'it fits on every screen, and axe-core finds nothing'() {
    await assert_accessible(page, 'design');
    await page.setViewportSize({ width: 1440, height: 900 });
  },

  async 'nothing can be sent while the page is cut off, and what the robot ran is not shown as present'() {
    await page.locator('#design-push:enabled').waitFor();
    bench.station.process.kill('SIGSTOP');
    try {
      await page.locator('#design-push:disabled').waitFor();
      await shows(page, '#design-push-note', /Cut off from the station/);
      await shows(page, '#design-push-state', /what it runs now is not known/);
      await page.locator('#design-coefficients.stale').waitFor();
    } finally {
      bench.station.process.kill('SIGCONT');
    }
    await is_in_state('push', 'done');
  },

  async 'Escape stops the robot while a slider is held, and while a name is typed'() {
    const is_emergency = async () => (await bench.ask(`/robots/${kRobot}`)).mode === 'emergency';
    await page.focus('#design-crossover-slider');
    await page.keyboard.press('Escape');
    await until('the robot is in emergency', is_emergency);
    await clear_by_script(bench, kRobot);
    await page.focus('#design-model-name');
    await page.keyboard.type('a name');
    await page.click('#design-plant');
    await page.keyboard.press('Escape');
    await until('the robot is in emergency again', is_emergency);
    await until('the list has closed as well', async () => (await page.locator('#design-plant').getAttribute('aria-expanded')) === 'false');
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
};

export const story = { bench, steps, open: open_pages };
