// The view of runs: the list and its filters, one run with its plots and files, several side by side.
//
//   stories.mjs [--pictures FOLDER] runs
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { assert_accessible } from './accessible.mjs';
import { clear_by_script, commanded, go_to, samples, shows } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kMany = 230; // more than two pages of the list
const pictures_at = process.argv.indexOf('--pictures');
const pictures = pictures_at > 0 ? process.argv[pictures_at + 1] : null;
const bench = new Bench();
const faults = [];
let page;

// ---- a small vocabulary

const text = (selector) => page.locator(selector).first().innerText();
const rows = () => page.locator('#run-table tbody tr').count();
const names = () => page.locator('#run-table .name a').allInnerTexts();
const hash = () => page.evaluate(() => location.hash);
const picture = async (name) => pictures && page.screenshot({ path: join(pictures, `${name}.png`) });
const command = (body) => commanded(bench, kRobot, body);
const seconds = (count) => samples(bench, kRobot, count * 100);
const address_is = (wanted) => until(`the address is ${wanted}`, async () => (await hash()) === wanted);

// A step in closed loop under a marker, with a disturbance.
async function record(name, notes) {
  await command({ kind: 'zero_position' });
  const made = await bench.post('/runs', { robot_id: kRobot, name, fluid: 'water', tube: 'PVC 12 mm', notes });
  assert.equal(made.status, 201);
  await seconds(1);
  await bench.post(`/robots/${kRobot}/markers`, { text: 'light on' });
  await command({ kind: 'set_mode', mode: 'auto', setpoint_m: 0.05 });
  await seconds(4);
  await command({ kind: 'inject_disturbance', disturbance_m: -0.02 });
  await seconds(3);
  await command({ kind: 'inject_disturbance', disturbance_m: 0 });
  await command({ kind: 'set_mode', mode: 'manual' });
  await seconds(1);
  assert.equal((await bench.post(`/runs/${made.answer.run_id}/end`, {})).status, 200);
  return made.answer.run_id;
}

const open = (address) => go_to(page, address);

// How many colours a plot has: a plot without a trace has few.
const colours = (selector) =>
  page.locator(`${selector} canvas`).first().evaluate((canvas) => {
    const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    return new Set(Uint32Array.from(new Uint32Array(pixels.buffer))).size;
  });

async function drag(selector, from_share, to_share) {
  const box = await page.locator(`${selector} .u-over`).boundingBox();
  const y = box.y + box.height / 2;
  await page.mouse.move(box.x + box.width * from_share, y);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * to_share, y, { steps: 5 });
  await page.mouse.up();
}

// How long the plots of run 1 are: a robot on a busy machine skips periods, so it is not the number of samples.
async function plotted_s() {
  const { first_utc_us, last_utc_us } = await bench.ask('/runs/1/overview?points=1');
  return (last_utc_us.at(-1) - first_utc_us[0]) / 1e6;
}

// Moves the cursor to a time of run 1 on the plot of its position.
async function look_at(time_s) {
  const duration_s = await plotted_s();
  const box = await page.locator('.strip.position .u-over').boundingBox();
  await page.mouse.move(box.x + (box.width * time_s) / duration_s, box.y + 50);
}

