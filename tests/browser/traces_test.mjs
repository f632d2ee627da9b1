// What the plots of a robot can show beside recorded traces: what was predicted of an experiment, traces computed from
// others, one channel against another; and the sound of thresholds.
//
//   stories.mjs [--pictures FOLDER] traces
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { assert_accessible } from './accessible.mjs';
import { commanded, drawn as frames, live as is_fresh, samples, shows } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kProfile = `name = "A step"
purpose = "For the test of the plots."

[limits]
position_min_m = -0.3
position_max_m = 0.3

[[step]]
kind = "setpoint"
setpoint_m = 0.05
for_s = 5
`;
const pictures_at = process.argv.indexOf('--pictures');
const pictures = pictures_at > 0 ? process.argv[pictures_at + 1] : null;
const bench = new Bench();
const faults = [];
let page;

const text = (selector) => page.locator(selector).first().innerText();
const picture = async (name) => pictures && page.screenshot({ path: join(pictures, `${name}.png`) });
const live = () => is_fresh(page);
const choose = async (field, option) => {
  await page.click(field);
  await page.locator(`${field}-list [role=option]`, { hasText: option }).first().click();
};

// Points at a share of the width of the plots, and gives what a strip says there.
async function value_at(share, strip = '.strip-0') {
  const plot = page.locator(`${strip} .plot`);
  await plot.scrollIntoViewIfNeeded();
  const { x, y, width, height } = await plot.boundingBox();
  await page.mouse.move(x + 58 + share * (width - 58 - 18), y + height / 2);
  await page.waitForTimeout(200);
  return text(`${strip} .cursor`);
}

// How many pixels of a canvas are not of its ground.
const drawn = (selector) =>
  page.locator(selector).first().evaluate((canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let bright = 0;
    for (let at = 0; at < data.length; at += 4) if (data[at] > 150 && data[at + 3] > 120) bright += 1;
    return bright;
  });

