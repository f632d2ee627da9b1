// The model of a fluid on the page: told when the fluid is named, shown with its fluid, sent again by a button.
import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { click_if_offered, commanded } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const bench = new Bench();
let page;

const model = (gain_m_s) => ({ model_gain_m_s: [gain_m_s, 0.02, 0, 0], model_time_constant_s: [0.1, 0.5, 3, 15], fit_error: 0.0021, plant: {} });
const foot = () => page.locator('#numeral-position .foot').innerText();
const notice = () => page.locator('#model-line p').innerText();
const says = (what, probe, part) => until(part, async () => (await probe()).includes(part)).catch(async () => assert.fail(`${what}: ${await probe()}`));

const steps = {
  async 'a fluid that is named brings its model, and the page says whose it is'() {
    const file = join(bench.data, 'model.json');
    writeFileSync(file, JSON.stringify(model(0.11)));
    await bench.cli(['fluid', 'model', 'water', file]);
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await says('numeral', foot, 'model assumed');
    assert.equal(await page.locator('#model-line').count(), 0, 'its fluid is not named');
    await page.click('#run-fluid');
    await page.locator('#run-fluid-list [role=option]', { hasText: 'water' }).click();
    await says('numeral', foot, 'model of water, confirmed');
    await says('notice', notice, 'The model of water is in force, fit error 0.21 %.');
    assert.equal(await page.locator('#send-model').count(), 0);
  },

  async 'one that is no longer in force is sent again by a button'() {
    await page.locator('#take-control').waitFor(); // to name a fluid takes no control
    await commanded(bench, kRobot, { kind: 'set_parameter', name: 'model_gain_3_m_s', value: 0.01 });
    await says('numeral', foot, 'model assumed');
    await says('notice', notice, 'The model of water is not in force: the robot has taken it back: a parameter was changed.');
    await page.locator('#take-control').waitFor(); // the script has gone silent
    await until('the model is in force again', async () => { // one that is too old when it arrives is refused
      await click_if_offered(page, '#send-model');
      return until('it is', async () => (await foot()).includes('model of water, confirmed'), 4000).catch(() => false);
    });
  },

  async 'a fluid without a model takes the confirmation back'() {
    await page.click('#run-fluid');
    await page.locator('#run-fluid-list [role=option]', { hasText: 'non-Newtonian' }).click();
    await says('numeral', foot, 'model assumed');
    await until('nothing is said beside the fluid', async () => (await page.locator('#model-line').count()) === 0);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
};

export const story = { bench, steps, open: open_pages };
