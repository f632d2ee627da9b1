// Experiments on the page: a profile that is chosen or pasted, its prediction, start, pause, resume and abort, the queue of
// a robot, and reservations; how it all fits on every screen.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { samples, shows as says } from './hands.mjs';
import { Bench, kLongestWait_ms, until } from './programs.mjs';

const kRobot = 'rheo-1';
const axe = readFileSync(createRequire(new URL('../../web/package.json', import.meta.url)).resolve('axe-core/axe.min.js'), 'utf8');
const bench = new Bench();
let page;

const profile = (name, for_s, kind = 'setpoint') => `name = "${name}"
purpose = "For the test of the page."

[limits]
position_min_m = -0.3
position_max_m = 0.3

[[step]]
${kind === 'duty' ? 'kind = "duty"\nduty = 0.2' : 'kind = "setpoint"\nsetpoint_m = 0.05'}
for_s = ${for_s}
`;
const go = (hash) => page.goto(`${bench.http}/#/experiments${hash}`);
const robot = () => bench.ask(`/robots/${kRobot}`);
const experiment = (id) => bench.ask(`/experiments/${id}`);
const state = () => page.locator('#experiment-state').getAttribute('data-state');
const shows = (what) => until(`the page shows ${what}`, async () => (await state()) === what);
const shows_before_abort = async (what) => {
  const seen = await until(`the page shows ${what}`, async () => {
    const now = await state();
    return [what, 'aborted'].includes(now) && now;
  });
  return seen === what;
};
const id_shown = () => until('the address names the experiment', () => /#\/experiments\/(\d+)$/.exec(page.url())?.[1]);
const is_at_rest = () => until('the robot is at rest', async () => {
  const { mode, sample } = await robot();
  return mode === 'manual' && sample.duty === 0;
});

// Writes a profile as a person who pastes it.
async function paste(text) {
  await go(`/new?profile=own&robot=${kRobot}`);
  await page.locator('#profile-own[aria-pressed=true]').waitFor();
  await page.fill('#profile-text', text);
}

async function start() {
  await page.locator('#start-experiment:enabled').click();
  return Number(await id_shown());
}

const kSizes = [[1440, 900], [1024, 768], [768, 1024], [390, 844], [844, 390]];
const kThemes = { 1440: ['light', 'dark'], 390: ['dark'] }; // in which axe-core looks
const unfit = []; // all of it is told at the end
async function fits(where) {
  for (const [width, height] of kSizes) {
    await page.setViewportSize({ width, height });
    const width_over = () => page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    await until('it fits', async () => (await width_over()) <= 0, 10_000).catch(() => undefined); // drawings follow a frame later
    const too_wide = await width_over();
    if (too_wide > 0) unfit.push(`${where} at ${width} × ${height} scrolls sideways by ${too_wide}`);
    const stop = await page.locator('#emergency-stop').boundingBox();
    if (!(stop && stop.y >= 0 && stop.y + stop.height <= height)) unfit.push(`${where} at ${width} × ${height}: the stop button is not in view`);
    for (const colorScheme of kThemes[width] ?? []) {
      await page.emulateMedia({ colorScheme });
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ['violations'] }));
      for (const { id, nodes } of violations) {
        const places = nodes.map((node) => `${node.target} ${node.any[0]?.message ?? ''}`).slice(0, 3);
        unfit.push(`${where} at ${width} × ${height}, ${colorScheme}: ${id}: ${places}`);
      }
    }
  }
  await page.setViewportSize({ width: 1440, height: 900 });
}

// Its number; null: axe-core kept the page for over 10 s from giving signs of life, and it was aborted, as it must be.
async function look_at_one_that_runs() {
  const faults_before = unfit.length;
  await is_at_rest();
  await paste(profile('Long', 600));
  const id = await start();
  await shows('running');
  await until('its progress is shown', async () => /Run 1 of 1, [1-9]\d* of 600 s/.test(await page.locator('#experiment-progress').innerText().catch(() => '')));
  await page.locator('#run-plot .track').waitFor();
  await says(page, '#presence', /in the hands of this page, which must stay open/);
  await fits('one that runs');
  await until('an interruption is over', async () => (await state()) !== 'paused');
  if ((await state()) === 'running') return id;
  unfit.length = faults_before;
  return null;
}

