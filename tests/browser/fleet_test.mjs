// Many robots and several people: who may clear a latch, what is said of a stop of hundreds, robots that are hidden, and
// robots whose samples nobody asked for.
import assert from 'node:assert/strict';
import { clear_latch, mode_of as mode, samples, shows, sign_in as sign_in_by, take_control } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const kRobot = 'rheo-1';
const kPassword = 'correct horse battery';
const kFleet = 12; // more than a page watches at once
const kKnown = 620; // more robots that were seen once
const bench = new Bench();
let admin, operator, viewer;

const robot = (id = kRobot) => bench.ask(`/robots/${id}`);
const entry = (page, id) => page.locator('.robot-entry', { has: page.getByText(id, { exact: true }) });
const listed = async (page) => (await page.locator('.robot-entry .name').allInnerTexts()).sort();

async function sign_in(page, user) {
  await sign_in_by(page, bench.http, user, kPassword, entry(page, kRobot));
  await entry(page, kRobot).click();
  await page.locator('.annunciator h1').getByText(kRobot).waitFor();
}

async function hold(page, selector, ms) {
  const { x, y, width, height } = await page.locator(selector).boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.waitForTimeout(ms);
  await page.mouse.up();
}

// What the station would say if it knew hundreds of robots more, none of them connected.
async function make_large(page) {
  const model = await robot();
  const unknown = Array.from({ length: kKnown }, (_, n) => ({ ...model, robot_id: `seen-once-${n}`, link: 'disconnected', mode: 'unspecified', emergency_id: null, control: null }));
  await page.routeWebSocket(/\/live\?/, (socket) => {
    const station = socket.connectToServer();
    station.onMessage((text) => {
      const message = JSON.parse(text);
      if (message.type === 'welcome') message.robots.push(...unknown);
      socket.send(JSON.stringify(message));
    });
  });
  await page.route('**/api/v1/emergency-stop', async (route) => {
    const answer = await route.fetch();
    const content = await answer.json();
    content.commands.push(...unknown.map(({ robot_id }) => ({ ...content.commands[0], robot_id, state: 'queued' })));
    if (content.summary) {
      content.summary.robots += kKnown;
      content.summary.kept += kKnown;
      content.summary.not_acknowledged.push(...unknown.slice(0, 100).map(({ robot_id }) => ({ robot_id, outcome: 'kept' })));
      content.summary.not_named += kKnown - 100;
    }
    await route.fulfill({ response: answer, json: content });
  });
}

