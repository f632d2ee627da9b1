// Clicks that reach what they were meant for. Playwright looks whether a button is enabled and clicks a moment later; where
// the page was cut off for that moment, as it may be on a busy machine, the button was disabled and nothing came of the
// click. A person sees that and clicks again, and so do these.

// In the page: how many clicks it has felt, and presses of the stop, which acts when it goes down.
function count_clicks() {
  window.clicks_felt = 0;
  const count = (event) => {
    if (!event.target.closest?.(':disabled')) window.clicks_felt += 1;
  };
  addEventListener('click', count, true);
  addEventListener('pointerdown', (event) => event.target.closest?.('.emergency-stop') && count(event), true);
}

// Null where the page is on its way to another document.
const felt = (page) => page.evaluate(() => `${performance.timeOrigin} ${window.clicks_felt}`).catch(() => null);

const kMostTimes = 20;

async function click_until_felt(page, click) {
  for (let times = 1; ; times += 1) {
    const before = await felt(page);
    await click();
    if (before === null || before !== (await felt(page)) || times === kMostTimes) return;
    console.log('    a click that nothing felt is made once more');
  }
}

const patched = new WeakSet();
function patch(prototype, page_of) {
  if (patched.has(prototype)) return;
  patched.add(prototype);
  const { click } = prototype;
  prototype.click = function (...args) {
    return click_until_felt(page_of(this), () => click.apply(this, args));
  };
}

// Page.click and Locator.click of all pages of this context, before its first document.
export async function feel_clicks(context, page) {
  await context.addInitScript(count_clicks);
  patch(Object.getPrototypeOf(page), (page) => page);
  patch(Object.getPrototypeOf(page.locator('body')), (locator) => locator.page());
}
