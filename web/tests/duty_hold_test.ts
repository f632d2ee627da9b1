// Hold to run: what is sent while a hand is on the control, and that nothing runs on without it.
import { expect, test } from 'vitest';
import { DutyHold, kLease_ms, kRenew_ms } from '../src/duty_hold';
import { FakeTime, settle } from './fakes';

function held(answer: (duty: number) => Promise<unknown> = () => Promise.resolve()) {
  const time = new FakeTime();
  const world = { time, duties: [] as number[], renewals: 0, fresh: true, slept_ms: 0 };
  const hold = new DutyHold({
    set_duty: (_, duty) => {
      world.duties.push(duty);
      return answer(duty);
    },
    renew_lease: () => {
      if (world.fresh) world.renewals += 1;
      return world.fresh;
    },
    now_ms: () => time.now_ms + world.slept_ms,
    set_interval: (callback, period_ms) => time.set(callback, period_ms, period_ms),
    clear_interval: (timer) => time.clear(timer),
    on_change: () => undefined,
  });
  return { hold, world };
}

test('pressing runs, holding renews every 150 ms, letting go sends 0 at once', async () => {
  const { hold, world } = held();
  hold.press('rheo-1', 0.3);
  await world.time.advance(4 * kRenew_ms);
  expect(world.duties).toEqual([0.3]);
  expect(world.renewals).toBe(4);
  hold.release();
  expect(world.duties).toEqual([0.3, 0]); // in the same call
  await world.time.advance(10 * kRenew_ms);
  expect(world.renewals).toBe(4);
});

test('a stale stamp ends the hold for good: 0 is sent, and a fresh stamp does not revive it', async () => {
  const { hold, world } = held();
  hold.press('rheo-1', 0.3);
  await world.time.advance(kRenew_ms);
  world.fresh = false;
  await world.time.advance(kRenew_ms);
  expect(hold.robot_id).toBeNull();
  expect(hold.lapsed).toBe(true);
  expect(world.duties).toEqual([0.3, 0]);
  world.fresh = true;
  await world.time.advance(10 * kRenew_ms);
  expect(world.renewals).toBe(1);
  expect(world.duties).toEqual([0.3, 0]);
});

// SAFETY: the robot's lease has lapsed meanwhile; the newest of the stamps that have waited may be fresh all the same.
test('a page that stood still for longer than the lease renews nothing when it goes on, and says so', async () => {
  const { hold, world } = held();
  hold.press('rheo-1', 0.3);
  await world.time.advance(2 * kRenew_ms);
  world.slept_ms = kLease_ms;
  await world.time.advance(kRenew_ms);
  expect(world.renewals).toBe(2);
  expect(hold.robot_id).toBeNull();
  expect(hold.lapsed).toBe(true);
  expect(world.duties).toEqual([0.3, 0]);
});

test('a stop that may have been overtaken by the start is sent again', async () => {
  let answer_start: () => void = () => undefined;
  const { hold, world } = held((duty) =>
    duty === 0 ? Promise.resolve() : new Promise<void>((done) => (answer_start = done)),
  );
  hold.press('rheo-1', 0.3);
  hold.release();
  expect(world.duties).toEqual([0.3, 0]);
  answer_start();
  await settle();
  expect(world.duties).toEqual([0.3, 0, 0]);
});

test('of several changes only the newest follows the one on its way', async () => {
  const answers: (() => void)[] = [];
  const { hold, world } = held(() => new Promise<void>((done) => answers.push(done)));
  hold.press('rheo-1', 0.1);
  hold.change(0.2);
  hold.change(0.3);
  expect(world.duties).toEqual([0.1]);
  answers[0]?.();
  await settle();
  expect(world.duties).toEqual([0.1, 0.3]);
});

test('a refused duty ends the hold and says why', async () => {
  const { hold, world } = held(() => Promise.reject(new Error('The emergency stop is latched.')));
  hold.press('rheo-1', 0.3);
  await settle();
  expect(hold.robot_id).toBeNull();
  expect(hold.error?.message).toBe('The emergency stop is latched.');
  await world.time.advance(10 * kRenew_ms);
  expect(world.renewals).toBe(0);
});

test('an emergency stop forgets the hold without another command', () => {
  const { hold, world } = held();
  hold.press('rheo-1', 0.3);
  hold.forget();
  hold.release();
  expect(world.duties).toEqual([0.3]);
});