const steps = {
  async 'an admin, an operator and a viewer look at one robot'() {
    await bench.cli(['user', 'add', 'olga', '--role', 'operator'], kPassword);
    await bench.cli(['user', 'add', 'vera', '--role', 'viewer'], kPassword);
    bench.start_robot(kRobot);
    await until('the robot is there', async () => (await robot()).link === 'connected');
    await bench.sign_in(admin);
    await admin.locator('.annunciator h1').getByText(kRobot).waitFor();
    operator = await bench.open_page({ viewport: { width: 1440, height: 900 } });
    viewer = await bench.open_page({ viewport: { width: 1440, height: 900 } });
    await sign_in(operator, 'olga');
    await sign_in(viewer, 'vera');
    await until('the page shows who is in control', async () => /^Nobody is in control/.test(await viewer.locator('#control-line').innerText()));
    assert.equal(await viewer.locator('#control-line button').count(), 0);
  },

  async 'everybody sees who is in control'() {
    await take_control(operator, async () => ((await robot()).control?.holder ?? '').includes('olga'));
    for (const page of [viewer, admin]) {
      await until('it is shown', async () => /olga.* is in control/.test(await page.locator('#control-line').innerText()));
    }
  },

  async 'a latch is cleared by nobody but whoever is in control'() {
    await viewer.click('#emergency-stop');
    for (const page of [viewer, admin]) {
      await until('the latch is shown', async () => (await mode(page)) === 'emergency');
      const button = page.locator('#clear-emergency');
      await button.waitFor();
      assert.ok(await button.isDisabled());
      await shows(page, '#latch', /olga.* is in control and may clear it/);
      await hold(page, '#clear-emergency', 1300);
    }
    await samples(bench, kRobot, 100);
    assert.equal((await robot()).mode, 'emergency');
    await clear_latch(operator);
  },

  async 'nor by a viewer while nobody is in control'() {
    await operator.click('#release-control');
    await until('nobody is in control', async () => (await robot()).control === null);
    await viewer.click('#emergency-stop');
    await viewer.locator('#clear-emergency').waitFor();
    assert.ok(await viewer.locator('#clear-emergency').isDisabled());
    await shows(viewer, '#latch', /An operator may clear it/);
    await clear_latch(operator);
  },

  async 'of a robot whose samples are not watched no position is shown, and no green light'() {
    bench.start_fleet('tank', kFleet);
    await until('the fleet is listed', async () => (await admin.locator('.robot-entry').count()) === kFleet + 1);
    const unwatched = admin.locator('.robot-entry[data-tone=unwatched]');
    await until('only what is looked at is watched', async () => (await unwatched.count()) === kFleet);
    assert.equal(await unwatched.locator('.figure, .dot.good').count(), 0);
    assert.doesNotMatch((await unwatched.allInnerTexts()).join(), /–|mm/);
    await entry(admin, 'tank-3').click();
    await until('what is looked at has a position', async () => /± \d+\.\d mm/.test(await entry(admin, 'tank-3').locator('.figure').innerText()));
    await entry(admin, kRobot).click();
  },

  async 'a robot that is hidden stays hidden in this browser, and in no other'() {
    await admin.click('#edit-robots');
    for (const id of ['tank-1', 'tank-2']) await admin.getByRole('button', { name: `Hide ${id}`, exact: true }).click();
    await admin.click('#edit-robots');
    const hidden = async () => !(await listed(admin)).some((name) => ['tank-1', 'tank-2'].includes(name));
    await until('they are hidden', hidden);
    await admin.reload();
    await until('all others are listed', async () => (await listed(admin)).length === kFleet - 1);
    assert.ok(await hidden());
    await shows(admin, '#edit-robots', '2 hidden');
    assert.ok((await listed(operator)).includes('tank-1'));
  },

  async 'and is stopped like any other'() {
    await admin.click('#stop-all');
    // SAFETY: one press is enough. Where its answer is too late for the page, telemetry says what became of it.
    await shows(admin, '#stop-line', new RegExp(
      `^Stopped( ${kFleet + 1} of ${kFleet + 1} robots in \\d+ ms|: telemetry of every robot shows the latch)\\.$`));
    for (const id of ['tank-1', 'tank-2', 'tank-12', kRobot]) {
      const { mode: found, emergency_id } = await until(`${id} is latched`, async () => ((await robot(id)).mode === 'emergency' ? robot(id) : null));
      assert.equal(found, 'emergency');
      assert.notEqual(emergency_id, null);
    }
    await until('the hidden ones call', async () => (await admin.locator('#edit-robots').innerText()) === '2 hidden 2 in emergency');
    await until('so does the title', async () => /^EMERGENCY 13 robots/.test(await admin.title()));
  },

  async 'the outcome of a stop of hundreds leaves "clear" in reach at every size'() {
    const large = await operator.context().newPage();
    await make_large(large);
    for (const each of [admin, operator, viewer]) await each.close(); // four pages that draw would slow each other down
    await large.goto(bench.http);
    await until('all are known', async () => (await large.locator('.robot-entry').count()) === kKnown + kFleet + 1);
    await entry(large, kRobot).click();
    await large.click('#stop-all');
    await large.locator('#stop-line[data-phase=kept]').waitFor();
    const words = await large.locator('#stop-line').innerText();
    assert.match(words, /Stopped 13 of 633 robots in \d+ ms\./);
    assert.match(words, /and 617 more: not connected; kept/);
    for (const [width, height] of [[1440, 900], [1024, 768], [844, 390], [390, 844], [1440, 900]]) {
      await large.setViewportSize({ width, height });
      const look = () => large.locator('#clear-emergency').evaluate((button) => {
        if (innerWidth <= 760) scrollTo(0, 0);
        if (innerWidth <= 760) button.scrollIntoView({ block: 'center' }); // all of a telephone's page is one column
        const { left, top, width, height } = button.getBoundingClientRect();
        const hit = document.elementFromPoint(left + width / 2, top + height / 2);
        return { line_px: document.querySelector('#stop-line').offsetHeight, reached: Boolean(hit?.closest('#clear-emergency')) };
      });
      let found;  // a page that was cut off for a moment has other lines above it
      await until(`clear is in reach at ${width} × ${height}`, async () => (found = await look()).reached);
      assert.ok(found.line_px <= 80, `${found.line_px} px of outcome at ${width} × ${height}`);
    }
    await clear_latch(large);
    await until('the station knows it', async () => (await robot()).mode === 'manual');
    await large.click('#edit-robots');
    await large.click('#hide-away');
    await large.click('#edit-robots');
    await until('only those that are there', async () => (await large.locator('.robot-entry').count()) === kFleet + 1);
  },
};

const open_pages = async () => {
  admin = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
};

export const story = { bench, steps, open: open_pages };
