// Escape stops the robot once, in every view that the navigation names and at every address that is linked there: with each
// control focused, with something typed in each field, and with each thing open that opens.
//
// A view is found by its link, a part that opens by aria-expanded or <summary>; so a new one is walked as well.
import assert from 'node:assert/strict';
import { drawn, go_to, live, samples } from './hands.mjs';
import { Bench, kLongestWait_ms, until } from './programs.mjs';

const kRobot = 'sim-1';
const kFocusable = 'button, input, select, textarea, a[href], summary, [tabindex], [contenteditable]';
const kOpeners = '[aria-expanded], summary';
const kNative = 'select, datalist, input[list], dialog, [popover], input[type=date], input[type=time], input[type=month], input[type=week], input[type=datetime-local], input[type=color], input[type=file]';
const kOffering = 'input:not([type=range], [type=checkbox], [type=radio], [autocomplete=off])'; // a browser would list earlier entries
const kAddresses = 12; // of a view, beside its own
const kAlike = 2;
const bench = new Bench();
const faults = [];
const in_flight = new Set(); // what the page has asked for
let page;
let presses = 0;

// In the page, before its own code: each stop that leaves it, by way and key.
function count_stops() {
  window.stops = { http: [], socket: [] };
  window.looked = { http: 0, socket: 0 }; // how many of them were seen
  const { fetch: sent } = window;
  window.fetch = (path, options) => {
    if (/\/emergency-stop$/.test(String(path))) window.stops.http.push(options.headers['Idempotency-Key']);
    return sent(path, options);
  };
  const { send } = WebSocket.prototype;
  WebSocket.prototype.send = function (text) {
    if (/"emergency_stop"/.test(text)) window.stops.socket.push(JSON.parse(text).key);
    return send.call(this, text);
  };
}

// In the page: marks the controls within `scope` that can have the focus and have no mark yet, and gives their names. Of
// those that differ in numbers only, as the rows of a list do, it takes kAlike at each address; so a list that grows with
// each stop is not walked for ever.
const mark = (scope) =>
  page.evaluate(
    ([scope, focusable, alike]) => {
      const kText = 'textarea, [contenteditable], input:not([type=range], [type=checkbox], [type=radio], [type=file], [type=submit], [type=button])';
      const found = [];
      for (const control of new Set([...document.querySelectorAll(scope)].flatMap((each) => [...each.querySelectorAll(focusable)]))) {
        if (control.dataset.probe || control.disabled || control.tabIndex < 0 || !control.checkVisibility()) continue;
        const name = control.id || control.getAttribute('aria-label') || control.textContent.trim().slice(0, 30) || control.className;
        const kind = `${control.tagName}.${control.className} ${name}`.replace(/\d+/g, '#');
        const count = (window.walked.get(kind) ?? 0) + 1;
        window.walked.set(kind, count);
        if (count > alike) continue;
        window.probes = (window.probes ?? 0) + 1;
        control.dataset.probe = String(window.probes);
        found.push({ probe: control.dataset.probe, name, is_text: control.matches(kText) });
      }
      return found;
    },
    [scope, kFocusable, kAlike],
  );
const forget_marks = () =>
  page.evaluate(() => {
    window.walked = new Map();
    document.querySelectorAll('[data-probe]').forEach((each) => delete each.dataset.probe);
  });

const focus = (probe) =>
  page.evaluate((probe) => {
    const control = document.querySelector(`[data-probe="${probe}"]`);
    control?.focus();
    return control !== null && document.activeElement === control;
  }, probe);

// The robot has answered the newest stop: of more than 16 that it has not, the station makes one.
const answered = () =>
  until('the robot answers', async () => {
    const { commands } = await bench.ask(`/robots/${kRobot}/commands?limit=1`);
    return !['queued', 'sent'].includes(commands[0]?.state);
  });

