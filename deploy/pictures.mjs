// The pictures of every view in docs/images: the real page in headless Chromium, a real station, simulated robots.
//
//   pictures.mjs FOLDER      (deploy/pictures builds what this needs and calls it)
import { execFileSync } from 'node:child_process';
import { mkdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { Bench, until } from '../tests/browser/programs.mjs';
import { confirm_model } from './page_scenes.mjs';

const kRobot = 'rheo-1';
const kDesk = { width: 1440, height: 900 };
const kPhone = { width: 390, height: 844 };
const out = process.argv[2];
const bench = new Bench();
let page;

const pause = (seconds) => page.waitForTimeout(1000 * seconds);

async function open(address) {
  await page.evaluate((hash) => (location.hash = hash), address);
  await page.waitForLoadState('networkidle');
  await pause(1.5); // plots and sliders come to rest
}

async function picture(name, { size = kDesk, theme = 'dark' } = {}) {
  await page.setViewportSize(size);
  await page.emulateMedia({ colorScheme: theme });
  await page.mouse.move(5, size.height - 5);
  await page.evaluate(() => document.activeElement.blur());
  await pause(1);
  const [png, webp] = ['png', 'webp'].map((kind) => join(out, `${name}.${kind}`));
  await page.screenshot({ path: png });
  execFileSync('cwebp', ['-quiet', '-lossless', '-z', '9', png, '-o', webp]);
  rmSync(png);
  console.log(`${webp}: ${statSync(webp).size} bytes`);
}

// What the profile says, performed by the robot; its runs.
async function perform(name, steps, head = '') {
  const file = join(bench.data, 'profile.toml');
  writeFileSync(file, `name = "${name}"\npurpose = "For the pictures."\n${head}\n${steps}`);
  await bench.cli(['experiment', 'begin', file, '--robot', kRobot, '--wait']);
  const [latest] = (await bench.ask('/experiments?limit=1')).experiments;
  const experiment = await bench.ask(`/experiments/${latest.experiment_id}`);
  return { id: experiment.experiment_id, runs: experiment.runs.map((run) => run.run_id) };
}

async function job(request) {
  const { job_id } = (await bench.post('/jobs', request)).answer;
  const ended = await until(`job ${job_id}`, async () => {
    const found = await bench.ask(`/jobs/${job_id}`);
    return ['done', 'failed', 'cancelled'].includes(found.state) && found;
  });
  if (ended.state !== 'done') throw new Error(`job ${job_id} ${ended.state}: ${ended.error}`);
  return job_id;
}

const kSteps = `
[[step]]
kind = "rest"
for_s = 1
[[step]]
kind = "setpoint"
setpoint_m = 0.1
for_s = 5
[[step]]
kind = "disturbance"
disturbance_m = -0.05
for_s = 5
[[step]]
kind = "setpoint"
setpoint_m = 0.04
for_s = 5
`;
const kExcitation = `
[limits]
duty_max = 0.6
[[step]]
kind = "rest"
for_s = 1
[[step]]
kind = "prbs"
amplitude = 0.6
bit_s = 0.3
for_s = 40
`;

async function prepare() {
  await bench.start_station();
  bench.start_robot(kRobot, '--seed', '21');
  bench.start_fleet('tank', 11);
  page = await bench.open_browser({ viewport: kDesk, colorScheme: 'dark' });
  await bench.sign_in(page);
  await until('the robots are there', async () => (await bench.ask('/robots')).robots.length === 12);
  await confirm_model(bench, kRobot, 'non_newtonian');
  await bench.post('/robots/tank-4/emergency-stop', {});
}

async function take_pictures() {
  const steps = await perform('Step, disturbance, back', kSteps, '[conditions]\nfluid = "non_newtonian"\n[sweep]\nrepeats = 2');
  const excited = await perform('Identification', kExcitation);
  const fit = await job({ kind: 'identify', run_id: excited.runs[0] });
  const kept = await bench.post('/designs', { kind: 'model', name: 'fabric softener', job_id: fit });

  await bench.post(`/robots/${kRobot}/commands`, { kind: 'set_mode', mode: 'auto', setpoint_m: 0.1 });
  await open(`#/robot/${kRobot}`);
  await pause(8);
  await bench.post(`/robots/${kRobot}/commands`, { kind: 'set_setpoint', setpoint_m: 0.15 });
  await pause(6);
  await picture('robot');
  await picture('robot_light', { theme: 'light' });
  await picture('robot_phone', { size: kPhone });
  await page.setViewportSize(kDesk);
  await open('#/fleet');
  await picture('fleet');
  await open('#/runs');
  await picture('runs');
  await open(`#/runs/${steps.runs[0]}`);
  await picture('run');
  await open(`#/runs/compare?runs=${steps.runs.join(',')}&at=step`);
  await picture('compare');
  await open(`#/runs/${steps.runs[0]}/replay?at=7.5&speed=1`);
  await picture('replay');
  await open(`#/experiments/${steps.id}`);
  await picture('experiment');
  await open(`#/experiments/new?profile=figure_7&robot=${kRobot}`);
  await picture('new_experiment');
  await open(`#/design?runs=${excited.runs[0]}&model=${kept.answer.design_id}&crossover=3&margin=90&robot=${kRobot}`);
  await page.locator('#design-map .feasible').first().waitFor();
  await page.locator('#design-part-tune').scrollIntoViewIfNeeded();
  await picture('design');
  await open('#/station/health');
  await picture('station');
}

try {
  mkdirSync(out, { recursive: true });
  await prepare();
  await take_pictures();
} finally {
  await bench.close();
}
process.exit(0);
