// The drawing of the vessel: how far a robot coasts by its model, and the setpoint that is moved and sent once.
import { expect, test } from 'vitest';
import type { ParametersInForce } from '../../src/api';
import { SampleRing } from '../../src/samples';
import { Coast, known_of } from '../../src/vessel/coast';
import { Ghost, why_not } from '../../src/vessel/ghost';
import { batch } from '../fakes';

const kModel = { gain_m_s: [0.06, 0.04, 0, 0], time_constant_s: [0.1, 2, 3, 15], dead_zone_duty: 0.02 };

const five = (value: number) => Array.from({ length: 5 }, () => value);

function drive(ring: SampleRing, first_seq: number, seconds: number, duty: number, velocity_m_s: number): number {
  const size = seconds * 100;
  for (let seq = first_seq; seq < first_seq + size; seq += 5)
    ring.append(batch(seq, 5, { duty: five(duty), velocity_m_s: five(velocity_m_s) }), seq / 100);
  return first_seq + size;
}

test('after a long drive the robot coasts by the sum of gain and time constant', () => {
  const ring = new SampleRing();
  drive(ring, 0, 30, 1, 0.1);
  expect(new Coast(kModel).distance_m(ring, 0.1)).toBeCloseTo(0.06 * 0.1 + 0.04 * 2, 3);
});

test('after a short push it coasts less, since the slow part has hardly begun', () => {
  const ring = new SampleRing();
  const from = drive(ring, 0, 5, 0, 0);
  drive(ring, from, 1, 1, 0.0757);
  const distance_m = new Coast(kModel).distance_m(ring, 0.0757)!;
  expect(distance_m).toBeCloseTo(0.06 * 0.1 + 0.04 * (1 - Math.exp(-0.5)) * 2, 3);
});

test('the velocity that the robot reports scales it, within a factor of two', () => {
  const ring = new SampleRing();
  drive(ring, 0, 30, 1, 0.1);
  const of = (velocity_m_s: number) => new Coast(kModel).distance_m(ring, velocity_m_s)!;
  expect(of(0.08) / of(0.1)).toBeCloseTo(0.8, 3);
  expect(of(0.5) / of(0.1)).toBeCloseTo(2, 3);
});

test('at rest, and with a duty in the dead zone, it stays where it is', () => {
  const ring = new SampleRing();
  const from = drive(ring, 0, 2, 0, 0);
  drive(ring, from, 20, 0.01, 0);
  expect(new Coast(kModel).distance_m(ring, 0)).toBe(0);
  expect(new Coast(kModel).distance_m(new SampleRing(), 0)).toBeNull();
});

test('of parameters that are not known nothing is drawn; 100 m is no limit', () => {
  const parameter = (name: string, value: number | null) =>
    ({ name, value }) as NonNullable<ParametersInForce['parameters']>[0];
  expect(known_of({ parameters: null })).toEqual({ position_min_m: null, position_max_m: null, model: null });
  const some = [
    parameter('position_limit_min_m', -100),
    parameter('position_limit_max_m', 0.4),
    parameter('model_gain_1_m_s', 1),
  ];
  expect(known_of({ parameters: some })).toEqual({ position_min_m: null, position_max_m: 0.4, model: null });
  const model = [1, 2, 3, 4].flatMap((i) => [
    parameter(`model_gain_${i}_m_s`, i),
    parameter(`model_time_constant_${i}_s`, 10 * i),
  ]);
  expect(known_of({ parameters: model }).model).toEqual({
    gain_m_s: [1, 2, 3, 4],
    time_constant_s: [10, 20, 30, 40],
    dead_zone_duty: 0,
  });
});

const kBounds = { min_m: -1, max_m: 0.3 };

test('what was moved is sent once, in whole millimetres and within its bounds', () => {
  const ghost = new Ghost();
  ghost.begin(0.1);
  ghost.move(0.1234, kBounds);
  expect(ghost.at_m).toBe(0.123);
  ghost.move(5, kBounds);
  expect(ghost.release()).toBe(0.3);
  expect(ghost.release()).toBeNull();
});

test('what was not moved is not sent, and neither is what was abandoned', () => {
  const ghost = new Ghost();
  ghost.begin(0.1);
  expect(ghost.release()).toBeNull();
  ghost.begin(0.1);
  ghost.move(0.2, kBounds);
  ghost.abandon();
  expect(ghost.release()).toBeNull();
  ghost.move(0.2, kBounds); // of a hand that is still down
  expect(ghost.release()).toBeNull();
});

test('why it cannot be moved is said', () => {
  const free = {
    is_current: true,
    is_connected: true,
    is_stale: false,
    mode: 'auto',
    has_setpoint: true,
    holder: null,
    actor: 'session:1',
    may_command: true,
  };
  expect(why_not(free)).toBe('');
  expect(why_not({ ...free, holder: 'session:1' })).toBe('');
  expect(why_not({ ...free, holder: 'user:anna' })).toMatch(/^user:anna is in control/);
  expect(why_not({ ...free, mode: 'manual' })).toMatch(/in auto/);
  expect(why_not({ ...free, is_current: false })).toMatch(/Cut off/);
  expect(why_not({ ...free, is_connected: false })).toMatch(/not connected/);
  expect(why_not({ ...free, is_stale: true })).toMatch(/No samples/);
  expect(why_not({ ...free, may_command: false })).toMatch(/operators/);
});
