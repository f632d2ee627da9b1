// The film of the README: Figure 7 of the paper with its disturbance, a stop in full motion, and a station that is killed
// and comes back; the real page in headless Chromium, with a real station and a simulated robot, in real time.
//
//   film.mjs OUT.webp        (deploy/film builds what this needs and calls it)
//
// Besides the page the film shows the pointer, which headless Chromium does not draw, and a line of text below.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { clear_latch } from '../tests/browser/hands.mjs';
import { Bench, until } from '../tests/browser/programs.mjs';
import { confirm_model } from './page_scenes.mjs';

const kRobot = 'rheo-1';
const kSize = { width: 1280, height: 900 };
const kText_px = 40;
const kFrame_ms = 100;
const kMost_bytes = 3_000_000;
const out = process.argv[2];

// ---- what is drawn over the page

function add_pointer_and_text(text_px) {
  const add = (style) => {
    const element = document.body.appendChild(document.createElement('div'));
    Object.assign(element.style, style);
    return element;
  };
  const over_all = { position: 'fixed', zIndex: '99999', pointerEvents: 'none' };
  const line = add({ ...over_all, left: '0', right: '0', bottom: '0', height: `${text_px}px`, background: '#f0f4f8',
                     color: '#10161a', font: `600 17px/${text_px}px B612, sans-serif`, textAlign: 'center' });
  const pointer = add({ ...over_all, left: '0', top: '0', width: '22px', height: '22px', borderRadius: '50%',
                        border: '3px solid #ffd23f', boxShadow: '0 0 0 1px #0008', transform: 'translate(-99px, -99px)' });
  window.addEventListener('pointermove', (event) => {
    pointer.style.transform = `translate(${event.clientX - 14}px, ${event.clientY - 14}px)`;
  }, true);
  window.addEventListener('pointerdown', () => (pointer.style.background = '#ffd23f'), true);
  window.addEventListener('pointerup', () => (pointer.style.background = 'none'), true);
  window.film_says = (words) => (line.textContent = words);
}

// ---- the frames

class Camera {
  frames = []; // { file, at_s }, as Chromium drew them

  constructor(page, folder) {
    this.page = page;
    this.folder = folder;
  }

  async begin() {
    this.session = await this.page.context().newCDPSession(this.page);
    this.session.on('Page.screencastFrame', ({ data, metadata, sessionId }) => {
      const file = join(this.folder, `${String(this.frames.length).padStart(5, '0')}.png`);
      writeFileSync(file, Buffer.from(data, 'base64'));
      this.frames.push({ file, at_s: metadata.timestamp });
      void this.session.send('Page.screencastFrameAck', { sessionId }).catch(() => undefined);
    });
    // Each is encoded while the robot swims: all of them would make it miss ticks on a small machine.
    await this.session.send('Page.startScreencast', { format: 'png', everyNthFrame: 3 });
  }

  async end() {
    await this.session.send('Page.stopScreencast');
    this.end_s = Date.now() / 1000;
  }

  // One frame at a time for each kFrame_ms; one that stays is shown for longer.
  shown() {
    const shown = [];
    const first_s = this.frames[0].at_s;
    const slots = Math.round((1000 * (this.end_s - first_s)) / kFrame_ms);
    let next = 0;
    for (let slot = 0; slot < slots; ++slot) {
      while (this.frames[next + 1] && this.frames[next + 1].at_s <= first_s + (slot * kFrame_ms) / 1000) ++next;
      if (shown.at(-1)?.file === this.frames[next].file) shown.at(-1).for_ms += kFrame_ms;
      else shown.push({ file: this.frames[next].file, for_ms: kFrame_ms });
    }
    return shown;
  }
}

function write_film(frames) {
  const each = frames.flatMap(({ file, for_ms }) => ['-d', String(for_ms), file]);
  execFileSync('img2webp', ['-loop', '0', '-min_size', '-lossy', '-q', '45', '-m', '4', ...each, '-o', out], { stdio: 'ignore' });
  const bytes = statSync(out).size;
  const length_s = frames.reduce((sum, { for_ms }) => sum + for_ms, 0) / 1000;
  console.log(`${out}: ${length_s.toFixed(1)} s, ${frames.length} frames, ${bytes} bytes`);
  if (bytes > kMost_bytes) throw new Error(`the film has ${bytes} bytes, allowed are ${kMost_bytes}`);
}

// ---- what is played

async function play(page, bench) {
  const says = (words) => page.evaluate((what) => window.film_says(what), words);
  const pause = (seconds) => page.waitForTimeout(1000 * seconds);
  const mode = () => page.locator('.annunciator').getAttribute('data-mode');
  const go_to = async (selector) => {
    const box = await page.locator(selector).boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2, { steps: 8 });
  };
  const press = async (selector) => {
    await go_to(selector);
    await page.mouse.down();
    await pause(0.1);
    await page.mouse.up();
  };
  const send_setpoint = async (setpoint_mm) => {
    await press('#setpoint-entry');
    await page.fill('#setpoint-entry', String(setpoint_mm));
    await page.press('#setpoint-entry', 'Enter');
  };

  await says('Figure 7 of the paper: setpoint 100 mm. The shaded range is ± 2 standard deviations of the estimate.');
  await send_setpoint(100);
  await until('auto', async () => (await mode()) === 'auto');
  await pause(3.5);
  await says('A disturbance of −50 mm is added to what the controller sees.');
  await press('#inject-disturbance');
  await pause(3);
  await says('Stop, in full motion: one press, or Escape from anywhere.');
  await send_setpoint(0);
  await go_to('#emergency-stop');
  await pause(0.3);
  await press('#emergency-stop');
  await page.locator('#stop-line[data-phase=stopped]').waitFor();
  await pause(2.5);
  await says('To clear it, hold the button: nothing moves by itself.');
  await clear_latch(page);
  await pause(0.5);
  await send_setpoint(100);
  await pause(1.5);
  await says('The station is killed. The page says so; what it shows is no longer the present.');
  await bench.station.end('SIGKILL');
  await pause(3.5);
  await bench.start_station();
  await until('samples arrive', async () => (await page.locator('.readouts.stale').count()) === 0);
  await says('The station is back. The robot sends what it measured meanwhile: nothing is lost.');
  await page.locator('#recording-line').getByText('recorded, nothing lost').waitFor();
  await pause(1.5);
}

const bench = new Bench();
const folder = mkdtempSync(join(tmpdir(), 'rheonaut-film-'));
try {
  await bench.start_station();
  const page = await bench.open_browser({ viewport: kSize, colorScheme: 'dark' });
  await bench.sign_in(page);
  await page.waitForTimeout(3000); // a robot beside a browser that begins would miss ticks
  bench.start_robot(kRobot, '--seed', '21');
  await page.locator('.annunciator h1').getByText(kRobot).waitFor();
  await confirm_model(bench, kRobot, 'non_newtonian');
  await page.evaluate(add_pointer_and_text, kText_px);
  const camera = new Camera(page, folder);
  await camera.begin();
  await play(page, bench);
  await camera.end();
  write_film(camera.shown());
} finally {
  await bench.close();
  rmSync(folder, { recursive: true, force: true });
}
process.exit(0);
