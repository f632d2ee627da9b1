// An hour of history on one time axis with what arrives now: the plots are drawn from what the station has, moved and
// zoomed, and the cursor says what the API says of that moment.
//
// A replayed robot makes the samples of six seconds; then, with the station ended, they are repeated to an hour, which ended
// a minute ago.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { join } from 'node:path';
import { drawn, live, trace_pixels } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'sim-1';
const kSamples = 360_000;
const kRecorded = 600; // and repeated
const kHour_ms = 3_600_000;
const kBefore_ms = 600_000;
const [kLeft, kRight] = [58, 18]; // of the axes of the plots
const bench = new Bench();
const faults = [];
const asked = []; // paths of the robot's past
let page, from_ms, to_ms;

const text = (selector) => page.locator(selector).first().innerText();
const plot = () => page.locator('.strip-0 .plot').boundingBox();
const query = () => new URLSearchParams(page.url().split('?')[1] ?? '');
const address = () => [Number(query().get('from')), Number(query().get('to'))];
// The stretch that the address names, which follows the plots a moment later, when it is as asked.
const range = (what, is_so) =>
  until(what, () => {
    const [from, to] = address();
    return is_so(from, to) && [from, to];
  });

async function python(program, ...args) {
  const tool = spawn('python3', ['-c', program, ...args], { stdio: ['ignore', 'pipe', 'inherit'] });
  let said = '';
  tool.stdout.on('data', (part) => (said += part));
  const [code] = await once(tool, 'exit');
  assert.equal(code, 0);
  return said.trim();
}

// What was recorded gets times from argv[2] on, and follows itself until argv[3] samples are there, with its numbers, rows
// and times moved on.
const kRepeat = `
import sqlite3, sys
database, begin_us, samples = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
with sqlite3.connect(database) as connection:
    base, = connection.execute("SELECT min(first_robot_time_us) FROM segment").fetchone()
    connection.execute("UPDATE segment SET first_robot_time_us = first_robot_time_us - ?, utc_offset_us = ?", (base, begin_us))
    numbers, rows, length_us = connection.execute("SELECT max(last_seq) + 1, max(last_row), max(first_robot_time_us + (last_seq - first_seq + 1) * period_us) FROM segment").fetchone()
    def copy(table, last, shifts):
        columns = [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]
        moved = ", ".join(f"{name} + {shifts[name]}" if name in shifts else name for name in columns)
        connection.execute(f"INSERT INTO {table} ({', '.join(columns)}) SELECT {moved} FROM {table} WHERE {last} <= {rows}")
    copies = -(-samples // numbers)
    for n in range(1, copies):
        copy("sample", "row", {"row": n * rows})
        copy("segment", "last_row", {"first_seq": n * numbers, "last_seq": n * numbers, "first_row": n * rows, "last_row": n * rows, "first_robot_time_us": n * length_us})
    connection.execute("UPDATE boot SET last_robot_time_us = ?, announced_next_seq = ?, durable_next_seq = ?, grouped_next_seq = 0", (copies * length_us, copies * numbers, copies * numbers))
    connection.execute("DELETE FROM segment_group")
    connection.execute("UPDATE meta SET value = ? WHERE name = 'next_row'", (copies * rows + 1,))
    print(*connection.execute("SELECT sum(last_seq - first_seq + 1), max(first_robot_time_us + (last_seq - first_seq) * period_us) + ? FROM segment", (begin_us,)).fetchone())
`;

const trace_between = (from, to) => until(`a trace between ${from} and ${to}`, async () => (await trace_pixels(page, from, to)) > 20);
const settled = () => until('the plots have what they asked for', async () => {
  const before = asked.length;
  await page.waitForTimeout(700);
  return asked.length === before;
});

async function point_at(share) {
  const { x, y, width, height } = await plot();
  await page.mouse.move(x + kLeft + share * (width - kLeft - kRight), y + height / 2);
  await drawn(page); // these plots are held: the cursor is drawn with the next frame
  await drawn(page);
  return text('.strip-0 .cursor');
}

// What stands at the cursor is what the station has there: its one sample, or one within the extremes of a pixel.
async function agrees_at(share) {
  const [from, to] = address();
  const at_us = Math.round((from + share * (to - from)) * 1000);
  const width_us = ((to - from) * 1000) / ((await plot()).width - kLeft - kRight);
  let said = '';
  const value = await until('the cursor says a position, and its ±, which is never negative', async () => {
    const found = /^(\u2212?[\d.]+) ± \d/.exec((said = await point_at(share)));
    return found && { said: Number(found[1].replace('\u2212', '-')) };
  }).then((each) => each.said);
  const reach_us = Math.round(Math.max(3 * width_us, 20_000));
  const { samples } = await bench.ask(`/robots/${kRobot}/samples?from_us=${at_us - reach_us}&to_us=${at_us + reach_us}&limit=5000`);
  assert.ok(samples.length > 0);
  const known = samples.flatMap((sample) => [sample.position_m, sample.position_m - sample.disturbance_m]).map((value) => value * 1000);
  const [least, most] = [Math.min(...known) - 0.06, Math.max(...known) + 0.06];
  assert.ok(value >= least && value <= most, `${said}: the station has ${least.toFixed(2)} to ${most.toFixed(2)} mm there`);
  return said;
}