const steps = {
  async 'without an experiment nothing is predicted'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live();
    await samples(bench, kRobot, 100);
    assert.equal(await page.locator('.of-position .swatch.predicted').count(), 0);
  },

  async 'what is predicted of an experiment is drawn while it runs, and afterwards'() {
    await commanded(bench, kRobot, { kind: 'zero_position' });
    const { status, answer } = await bench.post('/experiments', { robot_id: kRobot, profile: kProfile });
    assert.equal(status, 202, JSON.stringify(answer));
    const id = answer.experiment_id;
    let is_over = false;
    const keeps_alive = (async () => {
      while (!is_over) {
        await bench.post(`/experiments/${id}/keep-alive`, {});
        await new Promise((resolve) => setTimeout(resolve, 200));
      }
    })();
    try {
      await page.locator('.of-position .swatch.predicted').waitFor();
      await picture('predicted_live');
      await until('it is over', async () => !['waiting', 'running'].includes((await bench.ask(`/experiments/${id}`)).state));
    } finally {
      is_over = true;
      await keeps_alive;
    }
    const [of_it] = (await bench.ask(`/experiments/${id}`)).runs;
    const prediction = await bench.ask(`/experiments/${id}/runs/1/prediction`);
    const samples = (await bench.ask(`/runs/${of_it.run_id}/samples?limit=10000`)).samples;
    const zero_us = samples[0].utc_us + of_it.steps[0].robot_time_us - samples[0].robot_time_us;
    // The page is opened anew at the two seconds in which the robot rises.
    await page.goto(`${bench.http}/#/robot/${kRobot}?from=${Math.round(zero_us / 1000) - 1000}&to=${Math.round(zero_us / 1000) + 5000}`);
    await page.reload();
    await page.locator('.of-position .swatch.predicted').waitFor();
    for (const since_s of [2, 4]) {
      const at = prediction.t_s.findLastIndex((time_s) => time_s <= since_s);
      const millimetres = prediction.position_m[at] * 1000;
      await until(`the prediction at ${since_s} s is read`, async () => {
        const said = /, predicted (−?[\d.]+)/.exec(await value_at((since_s + 1) / 6))?.[1];
        return said && Math.abs(Number(said.replace('−', '-')) - millimetres) < 1.5;
      });
    }
    await until('before its beginning nothing is predicted', async () => {
      const said = await value_at(0.05);
      return /\d/.test(said) && !/predicted/.test(said);
    });
    await picture('predicted');
  },

  async 'it is a trace that can be left out'() {
    await page.click('#plots-traces');
    await page.uncheck('#trace-list input[name=predicted]');
    await page.locator('.of-position .swatch.predicted').waitFor({ state: 'detached' });
    await page.check('#trace-list input[name=predicted]');
    await page.click('#plots-traces');
  },

  async 'a derivative, a low pass and a difference are made, and drawn with their names'() {
    await page.click('#plots-live');
    await page.click('#plots-traces');
    await page.fill('#derived-time', 'long');
    await page.click('#derived-add');
    await page.locator('#derived-problem').getByText('“long” is no time from 0.02 to 5 s').waitFor();
    await page.fill('#derived-time', '0,2');
    await choose('#derived-of', 'position_m');
    await page.click('#derived-add');
    await page.locator('.of-derived figcaption').getByText('d/dt position_m (0.2 s)').waitFor();
    await choose('#derived-kind', 'low-pass');
    await page.click('#derived-add');
    await page.locator('.of-derived figcaption').getByText('low-pass position_m (0.5 s)').waitFor();
    await choose('#derived-kind', 'difference');
    await choose('#derived-less', 'duty');
    await page.click('#derived-add');
    await page.locator('#derived-problem').getByText('position_m is in mm, duty in %').waitFor();
    await choose('#derived-less', 'reference_m');
    await page.click('#derived-add');
    await page.locator('.of-derived figcaption').getByText('position_m − reference_m').waitFor();
    await picture('derived');
    await page.click('#plots-traces');
    const strip = page.locator('.strip', { hasText: 'low-pass position_m' });
    const name = /strip-\d+/.exec(await strip.getAttribute('class'))[0];
    await until('the low pass follows', async () => /^−?\d+\.\d mm$/.test(await value_at(0.99, `.${name}`)));
  },

  async 'they are kept, also for what the station has recorded, and can be removed'() {
    await page.reload();
    await live();
    await until('all three are there', async () => (await page.locator('.of-derived').count()) === 3);
    const strip = /strip-\d+/.exec(await page.locator('.strip', { hasText: 'low-pass position_m' }).getAttribute('class'))[0];
    await until('there is one of the past', async () => /^−?\d+\.\d mm$/.test(await value_at(0.93, `.${strip}`)));
    await page.click('#plots-traces');
    await page.getByRole('button', { name: 'Remove low-pass position_m (0.5 s)' }).click();
    await page.getByRole('button', { name: 'Remove position_m − reference_m' }).click();
    await until('they are gone', async () => (await page.locator('.of-derived').count()) === 1);
    await page.click('#plots-traces');
  },

  async 'any channel is drawn against any other'() {
    await page.click('#plots-xy');
    await page.locator('#xy-plot canvas').waitFor();
    await choose('#xy-y', 'velocity_m_s');
    await choose('#xy-x', 'd/dt position_m (0.2 s)');
    await page.locator('#xy-note').getByText('the newest in the ring').waitFor();
    await until('points are drawn', async () => (await drawn('#xy-plot canvas')) > 40);
    const first = await text('#xy-note');
    await until('it follows what arrives', async () => (await text('#xy-note')) !== first);
    await page.locator('#xy-plot').scrollIntoViewIfNeeded();
    await picture('xy');
    await page.reload();
    await page.locator('#xy-plot').waitFor();
    await shows(page, '#xy-y', /velocity_m_s/);
    await assert_accessible(page, 'plots with X–Y', [[1440, 900], [390, 844]]);
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.click('#plots-xy');
    await page.locator('#xy-plot').waitFor({ state: 'detached' });
  },

  async 'a threshold that is crossed sounds when sounds are on, and is silent when muted'() {
    const tones = () => page.evaluate(() => window.tones ?? 0);
    const threshold = async (value) => {
      await page.fill('input[name=impedance_mv-high]', value);
      await page.press('input[name=impedance_mv-high]', 'Enter');
    };
    await page.evaluate(() => {
      const start = OscillatorNode.prototype.start;
      OscillatorNode.prototype.start = function (...when) {
        window.tones = (window.tones ?? 0) + 1;
        return start.apply(this, when);
      };
    });
    await page.click('#plots-thresholds');
    await threshold('10');
    await page.locator('#alert-line').waitFor();
    await samples(bench, kRobot, 50);
    await frames(page);
    assert.equal(await tones(), 0, 'sounds are off');
    assert.equal(await page.locator('#mute-alerts').count(), 0);
    await page.click('#acknowledge-alerts');
    await threshold('');
    await page.click('#show-alarms');
    await page.check('#alert-sound'); // sounds once, so that its loudness is known
    await page.click('#show-alarms');
    await until('the alarm has sounded', async () => (await tones()) === 3);
    await threshold('10');
    await until('the threshold sounds', async () => (await tones()) === 5);
    await page.click('#mute-alerts');
    await shows(page, '#mute-alerts', 'Muted');
    await page.locator('#threshold-sound:not(:checked)').waitFor();
    await page.click('#acknowledge-alerts');
    await threshold('');
    await threshold('11');
    await page.locator('#alert-line').waitFor();
    await samples(bench, kRobot, 50);
    await frames(page);
    assert.equal(await tones(), 5, 'muted');
    await picture('threshold');
    await threshold('');
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => /Content.Security.Policy|violates/i.test(message.text()) && faults.push(message.text()));
};

export const story = { bench, steps, open: open_pages };
