// How the heap of the plots grows: an hour of samples at 100 Hz in eight traces, a computed one and the X–Y plot, fed ten
// times as fast as they are made. The heap is measured after a collection of garbage.
//
//   node dev/heap_bench.mjs [MINUTES_OF_DATA]      (in web/; an hour takes six minutes)
//
// Prints the heap after each tenth of the time, and ends with 1 when it has grown by more than 10 % from the first tenth to
// the end.
import { createServer } from 'vite';
import { chromium } from 'playwright-core';

const kRate = 10;
const kMost = 0.1;
const minutes = Number(process.argv[2] ?? 60);
const server = await createServer({ server: { port: 0 }, logLevel: 'silent' });
await server.listen();
const { port } = server.httpServer.address();
const browser = await chromium.launch({
  executablePath: process.env.RHEONAUT_CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage', '--enable-precise-memory-info'],
});
const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
await page.goto(`http://127.0.0.1:${port}/dev/plots.html?rate=${kRate}&more=1`);
await page.locator('.strip canvas').first().waitFor();
const devtools = await page.context().newCDPSession(page);
await devtools.send('HeapProfiler.enable');

// Objects of JavaScript and the memory of typed arrays.
async function heap_mb() {
  for (let i = 0; i < 3; ++i) await devtools.send('HeapProfiler.collectGarbage');
  const { usedSize, backingStorageSize = 0 } = await devtools.send('Runtime.getHeapUsage');
  return (usedSize + backingStorageSize) / 1e6;
}

const fed_minutes = () => page.evaluate(() => window.fed_s / 60);
const found_mb = [];
for (let tenth = 1; tenth <= 10; ++tenth) {
  while ((await fed_minutes()) < (minutes * tenth) / 10) await page.waitForTimeout(200);
  found_mb.push(await heap_mb());
  console.log(`${((minutes * tenth) / 10).toFixed(1)} min of samples: ${found_mb.at(-1).toFixed(2)} MB`);
}
await browser.close();
await server.close();
const growth = found_mb.at(-1) / found_mb[0] - 1;
console.log(`${(growth * 100).toFixed(1)} % from the first tenth to the end`);
process.exit(growth <= kMost ? 0 : 1);