// Null when the machine stood still, and it was aborted by itself, as it must be.
async function paused_and_resumed() {
  const id = await look_at_one_that_runs();
  if (id === null) return null;
  await page.click('#pause-experiment');
  if (!(await shows_before_abort('paused'))) return null;
  await until('the robot rests', async () => (await robot()).mode === 'manual');
  await says(page, '#situation', /Somebody asked for it/);
  await page.click('#resume-experiment');
  if (!(await shows_before_abort('running'))) return null;
  await until('the robot moves again', async () => (await robot()).mode === 'auto' || (await state()) !== 'running');
  return (await state()) === 'running' ? id : null;
}

// Null when the machine stood still for longer than an experiment waits for its page.
async function begun_here(name) {
  await is_at_rest();
  await paste(profile(name, 120));
  const id = await start();
  await until('it runs', async () => (await experiment(id)).state !== 'waiting');
  return (await is_over(id)) ? null : id;
}
const is_over = async (id) => !/running|paused/.test((await experiment(id)).state); // an interruption is no end
// Until the page says so, or it is over; `act` is tried until then.
const presence = (of, id, what, act) =>
  until(`the page says ${what}`, async () => {
    const says_so = what.test(await of.locator('#presence').innerText({ timeout: 1000 }).catch(() => ''));
    if (says_so || (await is_over(id))) return true;
    await act?.().catch(() => undefined); // pressed again where it could not be pressed
    return false;
  });

async function kept_over_a_reload() {
  const id = await begun_here('in these hands');
  if (id === null) return null;
  const { client } = await experiment(id);
  await page.reload();
  await presence(page, id, /It is in the hands of this page/);
  if (await is_over(id)) return null;
  assert.equal((await experiment(id)).client, client, 'the tab goes by its id over a reload');
  return id;
}

async function taken_over() {
  const id = await begun_here('into other hands');
  if (id === null) return false;
  const taker = await page.context().newPage();
  await taker.goto(page.url());
  await presence(taker, id, /It is in the hands of another page or program of yours/);
  await presence(taker, id, /It is in the hands of this page/, () => taker.locator('#take-over:enabled').click({ timeout: 1000 }));
  await presence(page, id, /It is in the hands of another page or program of yours/);
  const was_over = await is_over(id);
  if (!was_over) await taker.locator('#abort-experiment').click();
  await until('it is over', () => is_over(id));
  await taker.close();
  return !was_over;
}