// One press of Escape has left the page once by each way, and under one key, when this returns. An earlier press that the
// page sends again meanwhile, since the station was late with its answer, has its own key.
async function escape_stops(what) {
  if (presses % 8 === 0) await answered();
  await page.keyboard.press('Escape');
  presses += 1;
  const { http, socket } = await page.evaluate(() => {
    const since_the_last = (way) => {
      const [before, after] = [window.stops[way].slice(0, window.looked[way]), window.stops[way].slice(window.looked[way])];
      window.looked[way] = window.stops[way].length;
      return after.filter((key) => !before.includes(key));
    };
    return { http: since_the_last('http'), socket: since_the_last('socket') };
  });
  assert.deepEqual([http.length, socket.length], [1, 1], `${what}: one stop, by both ways`);
  assert.equal(http[0], socket[0], `${what}: it is one`);
}

async function with_each_focused(where, scope) {
  let walked = 0;
  for (const { probe, name, is_text } of await mark(scope)) {
    if (!(await focus(probe))) continue; // it went when another one lost the focus
    walked += 1;
    if (!is_text) {
      await escape_stops(`${where}, ${name}`);
      continue;
    }
    await page.keyboard.type('7');
    await escape_stops(`${where}, typing in ${name}`);
    await page.keyboard.press('Backspace');
  }
  return walked;
}

// Opens each thing that opens, and presses Escape on it and on each control that came with it.
async function with_each_open(where, scope) {
  const openers = await page.evaluate(
    ([scope, openers]) =>
      [...document.querySelectorAll(scope)].flatMap((each) => [...each.querySelectorAll(openers)]).filter((each) => !each.disabled && each.dataset.probe && each.checkVisibility()).map((each) => ({ probe: each.dataset.probe, name: each.id || each.textContent.trim().slice(0, 30) })),
    [scope, kOpeners],
  );
  const is_open = (probe) =>
    page.evaluate((probe) => {
      const control = document.querySelector(`[data-probe="${probe}"]`);
      return control !== null && (control.matches('summary') ? control.parentElement.open : control.getAttribute('aria-expanded') === 'true');
    }, probe);
  const is_there = (probe) => page.evaluate((probe) => document.querySelector(`[data-probe="${probe}"]`)?.checkVisibility() === true, probe);
  const open = async (probe) => {
    if (await is_open(probe)) return true;
    if (!(await focus(probe))) return false;
    await page.evaluate((probe) => document.querySelector(`[data-probe="${probe}"]`).click(), probe);
    return until('it opens', () => is_open(probe), 3000).catch(() => false);
  };
  for (const { probe, name } of openers) {
    if (!(await open(probe))) {
      assert.ok(!(await is_there(probe)), `${where}: ${name} opens`); // some go by themselves: force-control with the lease
      continue;
    }
    await page.keyboard.press('ArrowDown'); // within a list; elsewhere nothing
    await escape_stops(`${where}, ${name} open`);
    await open(probe);
    for (const inner of await mark(scope)) {
      if (!(await open(probe))) break;
      await page.evaluate((probe) => document.querySelector(`[data-probe="${probe}"]`)?.focus(), inner.probe);
      await escape_stops(`${where}, ${name} open, ${inner.name}`);
    }
  }
  return openers.length;
}

// Addresses of that view that are linked where the page is now.
const links_of = (view) =>
  page.evaluate((view) => [...document.querySelectorAll('.view a[href], .controls a[href]')].map((each) => each.getAttribute('href').split('?')[0]).filter((each) => each.startsWith(`#/${view}`)), view);
// The view is there with all that it asks for: what comes later would not be walked.
const loaded = async () => {
  const controls = () => page.locator(kFocusable).count();
  await until('the view is there', () => page.evaluate(() => document.querySelector('.view')?.children.length > 0 && !document.querySelector('#not-loaded')));
  await until('it has all that it asks for', async () => {
    const before = await controls();
    for (let look = 0; look < 3; ++look) {
      if (in_flight.size > 0) return false;
      await drawn(page);
    }
    return in_flight.size === 0 && (await controls()) === before;
  });
};

const connected_at_us = async () => (await bench.ask(`/robots/${kRobot}`)).connected_at_us;

// How many stops of the robot the station has, since that moment by its clock.
async function stops_since(utc_us) {
  const { commands } = await bench.ask(`/robots/${kRobot}/commands?limit=1000`);
  return commands.filter((each) => each.kind === 'emergency_stop' && each.submitted_at_us >= utc_us).length;
}

