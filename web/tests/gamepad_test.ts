// A duty by a gamepad: it runs while a shoulder button is held and the stick is pushed, and in no other moment.
import { expect, test, vi } from 'vitest';
import { DutyHold } from '../src/duty_hold';
import { duty_of_axis, GamepadHold, GamepadStop, kFrameless_ms, kStill_ms, kWatch_ms, type Pad } from '../src/gamepad';
import { FakeTime } from './fakes';

const kFrame_ms = 16;

// A page with a pad: frames come each 16 ms while it is not `frozen`.
function page() {
  const time = new FakeTime();
  const world = {
    time,
    duties: [] as number[],
    frozen: false,
    why_not: '',
    full_duty: 0.5,
    axis: 0,
    shoulder: false,
    index: 0,
    plugged: true,
    mapping: 'standard' as GamepadMappingType,
    noise: 0,
    others: [] as Pad[],
  };
  const hold = new DutyHold({
    set_duty: (_, duty) => {
      world.duties.push(duty);
      return Promise.resolve();
    },
    renew_lease: () => true,
    now_ms: () => 0,
    set_interval: (callback, period_ms) => time.set(callback, period_ms, period_ms),
    clear_interval: (timer) => time.clear(timer),
    on_change: () => undefined,
  });
  // As a browser does it: what navigator.getGamepads() answers, with a hole where a pad was.
  const get_gamepads = (): (Pad | null)[] => {
    if (!world.plugged) return [null, null];
    const buttons = Array.from({ length: 16 }, (_, at) => ({ pressed: at === 5 && world.shoulder }));
    return [
      null,
      {
        index: world.index,
        id: 'pad',
        connected: true,
        mapping: world.mapping,
        axes: [world.axis, 0, 0, world.noise],
        buttons,
      },
      ...world.others,
    ];
  };
  vi.stubGlobal('navigator', { getGamepads: get_gamepads });
  const pad = new GamepadHold({
    pads: () => navigator.getGamepads(),
    now_ms: () => time.now_ms,
    robot_id: 'rheo-1',
    why_not: () => world.why_not,
    full_duty: () => world.full_duty,
    hold,
  });
  time.set(() => !world.frozen && pad.frame(), kFrame_ms, kFrame_ms);
  time.set(() => pad.watch(), kWatch_ms, kWatch_ms);
  const frames = (count = 3) => time.advance(count * kFrame_ms);
  const drive = async () => {
    await frames();
    Object.assign(world, { shoulder: true, axis: 1 });
    await frames();
  };
  return { world, hold, pad, frames, drive };
}

test('a held button and a pushed stick run a duty; the button alone, and the stick alone, do not', async () => {
  const { world, frames, hold } = page();
  await frames();
  world.axis = 1;
  await frames();
  expect(world.duties).toEqual([]);
  Object.assign(world, { shoulder: true, axis: 0 });
  await frames();
  expect(world.duties).toEqual([]);
  world.axis = 1;
  await frames();
  expect(world.duties).toEqual([0.5]);
  world.axis = -0.56;
  await frames();
  expect(world.duties).toEqual([0.5, -0.25]);
  expect(hold.robot_id).toBe('rheo-1');
});

test('letting the button go is duty 0 in the next frame, and the stick alone revives nothing', async () => {
  const { world, frames, drive, hold } = page();
  await drive();
  world.shoulder = false;
  await frames(1);
  expect(world.duties).toEqual([0.5, 0]);
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]);
  expect(hold.robot_id).toBeNull();
});

test('the stick in its middle is duty 0, and may be pushed again under the held button', async () => {
  const { world, frames, drive } = page();
  await drive();
  world.axis = 0.05;
  await frames();
  world.axis = 1;
  await frames();
  expect(world.duties).toEqual([0.5, 0, 0.5]);
});

test('unplugged is duty 0, and plugged in again with the button down it starts nothing', async () => {
  const { world, frames, drive } = page();
  await drive();
  world.plugged = false;
  await frames(1);
  expect(world.duties).toEqual([0.5, 0]);
  world.plugged = true;
  await frames(10);
  expect(world.duties).toEqual([0.5, 0]);
  world.shoulder = false;
  await frames();
  world.shoulder = true;
  await frames();
  expect(world.duties).toEqual([0.5, 0, 0.5]);
});

test('a pad that says nothing new for 5 s ends its duty, and goes on when it is moved', async () => {
  const { world, pad, hold, drive, frames } = page();
  await drive();
  await world.time.advance(kStill_ms - 200);
  expect(world.duties).toEqual([0.5]);
  expect(pad.still_left_ms).toBeLessThan(200);
  await world.time.advance(400);
  expect(world.duties).toEqual([0.5, 0]);
  expect(pad.is_asleep).toBe(true);
  await world.time.advance(60_000); // frozen for good
  expect(world.duties).toEqual([0.5, 0]);
  world.axis = 0.56;
  await frames();
  expect(world.duties).toEqual([0.5, 0, 0.25]);
  expect(hold.robot_id).toBe('rheo-1');
  await world.time.advance(kStill_ms + 200);
  Object.assign(world, { shoulder: false });
  await frames();
  expect(world.duties).toEqual([0.5, 0, 0.25, 0]);
});

test('a frozen pad starts nothing when the slider leaves 0', async () => {
  const { world, drive, frames } = page();
  await drive();
  world.full_duty = 0;
  await frames();
  await world.time.advance(kStill_ms + 200);
  world.full_duty = 0.5;
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]);
});

