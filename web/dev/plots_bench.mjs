// How often each strip is drawn, how long the page's tasks are and how far its frames are apart: eight traces, ten minutes
// at 100 Hz, live, drawn without a graphics card.
//
//   node dev/plots_bench.mjs [SECONDS]      (in web/)
//
// Prints one line, and ends with 1 when a strip is drawn less than 30 times a second, or a task takes over 100 ms.
import { createServer } from 'vite';
import { chromium } from 'playwright-core';

const seconds = Number(process.argv[2] ?? 20);
const server = await createServer({ server: { port: 0 }, logLevel: 'error' });
await server.listen();
const { port } = server.httpServer.address();
const browser = await chromium.launch({
  executablePath: process.env.RHEONAUT_CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage'],
});
const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
await page.addInitScript(() => {
  window.drawn = new Map(); // canvas → how often
  const clear = CanvasRenderingContext2D.prototype.clearRect;
  CanvasRenderingContext2D.prototype.clearRect = function (...box) {
    window.drawn.set(this.canvas, (window.drawn.get(this.canvas) ?? 0) + 1);
    return clear.apply(this, box);
  };
});
await page.goto(`http://127.0.0.1:${port}/dev/plots.html`);
await page.locator('.strip canvas').first().waitFor();
await page.waitForTimeout(3000);
const found = await page.evaluate(async (duration_ms) => {
  const tasks_ms = [];
  new PerformanceObserver((list) => tasks_ms.push(...list.getEntries().map((entry) => entry.duration))).observe({
    type: 'longtask',
  });
  const frames_ms = [];
  let previous_ms = performance.now();
  let goes_on = true;
  const frame = (now_ms) => {
    frames_ms.push(now_ms - previous_ms);
    previous_ms = now_ms;
    if (goes_on) requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  window.drawn.clear();
  const started_ms = performance.now();
  await new Promise((done) => setTimeout(done, duration_ms));
  goes_on = false;
  const took_s = (performance.now() - started_ms) / 1000;
  const strips = [...document.querySelectorAll('.strip canvas')];
  frames_ms.sort((a, b) => a - b);
  return {
    strips: strips.length,
    per_s: Math.min(...strips.map((canvas) => (window.drawn.get(canvas) ?? 0) / took_s)),
    frame_p99_ms: frames_ms[Math.floor(frames_ms.length * 0.99)],
    worst_task_ms: Math.max(0, ...tasks_ms), // one of less than 50 ms is not reported
    long_tasks: tasks_ms.length,
  };
}, seconds * 1000);
await browser.close();
await server.close();
const { strips, per_s, frame_p99_ms, worst_task_ms, long_tasks } = found;
console.log(
  `${strips} strips, each drawn ${per_s.toFixed(1)} times a second; 99 % of frames within ${frame_p99_ms.toFixed(1)} ms; ` +
    `tasks over 50 ms: ${long_tasks}, the longest ${worst_task_ms.toFixed(0)} ms`,
);
process.exit(per_s >= 30 && worst_task_ms <= 100 ? 0 : 1);
