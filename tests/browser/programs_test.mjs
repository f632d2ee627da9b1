// A file that another program writes is read when it is complete, and not before; a click that nothing felt is made again.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { Bench, close_chromium, read_json, until } from './programs.mjs';

const folder = mkdtempSync(join(tmpdir(), 'rheonaut-programs-'));
const file = join(folder, 'endpoints.json');
try {
  assert.equal(read_json(file), null, 'it is not there yet');
  for (const part of ['', '{', '{"pid": 1, "ht']) {
    writeFileSync(file, part);
    assert.equal(read_json(file), null, `only ${part} is written`);
  }
  let looks = 0;
  const said = await until('it is complete', () => {
    if (++looks === 3) writeFileSync(file, '{"pid": 1}');
    return read_json(file);
  });
  assert.deepEqual(said, { pid: 1 });
  assert.equal(looks, 3);
  writeFileSync(file, '{"pid": ');
  await assert.rejects(until('it is complete', () => read_json(file), 100), /not within 100 ms: it is complete/);
  assert.throws(() => read_json(folder), { code: 'EISDIR' });
} finally {
  rmSync(folder, { recursive: true });
}

// A button that is disabled when the mouse has reached it, for longer than the click takes; and a stop that goes as it is pressed.
const bench = new Bench();
const page = await bench.open_browser();
try {
  await page.goto('data:text/html,<button id=save>Save</button><button id=stop class=emergency-stop>Stop</button>');
  await page.evaluate(() => {
    window.done = { save: 0, stop: 0 };
    const [save, stop] = ['save', 'stop'].map((id) => document.getElementById(id));
    save.addEventListener('click', () => (window.done.save += 1));
    save.addEventListener('mousemove', () => {
      save.disabled = true;
      setTimeout(() => (save.disabled = false), 300);
    }, { once: true });
    stop.addEventListener('pointerdown', () => ((window.done.stop += 1), stop.remove()));
  });
  await page.click('#save');
  await page.locator('#save').click();
  await page.click('#stop');
  assert.deepEqual(await page.evaluate(() => window.done), { save: 2, stop: 1 });
} finally {
  await close_chromium(bench.browser);
}
