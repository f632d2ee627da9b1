// The view Station: each section against the real station, with what an admin does there and what a viewer sees.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { assert_accessible } from './accessible.mjs';
import { commanded, hold as hold_on, shows, sign_in } from './hands.mjs';
import { Bench, until } from './programs.mjs';

const { encode } = createRequire(new URL('../../web/package.json', import.meta.url))('uqr');
const kSections = ['health', 'storage', 'backups', 'accounts', 'sessions', 'tokens', 'robots', 'audit', 'log',
                   'certificate', 'configuration', 'about'];
const kForAdmins = ['accounts', 'sessions', 'tokens', 'robots', 'audit'];
const kNew = 'rheo-1';
const kSizes = [[1440, 900], [390, 844]];
const bench = new Bench();
const faults = [];
let page;
let secret = '';

const text = (selector) => page.locator(selector).first().innerText();
const address = () => page.evaluate(() => location.hash);
const address_is = (wanted) => until(`the address is ${wanted}`, async () => (await address()) === wanted);
const word = (line) => page.locator(`#station-line-${line}`).getAttribute('data-word');
const is_there = async (selector) => (await page.locator(selector).count()) > 0;
const open = async (section, is_for_all = true) => {
  await page.click(`#station-open-${section}`);
  await page.locator(is_for_all ? `#station-${section}` : '#station-forbidden').waitFor();
};
const enrolment = async (robot_id) =>
  (await bench.ask('/enrolments')).enrolments.find((each) => each.robot_id === robot_id);
const entries = async (query) => (await bench.ask(`/audit?${query}`)).entries;

const hold = (selector, what, done) => hold_on(page, selector, what, done);

const choose = async (field, option) => {
  await page.click(`#${field}`);
  await page.locator(`#${field}-list [role=option]`, { hasText: option }).click();
};