test('what has ended while a pad slept is not revived by moving it', async () => {
  const { world, pad, drive, frames } = page();
  await drive();
  await world.time.advance(kStill_ms + 200);
  pad.end(); // lost focus
  world.axis = 0.56;
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]);
});

test('a pad with noise on any axis is never asked', async () => {
  const { world, drive } = page();
  world.time.set(() => (world.noise = (world.noise + 0.001) % 0.01), 100, 100);
  await drive();
  await world.time.advance(4 * kStill_ms);
  expect(world.duties).toEqual([0.5]);
});

test('a pad that appears ends the duty, and of two none drives before one is chosen', async () => {
  const { world, pad, drive, frames, hold } = page();
  await drive();
  const buttons = Array.from({ length: 16 }, (_, at) => ({ pressed: at === 5 }));
  const again: Pad = { index: 3, id: 'pad', connected: true, mapping: 'standard', axes: [-1, 0, 0, 0], buttons };
  world.others = [again]; // the same pad, come back while its first half is frozen
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]);
  pad.choose(again);
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]); // its button is down already
  const up = { ...again, buttons: buttons.map(() => ({ pressed: false })) };
  world.others = [up];
  await frames();
  world.others = [again];
  await frames();
  expect(world.duties).toEqual([0.5, 0, -0.5]);
  world.others = [];
  await frames(20);
  expect(world.duties).toEqual([0.5, 0, -0.5, 0]);
  expect(hold.robot_id).toBeNull();
});

test('a layout that is not known is not read', async () => {
  const { world, pad, drive } = page();
  world.mapping = '';
  await drive();
  expect(world.duties).toEqual([]);
  expect(pad.pads.length).toBe(1);
});

test('one button of every pad stops, once a press, also of a pad that does not drive', () => {
  let stops = 0;
  const button = new GamepadStop();
  const pads = (pressed: number[], mapping: GamepadMappingType = 'standard'): Pad[] =>
    [0, 1].map((index) => ({
      index,
      id: 'pad',
      connected: true,
      mapping,
      axes: [],
      buttons: Array.from({ length: 16 }, (_, at) => ({ pressed: at === 1 && pressed.includes(index) })),
    }));
  const frame = (these: (Pad | null)[]) => button.frame(these, () => (stops += 1));
  frame([null, ...pads([])]);
  expect(stops).toBe(0);
  for (let count = 0; count < 10; ++count) frame(pads([0]));
  expect(stops).toBe(1);
  frame(pads([0, 1]));
  expect(stops).toBe(2);
  frame(pads([]));
  frame(pads([1]));
  expect(stops).toBe(3);
  frame(pads([0, 1], ''));
  expect(stops).toBe(3);
});

test('another pad in its place is not the same hand', async () => {
  const { world, frames, drive } = page();
  await drive();
  world.index = 1;
  await frames();
  expect(world.duties).toEqual([0.5, 0]);
});

test('lost focus and a hidden page are duty 0 at once, and the button has to come up first', async () => {
  const { world, pad, frames, drive } = page();
  await drive();
  pad.end();
  expect(world.duties).toEqual([0.5, 0]); // in the same call
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]);
});

test('without an animation frame for 200 ms the duty ends', async () => {
  const { world, drive, hold } = page();
  await drive();
  world.frozen = true;
  await world.time.advance(kFrameless_ms - kWatch_ms);
  expect(world.duties).toEqual([0.5]);
  await world.time.advance(2 * kWatch_ms);
  expect(world.duties).toEqual([0.5, 0]);
  expect(hold.robot_id).toBeNull();
  world.frozen = false;
  await world.time.advance(500);
  expect(world.duties).toEqual([0.5, 0]);
});

test('a hold that ended otherwise is not taken up again: a stop, a lapse, another mode', async () => {
  for (const end of [(hold: DutyHold) => hold.forget(), (hold: DutyHold) => hold.lapse()]) {
    const { world, hold, frames, drive } = page();
    await drive();
    end(hold);
    const before = [...world.duties];
    await frames(20);
    expect(world.duties).toEqual(before);
    hold.press('rheo-1', 0.2); // by another hand, on the page's own button: the stick does not steer it
    world.axis = -1;
    await frames(20);
    expect(world.duties).toEqual([...before, 0.2]);
  }
  const { world, frames, drive } = page();
  await drive();
  world.why_not = 'it acts in manual.';
  await frames();
  world.why_not = '';
  await frames(20);
  expect(world.duties).toEqual([0.5, 0]);
});

test('a button that is down when driving becomes possible starts nothing, nor while another hand drives', async () => {
  const { world, hold, frames } = page();
  Object.assign(world, { shoulder: true, axis: 1 });
  await frames(20);
  expect(world.duties).toEqual([]);
  world.shoulder = false;
  await frames();
  hold.press('rheo-1', 0.2); // the button on the page
  world.shoulder = true;
  await frames(20);
  world.shoulder = false;
  await frames();
  expect(world.duties).toEqual([0.2]); // and letting the pad go does not end it
  expect(hold.robot_id).toBe('rheo-1');
});

test('the end of the stick is the duty that was chosen, and its middle is nothing', () => {
  expect([0, 0.1, -0.12, 1, -1, 5].map((axis) => duty_of_axis(axis, 0.4))).toEqual([0, 0, 0, 0.4, -0.4, 0.4]);
  expect(duty_of_axis(NaN, 0.4)).toBe(0);
});