const steps = {
  async 'a station with a robot, a run that is over, one that is open, and an experiment'() {
    bench.start_robot(kRobot);
    await bench.sign_in(page);
    await page.locator('.annunciator h1').getByText(kRobot).waitFor();
    await live(page);
    const begun = await bench.post('/runs', { robot_id: kRobot, name: 'over' });
    assert.equal(begun.status, 201, JSON.stringify(begun.answer));
    await samples(bench, kRobot, 100);
    assert.equal((await bench.post(`/runs/${begun.answer.run_id}/end`)).status, 200);
    const { status, answer } = await bench.post('/experiments', { robot_id: kRobot, profile: 'figure_7' });
    assert.equal(status, 202, JSON.stringify(answer));
    assert.equal((await bench.post(`/experiments/${answer.experiment_id}/abort`, { reason: 'enough' })).status, 200);
    await until('a run begins', async () => (await bench.post('/runs', { robot_id: kRobot, name: 'open' })).status === 201);
  },

  async 'one press is one stop: every view, every address, every control, everything open'() {
    const views = await page.locator('.views a').evaluateAll((links) => links.map((link) => link.id.replace('open-', '')));
    assert.ok(views.length >= 5, views.join());
    for (const view of views) {
      await page.click(`#open-${view}`);
      await loaded();
      const addresses = new Set([`#/${view}`]); // one that is found on the way is walked as well
      for (const address of addresses) {
        const is_first = address === `#/${view}`;
        if (!is_first) {
          await go_to(page, address);
          await loaded();
        }
        for (const found of await links_of(view)) if (addresses.size <= kAddresses) addresses.add(found);
        // What is the same in each view is walked once for each, with the first address.
        const scope = is_first ? 'body' : '.view, .controls';
        const begun = performance.now();
        let [before, walked, opened] = [presses, 0, 0];
        // Of several stops for a robot that is away the station keeps one, so they cannot be counted: on a machine that made
        // it miss the robot the address is walked again.
        await until(`${address} is walked with the robot there`, async () => {
          const since_us = await connected_at_us();
          const { utc_us } = await bench.ask('/station');
          before = presses;
          await forget_marks();
          walked = await with_each_focused(address, scope);
          opened = await with_each_open(address, scope);
          let stopped = 0;
          const has_each = until('the station has each press', async () => (stopped = await stops_since(utc_us)) >= presses - before);
          await has_each.catch(async (error) => {
            if ((await connected_at_us()) === since_us) throw new Error(`${address}: ${error.message}: ${stopped} of ${presses - before}`);
          });
          if ((await connected_at_us()) !== since_us) return false;
          assert.equal(await stops_since(utc_us), presses - before, `${address}: and none twice`);
          return true;
        }, 10 * kLongestWait_ms);
        for (const kind of [kNative, kOffering]) {
          const found = await page.locator(kind).evaluateAll((all) => all.map((each) => each.outerHTML));
          assert.deepEqual(found, [], `${address}: a list or dialog of the browser keeps the first Escape for itself`);
        }
        assert.ok(walked > 0 || !is_first, `${address}: it has controls`);
        console.log(`    ${address}: ${walked} controls, ${opened} that open, ${presses - before} presses (${Math.round(performance.now() - begun)} ms)`);
        assert.ok(presses - before < 1000, 'more than one list of the station holds');
      }
    }
    assert.ok(presses > 150, `${presses} presses`);
  },

  async 'the robot is latched, and the page made no error of its own'() {
    await until('it is latched, with its motor off', async () => {
      const { mode, sample } = await bench.ask(`/robots/${kRobot}`);
      return mode === 'emergency' && sample.duty === 0;
    });
    assert.deepEqual(faults, []);
  },
};

const open_pages = async () => {
  page = await bench.open_page({ viewport: { width: 1440, height: 900 }, colorScheme: 'dark' });
  await page.addInitScript(count_stops);
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('request', (request) => in_flight.add(request));
  for (const end of ['requestfinished', 'requestfailed']) page.on(end, (request) => in_flight.delete(request));
};

export const story = { bench, steps, open: open_pages };