const steps = {
  async 'a station that has an hour of samples'() {
    bench.start_replay(kRobot, 1);
    await until('some samples', async () => {
      const { robots } = await bench.ask('/robots');
      return robots.some((robot) => robot.next_seq >= kRecorded);
    });
    await bench.fleet.end();
    await bench.station.end();
    from_ms = Date.now() - kHour_ms - 60_000;
    const said = await python(kRepeat, join(bench.data, 'station.sqlite'), String(from_ms * 1000), String(kSamples));
    const [samples, end_us] = said.split(' ').map(Number);
    to_ms = Math.min(from_ms + kHour_ms, Math.floor(end_us / 1000));
    console.log(`    ${samples} samples, ${((to_ms - from_ms) / 1000).toFixed(0)} s`);
    assert.ok(samples > 0.9 * kSamples && to_ms - from_ms > 0.95 * kHour_ms);
    await bench.start_station();
    bench.start_replay(kRobot, 1);
  },

  async 'the hour and what arrives now are on one axis'() {
    page.on('request', (request) => /\/(samples|overview)\?/.test(request.url()) && asked.push(request.url()));
    await bench.sign_in(page);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live(page);
    await settled();
    asked.length = 0;
    await page.locator('.spans button').getByText('1 h', { exact: true }).click();
    await until('it asks for extremes', () => asked.some((path) => path.includes('/overview?')));
    for (const [from, to] of [[0.03, 0.1], [0.45, 0.55], [0.85, 0.95]]) await trace_between(from, to);
    assert.equal(await page.getAttribute('#plots-live', 'aria-pressed'), 'true');
    await settled();
    // What the view of a minute asked for may be on its way still.
    const asks_for_the_hour = (path) => path.includes('/samples?') && Number(new URL(path).searchParams.get('from_us') ?? 0) < to_ms * 1000;
    assert.ok(!asked.some(asks_for_the_hour), 'and for none of the 360 000 samples');
    const newest = await point_at(0.999);
    await until('the newest follows', async () => (await text('.strip-0 .cursor')) !== newest);
  },

  async 'a link to that hour draws it, and nothing before it began'() {
    await page.goto(`${bench.http}/#/robot/${kRobot}?from=${from_ms - kBefore_ms}&to=${to_ms}`);
    await until('the plots are held', async () => (await page.getAttribute('#plots-live', 'aria-pressed')) === 'false');
    await range('the address is kept', (from, to) => from === from_ms - kBefore_ms && to === to_ms);
    for (const [from, to] of [[0.16, 0.22], [0.45, 0.55], [0.9, 0.98]]) await trace_between(from, to);
    // It begins where it began: a minute is 1.4 % of the width.
    const begin = kBefore_ms / (to_ms - from_ms + kBefore_ms);
    await trace_between(begin + 0.001, begin + 0.01);
    assert.equal(await trace_pixels(page, 0.02, begin - 0.002), 0, 'where nothing was sampled nothing is drawn');
    await until('the cursor finds no sample', async () => /^no sample/.test(await point_at(0.07)));
    for (const share of [0.2, 0.5, 0.9]) console.log(`    ${share}: ${await agrees_at(share)}`);
  },

  async 'it is moved and zoomed, down to single samples, and back'() {
    asked.length = 0;
    const { x, y, width, height } = await plot();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await page.mouse.move(x + width / 2 + width / 10, y + height / 2, { steps: 5 });
    await page.mouse.up();
    const [moved_from, moved_to] = await range('a drag to the right shows what came before', (from) => from > 0 && from < from_ms - kBefore_ms);
    assert.ok(Math.abs(moved_to - moved_from - (to_ms - from_ms + kBefore_ms)) < 50, 'of the same length');
    await page.mouse.move(x + width / 2, y + height / 2);
    for (let step = 0; step < 60; ++step) {
      const [from_before, to_before] = address();
      if (to_before - from_before < 8000) break;
      await page.mouse.wheel(0, -400);
      await range('the address follows', (from, to) => from !== from_before || to !== to_before);
    }
    const [from, to] = address();
    assert.ok(to - from < 8000, `${to - from} ms`);
    assert.ok(from > moved_from && to < moved_to);
    await until('near enough it asks for the samples', () => asked.some((path) => path.includes('/samples?')));
    await settled();
    await trace_between(0.2, 0.8);
    for (const share of [0.3, 0.7]) console.log(`    ${share}: ${await agrees_at(share)}`);
    await page.reload();
    await page.locator('.strip-0 canvas').waitFor();
    await until('the link shows the same', async () => (await page.getAttribute('#plots-live', 'aria-pressed')) === 'false');
    assert.deepEqual(address(), [from, to]);
    await page.click('#plots-live');
    await page.locator('#plots-live[aria-pressed=true]').waitFor();
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  page.on('pageerror', (error) => faults.push(error.message));
};

export const story = { bench, steps, open: open_pages };
