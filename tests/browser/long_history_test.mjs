// An hour of history on the view of a robot: the plots are drawn from what the station has, moved and zoomed, and the cursor
// says what the API says of that moment.
//
// A replayed robot makes the samples of the hour at 20 kHz; then, with the station ended, their times are stretched to
// 100 Hz, an hour that ended an hour ago.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { join } from 'node:path';
import { Bench, run, until } from './programs.mjs';

const kRobot = 'sim-1';
const kRate = 200; // times as fast
const kSamples = 360_000;
const kHour_ms = 3_600_000;
const [kLeft, kRight] = [58, 18]; // of the axes of the plots
const bench = new Bench();
const faults = [];
const asked = []; // paths of the robot's past
let page, from_ms, to_ms;

const text = (selector) => page.locator(selector).first().innerText();
const plot = () => page.locator('.strip-0 .plot').boundingBox();
const query = () => new URLSearchParams(page.url().split('?')[1] ?? '');
const range = async () => {
  await page.waitForTimeout(600); // the address follows
  return [Number(query().get('from')), Number(query().get('to'))];
};

async function python(program, ...args) {
  const tool = spawn('python3', ['-c', program, ...args], { stdio: ['ignore', 'pipe', 'inherit'] });
  let said = '';
  tool.stdout.on('data', (part) => (said += part));
  const [code] = await once(tool, 'exit');
  assert.equal(code, 0);
  return said.trim();
}

// Robot time times kRate, so that 50 µs between two samples become 10 ms; UTC begins at argv[2].
const kStretch = `
import sqlite3, sys
database, begin_us, rate = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
with sqlite3.connect(database) as connection:
    base, = connection.execute("SELECT min(first_robot_time_us) FROM segment").fetchone()
    connection.execute("UPDATE segment SET first_robot_time_us = (first_robot_time_us - ?) * ?, period_us = period_us * ?, utc_offset_us = ?", (base, rate, rate, begin_us))
    connection.execute("UPDATE boot SET last_robot_time_us = (last_robot_time_us - ?) * ?, sample_period_us = sample_period_us * ?, grouped_next_seq = 0", (base, rate, rate))
    connection.execute("DELETE FROM segment_group")
    print(*connection.execute("SELECT sum(last_seq - first_seq + 1), max(first_robot_time_us + (last_seq - first_seq) * period_us) + ? FROM segment", (begin_us,)).fetchone())
`;

// The values of the pixels of a trace differ from the ground.
const drawn = (from, to) =>
  page.evaluate(
    ([from, to, left, right]) => {
      const canvas = document.querySelector('.strip-0 canvas');
      const ratio = devicePixelRatio;
      const width = canvas.width - (left + right) * ratio;
      const { data } = canvas.getContext('2d').getImageData(Math.round(left * ratio + from * width), 20 * ratio, Math.max(1, Math.round((to - from) * width)), canvas.height - 60 * ratio);
      const colours = new Map();
      for (let at = 0; at < data.length; at += 4) {
        const colour = `${data[at]},${data[at + 1]},${data[at + 2]},${data[at + 3]}`;
        colours.set(colour, (colours.get(colour) ?? 0) + 1);
      }
      return colours.size;
    },
    [from, to, kLeft, kRight],
  );
const settled = () => until('the plots have what they asked for', async () => {
  const before = asked.length;
  await page.waitForTimeout(700);
  return asked.length === before;
});

async function point_at(share) {
  const { x, y, width, height } = await plot();
  await page.mouse.move(x + kLeft + share * (width - kLeft - kRight), y + height / 2);
  await page.waitForTimeout(300);
  return text('.strip-0 .cursor');
}