async function downloaded(selector) {
  const [download] = await Promise.all([page.waitForEvent('download'), page.click(selector)]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

// ---- what somebody does with runs, in order

const steps = {
  async 'without a run the view says how one is begun'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await until('the robot is there', async () => (await page.locator('.annunciator h1').count()) === 1);
    await page.keyboard.press('g');
    await page.keyboard.press('u');
    await page.locator('#no-runs').getByText('Start run').waitFor();
    await assert_accessible(page, 'the empty list');
  },

  async 'runs that end appear in the list by themselves, newest first'() {
    await page.setViewportSize({ width: 1440, height: 900 });
    await record('Step in water', 'the pump was warm');
    await page.locator('#run-table').getByText('Step in water').waitFor();
    await record('Step again', '');
    await until('both are listed', async () => (await rows()) === 2);
    assert.deepEqual(await names(), ['#2 Step again', '#1 Step in water']);
    await shows(page, '[data-run="1"] .is-record', /complete/);
  },

  async 'the list is searched, and what is searched stands in the address'() {
    await page.fill('#filter-q', 'pump warm');
    await until('one is left', async () => (await rows()) === 1);
    assert.deepEqual(await names(), ['#1 Step in water']);
    await address_is('#/runs?q=pump+warm');
    await page.fill('#filter-q', '');
    await page.click('#filter-fluid');
    await page.locator('#filter-fluid-list [role=option]', { hasText: 'non-Newtonian' }).click();
    await page.locator('#no-match').waitFor();
    await address_is('#/runs?fluid=non_newtonian');
    await page.fill('#filter-from', '26/11');
    await page.press('#filter-from', 'Enter');
    await page.locator('#filter-problem').getByText('“26/11” is no date').waitFor();
    await page.locator('#no-match a').click();
    await until('all are back', async () => (await rows()) === 2);
  },

  async 'a run is opened, and its record and its plots are there'() {
    await page.click('[data-run="1"] .name a');
    await page.locator('#completeness').getByText('Recorded, nothing lost').waitFor();
    const digest = (await bench.ask('/runs/1/certificate')).sha256;
    assert.equal((await text('#digest')).replaceAll(/\s/g, ''), digest);
    await until('the plot has traces', async () => (await colours('.strip.position')) > 20);
    await until('so has the one of the duty', async () => (await colours('.strip.duty')) > 5);
    await page.locator('#moments').getByText('light on').waitFor();
    await page.locator('#moments').getByText('setpoint 50 mm').waitFor();
    await page.locator('#moments').getByText('disturbance −20 mm').waitFor();
    await page.locator('#steps tbody tr').first().waitFor();
    const { figures } = await bench.ask('/runs/1/metrics');
    await page.locator('#figures').getByText(figures.duration_s.toFixed(2)).waitFor();
  },

  async 'the cursor reads a value in each plot, with its ± and its time'() {
    const step = (await bench.ask('/runs/1/metrics')).steps[0];
    const at_s = step.at_s + 3; // at rest at 50 mm
    await until('the cursor is there', async () => {
      await look_at(at_s); // again and again: what is loaded meanwhile may move the plot
      const [, time_s] = /^([\d.]+) s · \d\d:\d\d:\d\d\.\d{3}$/.exec(await text('.cursor-time')) ?? [];
      return Math.abs(Number(time_s) - at_s) < 0.05;
    });
    const said = await until('the ± has come', async () => {
      await look_at(at_s);
      const value = await text('.strip.position .cursor');
      return /±/.test(value) && value;
    });
    assert.match(said, /^(49|50)\.\d.* ± \d.*, setpoint 50\.0 mm$/);
    await shows(page, '.strip.impedance .cursor', /mV$/);
    await picture('run');
  },

  async 'the estimate is drawn less the disturbance, from the moment on at which it came'() {
    const disturbed = (await bench.ask('/runs/1/metrics')).steps.find((step) => step.cause === 'disturbance');
    // At rest again under a disturbance of −20 mm: the controller sees 50 mm, the robot is at 70 mm.
    await until('70 mm', async () => {
      await look_at(disturbed.at_s + 2.5);
      return /^(69|70)\.\d/.test(await text('.strip.position .cursor'));
    });
  },

  async 'dragging over one plot shows that stretch in all, finer, and the address leads back to it'() {
    await shows(page, '#plot-source', /every sample|a point/);
    await drag('.strip.duty', 0.25, 0.5);
    await until('the range stands in the address', async () => /from=\d+&to=\d+/.test(await hash()));
    const zoomed = await hash();
    await until('every sample is shown', async () => (await text('#plot-source')) === 'every sample');
    const [, from_s, to_s] = /^([\d.]+) s to ([\d.]+) s$/.exec(await text('#plot-window'));
    const duration_s = await plotted_s();
    assert.ok(Math.abs(Number(from_s) - duration_s * 0.25) < 0.2 && Math.abs(Number(to_s) - duration_s * 0.5) < 0.2, `${from_s} ${to_s}`);
    await page.click('#whole-run');
    await address_is('#/runs/1');
    await page.goBack();
    await address_is(zoomed);
    await page.click('#time-clock');
    await shows(page, '#plot-window', /^\d\d:\d\d:\d\d\.\d to/);
    await page.click('#whole-run');
    await page.locator('.run-strips').focus();
    await page.keyboard.press('+');
    await until('a key zooms', async () => /from=/.test(await hash()));
    await page.keyboard.press('Home');
    await until('a key shows all', async () => !/from=/.test(await hash()));
  },

  async 'verdict and notes are written down, and a marker is put where the plot was clicked'() {
    await page.fill('#said-verdict', 'good');
    await page.press('#said-verdict', 'Enter');
    await until('the verdict is stored', async () => (await bench.ask('/runs/1')).verdict === 'good');
    await page.locator('#run-line').getByText('good').waitFor();
    assert.equal((await bench.ask('/runs/1')).notes, 'the pump was warm');
    const box = await page.locator('.strip.position .u-over').boundingBox();
    await page.mouse.click(box.x + box.width * 0.75, box.y + 60);
    await page.fill('#marker-text', 'at rest');
    await page.click('#add-marker');
    await page.locator('#moments').getByText('at rest').waitFor();
    const marker = (await bench.ask('/runs/1/markers')).markers.find(({ text: said }) => said === 'at rest');
    const run_1 = await bench.ask('/runs/1');
    const share = (marker.utc_us - run_1.started_at_us) / (run_1.ended_at_us - run_1.started_at_us);
    assert.ok(Math.abs(share - 0.75) < 0.02, String(share));
  },

  async 'Escape stops the robot while a note is typed, and nothing that was typed is lost'() {
    await page.fill('#said-notes', 'half a sentence');
    await page.press('#said-notes', 'Escape');
    await until('the robot is latched', async () => (await bench.ask(`/robots/${kRobot}`)).mode === 'emergency');
    assert.equal(await page.inputValue('#said-notes'), 'half a sentence');
    await page.fill('#said-notes', 'the pump was warm');
    await clear_by_script(bench, kRobot);
  },

  async 'its files are downloaded'() {
    const csv = await downloaded('#files a[href$="samples.csv"]');
    assert.equal(csv.name, 'run-1.csv');
    const { samples_stored } = await bench.ask('/runs/1');
    assert.equal(csv.bytes.toString().trim().split('\n').length, samples_stored + 1);
    const archive = await downloaded('#files a[href$="capsule.eln"]');
    assert.equal(archive.bytes.subarray(0, 2).toString(), 'PK');
    const report = await downloaded('#files a[href$="report.html"]');
    assert.match(report.bytes.toString(), /Step in water/);
  },

  async 'its impedance stands against the position'() {
    await page.click('#open-map');
    await page.locator('.strip.map canvas').waitFor();
    await until('it stands in the address', async () => /map=5/.test(await hash()));
    await assert_accessible(page, 'a run');
  },

  async 'two runs are chosen and compared at their step'() {
    await page.setViewportSize({ width: 1440, height: 900 });
    await open('#/runs');
    await page.click('[data-run="1"] input');
    await shows(page, '#chosen', /Choose one more/);
    await page.click('[data-run="2"] input');
    await page.click('#compare');
    await until('the traces are there', async () => (await page.locator('.strip.position canvas').count()) === 1);
    await page.click('#align-at');
    await page.locator('#align-at-list [role=option]', { hasText: 'a step' }).click();
    await until('the address says so', async () => /at=step/.test(await hash()));
    await until('time begins before the step', async () => (await text('#plot-window')).startsWith('−'));
    await until('the plot has traces', async () => (await colours('.strip.position')) > 20);
    await page.locator('#figures').getByText('Settling time').first().waitFor();
    const compared = await bench.ask('/run-comparison?runs=1,2');
    const settling = compared.steps[0].measures.find(({ name }) => name === 'settling_s');
    await page.locator('#figures tbody').first().getByText(settling.mean.toFixed(2)).first().waitFor();
    await picture('comparison');
    await assert_accessible(page, 'a comparison');
  },

  async 'the difference is from the run that is chosen, and a report of it all is downloaded'() {
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.locator('.compared li').nth(1).getByText('Reference').click();
    await page.locator('.strip.difference').getByText('from #2').waitFor();
    const report = await downloaded('#files a');
    assert.equal(report.name, 'runs-1-2.html');
    assert.match(report.bytes.toString(), /Step again/);
  },

  async 'what cannot be compared says why, and where to go on'() {
    await open('#/runs/compare?runs=1,2&at=marker&marker=nothing');
    await page.locator('#align-problem').getByText('marker').waitFor();
    await open('#/runs/compare?runs=1');
    await page.locator('#compare-problem').getByText('at least two').waitFor();
    await open('#/runs/99999');
    await page.locator('#no-such-run').waitFor();
    await open('#/runs/first');
    await page.locator('#no-such-run').getByText('“first”').waitFor();
  },

  async 'of a run with lost samples and a reboot the page says exactly what is missing, and draws it as a hole'() {
    const made = await bench.post('/runs', { robot_id: kRobot, name: 'With a gap', fluid: 'water' });
    assert.equal(made.status, 201);
    const { run_id } = made.answer;
    await seconds(2);
    bench.station.process.kill('SIGSTOP'); // for longer than the robot's memory reaches back
    await new Promise((resolve) => setTimeout(resolve, 12_000));
    bench.station.process.kill('SIGCONT');
    const counts = async () => bench.ask(`/runs/${run_id}`);
    await until('samples are known to be lost', async () => (await counts()).samples_lost > 0);
    await seconds(2);
    await bench.robot.end();
    bench.start_robot(kRobot);
    await until('the robot is in its next boot', async () => (await counts()).spans.length === 2);
    await seconds(2);
    await open(`#/runs/${run_id}`);
    await page.locator('#completeness').getByText('Recording:').waitFor();
    assert.equal((await bench.post(`/runs/${run_id}/end`, {})).status, 200);
    const certificate = await until('the digest is made', async () => {
      const found = await bench.ask(`/runs/${run_id}/certificate`);
      return found.final && found;
    });
    const number = (value) => value.toLocaleString('en').replaceAll(',', '\u202f');
    const lost = `${number(certificate.samples_lost)} of ${number(certificate.samples_expected)} samples are lost`;
    await page.locator('#completeness .caution').getByText(lost).waitFor();
    await page.locator('#conditions').getByText('2: the robot restarted in it').waitFor();
    const said = await until('the cursor finds the hole', async () => {
      const box = await page.locator('.strip.position .u-over').boundingBox();
      for (let share = 0.1; share < 0.9; share += 0.05) {
        await page.mouse.move(box.x + box.width * share, box.y + 60);
        if ((await text('.strip.duty .cursor')) === 'no samples') return share;
      }
      return null;
    });
    assert.ok(said > 0);
    await picture('gap');
  },

  async 'of many runs the list shows the newest, and the others as it is scrolled'() {
    const { spans } = await bench.ask('/runs/1');
    const { boot_id, first_seq } = spans[0];
    for (let at = 1; at <= kMany; ++at) {
      const span = { boot_id, first_seq: first_seq + at, last_seq: first_seq + at + 100 };
      const made = await bench.post('/runs', { robot_id: kRobot, name: `Part ${at}`, span });
      assert.equal(made.status, 201, JSON.stringify(made.answer));
    }
    await open('#/runs');
    await page.locator('#run-table').getByText(`Part ${kMany}`, { exact: false }).first().waitFor();
    const first_rows = await rows();
    assert.ok(first_rows < kMany, `${first_rows} rows at once`);
    await until('all are there after scrolling', async () => {
      await page.locator('.list-end').scrollIntoViewIfNeeded();
      return (await rows()) === kMany + 3;
    });
    await page.fill('#filter-q', 'water');
    await until('the oldest is found', async () => (await rows()) > 0 && (await names()).includes('#1 Step in water'));
    await page.fill('#filter-q', '');
    await page.fill('#filter-q', '#117');
    await until('one is found', async () => (await names()).join() === '#117 Part 114');
    await page.fill('#filter-q', '');
    await assert_accessible(page, 'the list');
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark', acceptDownloads: true });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => /Content.Security.Policy|violates/i.test(message.text()) && faults.push(message.text()));
};

export const story = { bench, steps, open: open_pages };
