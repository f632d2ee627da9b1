// A duty by a gamepad: it runs while a shoulder button is held and the stick is pushed, and in no other moment.
import { expect, test, vi } from 'vitest';
import { DutyHold } from '../src/duty_hold';
import { duty_of_axis, GamepadHold, kFrameless_ms, kWatch_ms, type Pad } from '../src/gamepad';
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
    axis: 0,
    shoulder: false,
    index: 0,
    plugged: true,
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
    return [null, { index: world.index, id: 'pad', connected: true, axes: [world.axis, 0, 0, 0], buttons }];
  };
  vi.stubGlobal('navigator', { getGamepads: get_gamepads });
  const pad = new GamepadHold({
    pads: () => navigator.getGamepads(),
    now_ms: () => time.now_ms,
    robot_id: 'rheo-1',
    why_not: () => world.why_not,
    full_duty: () => 0.5,
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