const steps = {
  async 'a profile that comes with the program is predicted, and its check list says that nothing is in the way'() {
    await bench.sign_in(page);
    bench.start_robot(kRobot);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await page.keyboard.press('g');
    await page.keyboard.press('e');
    await page.locator('#queue .empty').waitFor();
    await page.click('#tab-new');
    await page.click('#profile-figure_7');
    const figures = page.locator('.plan-figures');
    await until('the prediction is there', async () => /0 to 15\d mm/.test(await figures.innerText().catch(() => '')));
    await says(page, '.plan-figures', /Takes\s+40 s/);
    await until('nothing is in the way', async () => (await page.locator('#checks .ok').count()) === 6);
    assert.equal(await page.locator('#checks .waits').count(), 0);
    await says(page, '#presence', /This page must stay open/);
    await fits('to begin one');
  },

  async 'what the text says is predicted while it is typed, also that it leaves its limits'() {
    await page.locator('#profile-text').fill(profile('Too far', 10).replace('setpoint_m = 0.05', 'setpoint_m = 0.25').replace('position_max_m = 0.3', 'position_max_m = 0.25'));
    await until('the overshoot is named', async () => /pass limits\.position_max_m \(250 mm\) after/.test(await page.locator('#plan-problems').innerText().catch(() => '')));
    await page.click('#undo-text');
    await until('it is gone', async () => (await page.locator('#plan-problems').count()) === 0);
  },

  async 'an error in a pasted profile stands at its line, before the start and as the station says it'() {
    await paste(profile('Wrong', 10).replace('for_s', 'for_ever'));
    const fault = page.locator('#profile-fault');
    await until('the page marks the line', async () => (await fault.getAttribute('data-line')) === '8');
    await paste(profile('Wrong', 10).replace('setpoint_m = 0.05', 'setpoint_m = 0.7'));
    await until('the page can read it', async () => (await fault.getAttribute('data-line')) === '');
    await page.locator('#start-experiment:enabled').click();
    await until('the station names the line', async () => (await fault.getAttribute('data-line')) !== '');
    await says(page, '#profile-fault', /^Line \d+: .*setpoint_m is 0\.7/);
    const line = Number(await fault.getAttribute('data-line'));
    await until('the line is marked', () => page.locator('.editor li').nth(line - 1).evaluate((entry) => entry.classList.contains('wrong')));
    assert.deepEqual((await bench.ask('/experiments')).experiments, [], 'nothing was begun');
    await fits('a refused profile');
  },

  async 'nothing begins without the press on Start: not by Enter in a field, and not by an address'() {
    await paste(profile('Not yet', 10));
    await page.locator('#experiment-notes').fill('a note');
    await page.locator('#experiment-notes').press('Enter');
    await page.reload();
    await page.locator('#start-experiment').waitFor();
    await samples(bench, kRobot, 100);
    assert.deepEqual((await bench.ask('/experiments')).experiments, []);
  },

  async 'a duty runs through, because the page gives signs of life'() {
    // A page that a busy machine keeps from giving signs of life for 3 s has it aborted, as it must be.
    const id = await until('it is done', async () => {
      await is_at_rest();
      await paste(`${profile('Duty', 3, 'duty')}\n[sweep]\nrepeats = 2\n`);
      const begun = await start();
      const end = await until('it has ended', async () => /done|aborted/.exec(await state())?.[0]);
      return end === 'done' && begun;
    }, 3 * kLongestWait_ms);
    const { runs } = await experiment(id); // a busy browser may miss 400 ms: its step is repeated then
    assert.ok(runs[0].steps.length >= 1);
    await until('its runs are done', async () => /Done\s+run \d+[\s\S]*Done\s+run \d+/.test(await page.locator('#experiment-runs').innerText()));
    await page.reload(); // the samples that this page has received are gone
    await page.locator('#run-plot .track-key.measured').waitFor();
    const records = page.locator('#experiment-runs td a');
    await records.nth(1).waitFor();
    assert.equal(await records.first().getAttribute('href'), `#/runs/${runs[0].run_id}`);
    const plotted = page.locator('#run-plot h2');
    await says(page, '#run-plot h2', 'Run 2');
    await page.locator('#experiment-runs th a').first().click();
    await plotted.getByText('Run 1').waitFor();
    await page.locator('#run-plot .track-key.measured').waitFor();
    await page.waitForURL(/#\/experiments\/\d+\?run=1$/);
    await fits('one that is done');
  },

  async 'one that runs shows how far it is, pauses, resumes and is aborted'() {
    const id = await until('it is looked at, paused and resumed', paused_and_resumed, 3 * kLongestWait_ms);
    await page.click('#abort-experiment');
    await shows('aborted');
    await until('the robot rests', async () => (await robot()).mode === 'manual');
    assert.equal((await experiment(id)).reason, 'requested');
    await until('nothing more can be done with it', async () => (await page.locator('.acts button').count()) === 0);
  },

  async 'it is in the hands of one tab, over a reload, until another takes it over'() {
    const id = await until('a reload keeps it', kept_over_a_reload, 3 * kLongestWait_ms);
    const other = await page.context().newPage(); // the same session
    await other.goto(page.url());
    await page.goto('about:blank');
    await until('nobody is there for it', async () => (await experiment(id)).state === 'aborted');
    assert.equal((await experiment(id)).reason, 'nobody_present', 'the other tab is another client');
    await other.close();
    await page.goto(bench.http);
    await until('another tab takes it over', taken_over, 3 * kLongestWait_ms);
    await is_at_rest();
  },

  async 'the stop stops an experiment, from this page as from every other'() {
    await is_at_rest();
    await paste(profile('Stopped', 600));
    await start();
    await shows('running');
    await page.keyboard.press('Escape');
    await shows('aborted');
    await until('the robot is latched', async () => (await robot()).mode === 'emergency');
    await says(page, '#situation', /Somebody stopped the robot|The robot was in emergency/);
    await go(`/new?profile=figure_7&robot=${kRobot}`);
    await until('the check list says so', async () => /emergency\. Look at the robot, then clear/.test(await page.locator('#check-rest').innerText().catch(() => '')));
    await page.locator('#start-experiment', { hasText: 'Put into the queue' }).waitFor();
  },

  async 'the queue shows what waits and why, and its order is changed'() {
    const ids = [];
    for (const name of ['First', 'Second', 'Third']) {
      await paste(profile(name, 5));
      ids.push(await start());
      await shows('waiting');
    }
    await until('it waits for the others', async () => /Others are before it/.test(await page.locator('#situation').innerText()));
    await page.click('#tab-queue');
    const queue = page.locator(`#queue-${kRobot} .queue-list li`);
    const order = async () => Promise.all((await queue.all()).map((entry) => entry.getAttribute('data-experiment').then(Number)));
    await until('all wait', async () => (await queue.count()) === 3);
    await until('in their order', async () => String(await order()) === String(ids));
    await until('and why', async () => /The robot is in emergency/.test(await queue.first().innerText()));
    await queue.nth(2).locator('.step-up').click();
    await until('the third is second', async () => String(await order()) === String([ids[0], ids[2], ids[1]]));
    await queue.nth(0).locator('.step-down').click();
    await until('the third is first', async () => String(await order()) === String([ids[2], ids[0], ids[1]]));
    await until('the station has the same first', async () => (await experiment(ids[2])).waits_for === 'emergency');
    await until('and what was first waits for it', async () => (await experiment(ids[0])).waits_for === 'others');
    await fits('the queue');
    for (let left = 3; left > 0; --left) {
      await queue.first().locator('.ends').click();
      await until('it is gone', async () => (await queue.count()) === left - 1);
    }
    const ended = page.locator('#history tbody tr');
    await until('all are in the history, newest first', async () => (await ended.first().locator('th').innerText()) === String(ids[2]));
    await until('how it has ended', async () => /Cancelled/.test(await ended.first().innerText()));
    await fits('history');
  },

  async 'a reservation is made, shown, and cancelled; a time that cannot be is named'() {
    await page.click('#tab-reservations');
    await page.fill('#from-day', 'tomorrow');
    await page.fill('#from-clock', 'noon');
    await page.fill('#until-clock', '14:30');
    await page.click('#reserve');
    await says(page, '#reserve-problem', /^From: “noon” is no time/);
    await page.fill('#from-clock', '12:00');
    await page.fill('#purpose', 'tubes of bed 3');
    await page.locator('#purpose').press('Enter');
    const list = page.locator('.reservation-list li');
    await until('it is listed', async () => (await list.count()) === 1);
    await says(page, '.reservation-list li', /12:00 to .* 14:30\s+for you: tubes of bed 3/);
    await until('it is in the bars', async () => (await page.locator('#day-bars rect.mine').count()) === 1);
    const [{ from_us, until_us }] = (await bench.ask('/reservations?over=false')).reservations;
    assert.equal((until_us - from_us) / 3600e6, 2.5);
    await fits('reservations');
    await list.getByRole('button').click();
    await until('it is gone', async () => (await list.count()) === 0);
    await until('also at the station', async () => (await bench.ask('/reservations?over=false')).reservations.length === 0);
  },

  async 'nothing can be started while the page is cut off, and the last state is not shown as present'() {
    await go(`/new?profile=figure_7&robot=${kRobot}`);
    await page.locator('#start-experiment:enabled').waitFor();
    bench.station.process.kill('SIGSTOP');
    try {
      await page.locator('#start-experiment:disabled').waitFor();
      await says(page, '#start-note', /Cut off from the station/);
      await page.locator('#checks').waitFor({ state: 'detached' });
    } finally {
      bench.station.process.kill('SIGCONT');
    }
  },

  'all of it fits on every screen, and axe-core finds nothing'() {
    assert.deepEqual(unfit, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
};

export const story = { bench, steps, open: open_pages };