// What stands at the cursor is what the station has there: its one sample, or one within the extremes of a pixel.
async function agrees_at(share) {
  const [from, to] = await range();
  const at_us = Math.round((from + share * (to - from)) * 1000);
  const width_us = ((to - from) * 1000) / ((await plot()).width - kLeft - kRight);
  const said = await point_at(share);
  const [, one, other] = /^(\u2212?[\d.]+)(?: (?:to|…|–) (\u2212?[\d.]+))?/.exec(said) ?? [];
  assert.ok(one !== undefined, `the cursor says a position: ${said}`);
  const number = (words) => Number(words.replace('\u2212', '-'));
  const reach_us = Math.round(Math.max(3 * width_us, 20_000));
  const { samples } = await bench.ask(`/robots/${kRobot}/samples?from_us=${at_us - reach_us}&to_us=${at_us + reach_us}&limit=5000`);
  assert.ok(samples.length > 0);
  const known = samples.flatMap((sample) => [sample.position_m, sample.position_m - sample.disturbance_m]).map((value) => value * 1000);
  const [least, most] = [Math.min(...known) - 0.06, Math.max(...known) + 0.06];
  for (const value of [one, other].filter((each) => each !== undefined).map(number)) {
    assert.ok(value >= least && value <= most, `${said}: the station has ${least.toFixed(2)} to ${most.toFixed(2)} mm there`);
  }
  return said;
}

const steps = {
  async 'a station that has an hour of samples'() {
    bench.start_replay(kRobot, kRate);
    await until('an hour of samples', async () => {
      const { robots } = await bench.ask('/robots');
      return robots.some((robot) => robot.next_seq >= kSamples);
    }, 120_000);
    await bench.fleet.end();
    await bench.station.end();
    from_ms = Date.now() - 2 * kHour_ms;
    const said = await python(kStretch, join(bench.data, 'station.sqlite'), String(from_ms * 1000), String(kRate));
    const [samples, end_us] = said.split(' ').map(Number);
    to_ms = Math.min(from_ms + kHour_ms, Math.floor(end_us / 1000));
    console.log(`    ${samples} samples, ${((to_ms - from_ms) / 1000).toFixed(0)} s`);
    assert.ok(samples > 0.9 * kSamples && to_ms - from_ms > 0.95 * kHour_ms);
    await bench.start_station();
  },

  async 'a link to that hour draws it, from the station’s extremes'() {
    page.on('request', (request) => /\/(samples|overview)\?/.test(request.url()) && asked.push(request.url()));
    await page.goto(await bench.login_link());
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await page.goto(`${bench.http}/#/robot/${kRobot}?from=${from_ms}&to=${to_ms}`);
    await page.locator('.strip-0 canvas').waitFor();
    await settled();
    assert.equal(await page.getAttribute('#plots-live', 'aria-pressed'), 'false');
    assert.deepEqual(await range(), [from_ms, to_ms]);
    assert.ok(asked.some((path) => path.includes('/overview?')), 'it asks for extremes');
    assert.ok(!asked.some((path) => path.includes('/samples?')), 'and for none of the 360 000 samples');
    for (const [from, to] of [[0.02, 0.1], [0.45, 0.55], [0.9, 0.98]]) {
      await until(`a trace between ${from} and ${to}`, async () => (await drawn(from, to)) > 3);
    }
    for (const share of [0.1, 0.5, 0.9]) console.log(`    ${share}: ${await agrees_at(share)}`);
  },

  async 'it is moved and zoomed, down to single samples, and back'() {
    const { x, y, width, height } = await plot();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width / 2 - width / 10, y + height / 2, { steps: 5 });
    await page.mouse.up();
    const [moved_from, moved_to] = await range();
    assert.ok(moved_from > from_ms && Math.abs(moved_to - moved_from - (to_ms - from_ms)) < 50, 'a drag to the left shows what came later');
    await page.mouse.move(x + width / 2, y + height / 2);
    for (let step = 0; step < 60; ++step) {
      await page.mouse.wheel(0, -400);
      const [from, to] = await range();
      if (to - from < 8000) break;
    }
    const [from, to] = await range();
    assert.ok(to - from < 8000, `${to - from} ms`);
    assert.ok(from > moved_from && to < moved_to);
    await settled();
    assert.ok(asked.some((path) => path.includes('/samples?')), 'near enough it asks for the samples');
    await until('a trace', async () => (await drawn(0.2, 0.8)) > 3);
    for (const share of [0.3, 0.7]) console.log(`    ${share}: ${await agrees_at(share)}`);
    await page.reload();
    await page.locator('.strip-0 canvas').waitFor();
    assert.deepEqual(await range(), [from, to], 'the link shows the same');
    await page.click('#plots-live');
    assert.equal(await page.getAttribute('#plots-live', 'aria-pressed'), 'true');
    assert.deepEqual(faults, []);
  },
};

await run(bench, steps, async () => {
  page = await bench.open_browser({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
});