const steps = {
  async 'health: every line has a word, and all is well with two robots'() {
    bench.start_fleet('sim', 2);
    await bench.sign_in(page);
    await until('both robots are known', async () => (await bench.ask('/robots')).robots.length === 2);
    await page.click('#open-station');
    await until('all is well', async () => (await page.locator('#station-summary').getAttribute('data-word')) === 'good');
    assert.equal(await page.locator('.station-health-table tbody tr').count(), 16);
    await shows(page, '#station-line-robots .value', /^2 of 2 connected$/);
    await shows(page, '#station-line-stop .value', /^open to all 2 connected$/);
    await shows(page, '#station-line-writes .value', /^\d+ samples\/s, \d+\.\d commits\/s$/);
    await shows(page, '#station-line-stops .value', /^none since the start$/);
  },

  async 'each section has an address, and "back" leads back; an address of nothing says so'() {
    for (const section of kSections) {
      await open(section);
      await address_is(`#/station/${section}`);
      await page.locator(`.station-sections #station-open-${section}[aria-current=page]`).waitFor();
    }
    await page.goBack();
    await page.locator('#station-configuration').waitFor();
    await page.goto(`${bench.http}/#/station/nowhere`);
    await page.locator('#station-no-section').waitFor();
    await page.goto(`${bench.http}/#/station/storage`);
    await page.locator('#station-database').waitFor();
    await until('the pace is measured', async () => /days|years/.test(await text('.station-figures > div:nth-child(4) dd')));
    await open('about');
    const [file] = await Promise.all([page.waitForEvent('download'), page.click('#station-openapi')]);
    assert.equal(file.suggestedFilename(), 'rheonaut-openapi.yaml');
    assert.equal(await file.failure(), null);
  },

  async 'an account: a wrong name is said, then it is added, and its role is changed'() {
    await open('accounts');
    await page.fill('#station-user-name', 'Vera Q');
    await page.fill('#station-user-password', 'correct horse battery');
    await page.click('#station-add-user');
    assert.match(await text('#station-user-problem'), /^name = “Vera Q” is not 1 to 31 characters of a-z/);
    await page.fill('#station-user-name', 'vera');
    await choose('station-user-role', 'operator');
    await page.click('#station-add-user');
    await page.locator('#station-user-added').waitFor();
    assert.equal(await text('#station-new-password'), 'correct horse battery');
    await page.locator('#station-user-added button', { hasText: 'Done' }).click();
    const row = page.locator('tr[data-user=vera]');
    await until('it has its role', async () => (await row.locator('.role').innerText()) === 'operator');
    await row.locator('button').click();
    await choose('station-edit-role', 'viewer');
    await page.click('#station-save-user');
    await until('the row has the new role', async () => (await row.locator('.role').innerText()) === 'viewer');
    const { users } = await bench.ask('/users');
    assert.deepEqual(users.map(({ name, role }) => [name, role]), [['vera', 'viewer']]);
    await row.locator('button').click();
    await page.fill('#station-edit-password', 'another horse battery');
    await page.click('#station-save-user');
    await page.locator('#station-user-changed').waitFor();
    assert.equal(await text('#station-changed-password'), 'another horse battery');
    await page.locator('#station-user-changed button', { hasText: 'Done' }).click();
    await page.locator('#station-user-changed').waitFor({ state: 'detached' });
  },

  async 'a one-time link works once and is gone when it is done'() {
    await hold('#station-make-link', 'a link is made', () => is_there('#station-link'));
    const url = await text('#station-link-url');
    const other = await bench.open_page();
    // What a picture or a prefetch of another page does to it: it is opened, and nobody presses.
    for (let i = 0; i < 2; i += 1) assert.equal((await fetch(url)).headers.get('set-cookie'), null);
    await other.goto(url);
    await other.locator('#use-link').waitFor();
    await bench.sign_in(other, url);
    await other.locator('#emergency-stop').waitFor();
    await other.context().clearCookies();
    await other.goto(url);
    await other.click('#use-link');
    await other.locator('#link-error').getByText('This link is no longer valid').waitFor();
    await other.context().close();
    await page.locator('#station-link button', { hasText: 'Done' }).click();
    await until('it is gone', async () => !(await page.content()).includes(url));
  },

  async 'a token: made, shown once, works, is revoked and works no longer'() {
    await open('tokens');
    await page.fill('#station-token-name', 'logger');
    await page.fill('#station-token-days', '4000');
    await page.click('#station-make-token');
    assert.match(await text('#station-token-problem'), /^days = “4000” is not a whole number from 1 to 3650/);
    await page.fill('#station-token-days', '30');
    await page.check('#station-scope-record');
    await page.click('#station-make-token');
    const token = await text('#station-token-secret');
    const status = async () =>
      (await fetch(`${bench.http}/api/v1/station`, { headers: { Authorization: `Bearer ${token}` } })).status;
    assert.equal(await status(), 200);
    await page.click('#station-token-done');
    await until('it is not shown again', async () => !(await page.content()).includes(token));
    assert.match(await page.locator('tr[data-token=logger]').innerText(), /read, ?record/);
    await hold('#station-revoke-logger', 'it is revoked', () => is_there('#station-token-revoked tr[data-token=logger]'));
    assert.equal(await status(), 401);
  },

  async 'a session is signed out, and its page with it'() {
    const other = await bench.open_page();
    await bench.sign_in(other, (await bench.post('/login-links', {})).answer.url);
    await other.locator('#emergency-stop').waitFor();
    await open('sessions');
    await page.getByText('this page', { exact: true }).waitFor();
    const rows = page.locator('#station-session-list tr[data-session]');
    await until('both are listed', async () => (await rows.count()) >= 2);
    const number = Math.max(...(await rows.evaluateAll((all) => all.map((each) => Number(each.dataset.session)))));
    await hold(`#station-sign-out-${number}`, 'it is gone', async () => !(await is_there(`tr[data-session="${number}"]`)));
    await other.locator('.signed-out').waitFor();
    await other.context().close();
  },

  async 'a robot is enrolled: token, QR code and lines, and it connects with that token'() {
    await open('robots');
    await until('both are listed', async () => (await page.locator('tr[data-robot]').evaluateAll((all) => all.map((each) => each.dataset.robot))).join() === 'sim-1,sim-2');
    await page.fill('#station-robot-name', 'Rheo 1');
    await page.click('#station-enrol');
    assert.match(await text('#station-enrol-problem'), /^robot = “Rheo 1” is not 1 to 31 characters/);
    await page.fill('#station-robot-name', 'sim-1');
    await page.getByText('sim-1 is connected without a token').waitFor();
    await page.fill('#station-robot-name', kNew);
    await page.click('#station-enrol');
    secret = await text('#station-robot-secret');
    assert.match(secret, /^[\w-]{43}$/);
    const said = await text('#station-robot-text');
    assert.equal(said, `rheonaut-robot:1?id=${kNew}&token=${secret}&station=${bench.endpoints.robots}`);
    assert.ok((await text('#station-sim-line')).endsWith(`--id ${kNew} --token ${secret}`));
    await until('the code is of that text', async () => JSON.stringify(await drawn_modules('#station-robot-code')) === JSON.stringify(encode(said, { ecc: 'M', border: 0 }).data));
    bench.start_robot(kNew, '--token', secret);
    await until('the page sees it connected', async () => /connected$/.test(await text('#station-enrolled-link')));
  },

  async 'its code follows the address, and a text is selected where there is no clipboard'() {
    await page.fill('#station-robot-address', 'lab');
    await page.getByText('station = “lab” is not ADDRESS:PORT').waitFor();
    await page.fill('#station-robot-address', '192.168.1.20:7070');
    await shows(page, '#station-robot-text', /&station=192\.168\.1\.20:7070$/);
    const code = encode(await text('#station-robot-text'), { ecc: 'M', border: 0 }).data;
    await until('the code is of that text', async () => JSON.stringify(await drawn_modules('#station-robot-code')) === JSON.stringify(code));
    await page.evaluate(() => Object.defineProperty(navigator, 'clipboard', { value: undefined, configurable: true }));
    await page.click('#copy-station-robot-secret');
    await page.getByText('Selected: press Ctrl C').waitFor();
    await until('the token is selected', async () => (await page.evaluate(() => String(getSelection()))) === secret);
    await page.click('#station-enrolled-done');
    await until('it is not shown again', async () => !(await page.content()).includes(secret));
  },

  async 'Escape stops while a name is typed here'() {
    const robot_id = /stops (\S+)/.exec(await text('#emergency-stop .whom'))[1];
    await page.fill('#station-robot-name', 'rheo-2');
    await page.keyboard.press('Escape');
    await until('it is latched', async () => (await bench.ask(`/robots/${robot_id}`)).emergency_id !== null);
    await open('health');
    await until('the stop is counted', async () => /^1 acknowledged, 99 % within/.test(await text('#station-line-stops .value')));
  },

  async 'a robot is retired and put back, revoked, and gets a new token'() {
    await open('robots');
    const state = () => page.locator(`tr[data-robot=${kNew}] .state`).innerText();
    await hold(`#station-retire-${kNew}`, 'it is retired', async () => /^retired /.test(await state()));
    await until('the station has it', async () => (await enrolment(kNew)).retired_at_us !== null);
    await hold(`#station-retire-${kNew}`, 'it is put back', async () => (await state()) === 'in use');
    await hold(`#station-retire-${kNew}`, 'it is retired again', async () => /^retired /.test(await state()));
    await hold(`#station-revoke-${kNew}`, 'it is revoked', async () => /^revoked /.test(await state()));
    await until('its connection has ended', async () => (await bench.ask(`/robots/${kNew}`)).link === 'disconnected');
    await hold(`#station-again-${kNew}`, 'it has a new token', () => is_there('#station-robot-secret'));
    assert.notEqual(await text('#station-robot-secret'), secret);
    await page.click('#station-enrolled-done');
  },

  async 'a backup is made, and a second one of its name is refused with the reason'() {
    await open('backups');
    await page.getByText('No backup yet').waitFor();
    await page.fill('#station-backup-name', 'mon day');
    await page.click('#station-make-backup');
    assert.match(await text('#station-backup-problem'), /^name = “mon day” is not 1 to 64 characters/);
    await page.fill('#station-backup-name', 'monday');
    await page.click('#station-make-backup');
    await page.locator('tr[data-backup=monday][data-state=done]').waitFor();
    const path = await page.locator('tr[data-backup=monday] .path').innerText();
    assert.ok(existsSync(path), path);
    assert.ok((await text('#station-restore-line')).includes(`--from ${path} `));
    await page.fill('#station-backup-name', 'monday');
    await page.click('#station-make-backup');
    await until('the refusal', async () => (await is_there('#station-backup-problem')) && /is there already/.test(await text('#station-backup-problem')));
    await page.fill('#station-backup-name', '');
    await page.click('#station-make-backup');
    await page.locator('tr[data-backup^="20"][data-state=done]').waitFor(); // it is called by its time
  },

  async 'the audit has all of it, newest first; filters stand in the address'() {
    await open('audit');
    await page.locator('tr[data-entry]').first().waitFor();
    const actions = () => page.locator('tr[data-entry]').evaluateAll((all) => all.map((each) => each.dataset.action));
    for (const action of ['account.user_added', 'account.user_changed', 'account.link_made', 'account.token_made', 'account.token_revoked',
                          'account.session_ended', 'robot.enrolled', 'robot.retired', 'robot.unretired', 'robot.revoked'])
      await until(`${action} is listed`, async () => (await actions()).includes(action));
    const numbers = await page.locator('tr[data-entry]').evaluateAll((all) => all.map((each) => Number(each.dataset.entry)));
    assert.deepEqual(numbers, [...numbers].sort((a, b) => b - a));
    await choose('station-audit-action', 'robot');
    await address_is('#/station/audit?action=robot');
    await until('only those', async () => (await page.locator('tr[data-entry]:not([data-action^="robot."])').count()) === 0);
    await page.locator('tr[data-action="robot.retired"] .station-link', { hasText: kNew }).first().click();
    await address_is(`#/station/audit?action=robot&robot=${kNew}`);
    await page.fill('#station-audit-actor', 'user:nobody');
    await page.getByText('No entry is like that').waitFor();
    await page.click('#station-audit-all');
    await address_is('#/station/audit');
    await page.locator('tr[data-action="account.user_added"] .number .station-link').click();
    const [added] = await entries('action=account.user_added');
    await page.getByText(added.hash).waitFor();
  },

  async 'what is new comes on top by itself, and older pages on demand'() {
    await commanded(bench, 'sim-2', { kind: 'ping' });
    await until('it is on top', async () => /^command\./.test(await page.locator('tr[data-entry]').first().getAttribute('data-action')));
    for (let at = 0; at < 110; ++at) await bench.post('/robots/sim-2/commands', { kind: 'ping' });
    await page.reload();
    await page.locator('#station-audit-older').waitFor();
    await until('a page of them is there', async () => (await page.locator('tr[data-entry]').count()) === 100);
    await page.click('#station-audit-older');
    await until('all are there', async () => (await page.locator('tr[data-entry]').last().getAttribute('data-entry')) === '1');
    await page.locator('#station-audit-older').waitFor({ state: 'detached' });
  },

  async 'times are local or UTC by one switch, and exact when pointed at'() {
    const shown = () => text('tr[data-entry="1"] time');
    const [first] = (await entries('limit=1000')).slice(-1);
    const utc = new Date(first.at_us / 1000).toISOString().slice(0, 19).replace('T', ' ');
    if ((await text('#station-clock')) === 'Local time') await page.click('#station-clock');
    await until('UTC is shown', async () => (await shown()) === utc);
    assert.ok((await page.locator('tr[data-entry="1"] time').getAttribute('title')).startsWith(utc));
    await page.click('#station-clock');
  },

  async 'a station that stands still: no line says good, and values are marked'() {
    await open('health');
    await until('the recording is good', async () => (await word('recording')) === 'good');
    bench.station.process.kill('SIGSTOP');
    await until('no line is good', async () => (await page.locator('.station-health-table tr.good').count()) === 0);
    await until('what it was is not known now', async () => (await word('recording')) === 'unknown');
    await shows(page, '#station-line-recording .value', /everything is recorded/);
    await until('its value is marked', () => page.locator('#station-line-recording .value').evaluate((cell) => getComputedStyle(cell).fontStyle === 'italic'));
    bench.station.process.kill('SIGCONT');
    await until('it is good again', async () => (await word('recording')) === 'good');
  },

  async 'a viewer sees how the station does, and of the rest that it is for admins'() {
    const admin = page;
    page = await bench.open_page();
    page.on('pageerror', (error) => faults.push(error.message));
    await sign_in(page, bench.http, 'vera', 'another horse battery', page.locator('#open-station'));
    await page.click('#open-station');
    await until('health is judged', async () => (await word('recording')) === 'good');
    for (const section of kForAdmins) {
      await open(section, false);
      assert.match(await text('#station-forbidden'), /are for admins[\s\S]*as vera, a viewer/);
      assert.equal(await page.locator('.station-view form, .station-view table').count(), 0, section);
    }
    await open('backups');
    await page.locator('tr[data-backup=monday]').waitFor();
    assert.equal(await is_there('#station-make-backup'), false);
    await assert_accessible(page, 'the accounts of a viewer', kSizes);
    await page.context().close();
    page = admin;
  },

  async 'axe finds nothing, in light and in dark, on a desk and on a phone'() {
    for (const section of kSections) {
      await open(section);
      await assert_accessible(page, section, kSizes, () => ['light', 'dark']);
    }
    await page.setViewportSize({ width: 1440, height: 900 });
    await open('accounts');
    await page.locator('tr[data-user=vera] button').click();
    await page.locator('#station-save-user').waitFor();
    await assert_accessible(page, 'an account that is changed', kSizes);
    await page.setViewportSize({ width: 1440, height: 900 });
    await open('robots');
    await page.fill('#station-robot-name', 'rheo-3');
    await page.click('#station-enrol');
    await page.locator('#station-robot-code').waitFor();
    await assert_accessible(page, 'a robot that is enrolled', kSizes, () => ['light', 'dark']);
    await page.setViewportSize({ width: 1440, height: 900 });
  },

  async 'an account is kept out and removed'() {
    await open('accounts');
    await page.locator('tr[data-user=vera] button').click();
    await hold('#station-disable', 'it may not sign in', () => is_there('tr[data-user=vera].off'));
    await page.locator('tr[data-user=vera] button').click();
    await hold('#station-remove', 'it is gone', async () => !(await is_there('tr[data-user=vera]')));
    assert.deepEqual((await bench.ask('/users')).users, []);
  },

  async 'the page made no error of its own'() {
    assert.deepEqual(faults, []);
  },
};

// The modules of a QR code as its path draws them.
async function drawn_modules(selector) {
  const { path, view } = await page.locator(selector).evaluate((svg) => ({
    path: svg.querySelector('path').getAttribute('d'),
    view: svg.getAttribute('viewBox').split(' ').map(Number),
  }));
  const size = view[2] + 2 * view[0]; // without the quiet zone
  assert.deepEqual(view, [-4, -4, size + 8, size + 8]);
  const modules = Array.from({ length: size }, () => Array.from({ length: size }, () => false));
  for (const [, x, y, length] of path.matchAll(/M(\d+) (\d+)h(\d+)/g))
    for (let step = 0; step < Number(length); ++step) modules[y][Number(x) + step] = true;
  return modules;
}

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, acceptDownloads: true });
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => message.type() === 'error' && !/status of \d{3}|net::ERR/.test(message.text()) && faults.push(message.text()));
};

export const story = { bench, steps, open: open_pages };
