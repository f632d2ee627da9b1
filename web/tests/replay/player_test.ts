// The clock of a replay: how it moves, where it waits and stops, and what an address may say.
import { expect, test } from 'vitest';
import { at_text, parse_address, Player } from '../../src/views/runs/replay/player';

function player_of(length_s: number, ready_s = Infinity): Player {
  const player = new Player(() => ready_s);
  player.length_s = length_s;
  return player;
}
const run = (player: Player, ms: number, frame_ms = 20) => {
  for (let now_ms = 0; now_ms <= ms; now_ms += frame_ms) player.tick(now_ms);
};

test('it moves as fast as asked for, from 0.1 to 100 times', () => {
  for (const speed of [0.1, 1, 10, 100]) {
    const player = player_of(1000);
    player.set_speed(speed);
    player.play();
    run(player, 2000);
    expect(player.at_s.value).toBeCloseTo(2 * speed, 6);
  }
  const player = player_of(1000);
  player.set_speed(1000);
  expect(player.speed.value).toBe(100);
  player.set_speed(0);
  expect(player.speed.value).toBe(0.1);
});

test('a page that stood still does not jump ahead', () => {
  const player = player_of(1000);
  player.play();
  player.tick(0);
  player.tick(60_000);
  expect(player.at_s.value).toBeLessThanOrEqual(0.25);
});

test('a pause is no time that passes', () => {
  const player = player_of(1000);
  player.play();
  run(player, 100);
  player.pause();
  player.tick(5000);
  player.play();
  player.tick(9000);
  expect(player.at_s.value).toBeCloseTo(0.1, 6);
});

test('it never runs past the samples that have come, and says that it waits', () => {
  const player = player_of(100, 1);
  player.play();
  run(player, 3000);
  expect(player.at_s.value).toBe(1);
  expect(player.is_playing.value).toBe(true);
  expect(player.is_waiting.value).toBe(true);
});

test('it pauses at the end, and plays again from the beginning', () => {
  const player = player_of(1);
  player.play();
  run(player, 2000);
  expect([player.at_s.value, player.is_playing.value, player.is_waiting.value]).toEqual([1, false, false]);
  player.play();
  expect(player.at_s.value).toBe(0);
});

test('seeking stays within the run', () => {
  const player = player_of(10);
  player.seek(11);
  expect(player.at_s.value).toBe(10);
  player.seek(-1);
  expect(player.at_s.value).toBe(0);
});

test('faster and slower go along the usual speeds, from an unusual one as well', () => {
  const player = player_of(10);
  player.set_speed(3);
  player.faster(1);
  expect(player.speed.value).toBe(5);
  player.set_speed(3);
  player.faster(-1);
  expect(player.speed.value).toBe(2);
  player.set_speed(100);
  player.faster(1);
  expect(player.speed.value).toBe(100);
});

test('an address names moment and speed; what it cannot mean is said with its value', () => {
  expect(parse_address({ at: '12.5', speed: '10' }, 60)).toEqual({ at_s: 12.5, speed: 10, problem: '' });
  expect(parse_address({}, 60)).toEqual({ at_s: null, speed: null, problem: '' });
  const wrong = parse_address({ at: '99', speed: 'fast' }, 60);
  expect([wrong.at_s, wrong.speed]).toEqual([null, null]);
  expect(wrong.problem).toContain('“at=99” in the address is no moment from 0 to 60 s');
  expect(wrong.problem).toContain('“speed=fast” in the address is no speed from 0.1 to 100');
  expect(parse_address({ speed: '1000' }, 60).speed).toBeNull();
});

test('the moment stands in the address to the microsecond', () => {
  expect(at_text(12.5)).toBe('12.5');
  expect(at_text(3.1234567)).toBe('3.123457');
});
