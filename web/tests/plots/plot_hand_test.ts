// Hands on the plots: what a drag, a pinch, the wheel and each key do to the time axis.
import { expect, test } from 'vitest';
import { PlotHand } from '../../src/plots/plot_hand';

function hand() {
  const done: [string, ...(number | null)[]][] = [];
  const made = new PlotHand({
    pan: (by_px) => done.push(['pan', by_px]),
    zoom: (factor, at_px) => done.push(['zoom', Number(factor.toFixed(4)), at_px]),
    point: (at_px) => done.push(['point', at_px]),
    run: () => done.push(['run']),
    middle_px: () => 500,
    width_px: () => 1000,
  });
  const moved = () => done.splice(0).filter(([what]) => what !== 'point');
  return { made, done, moved };
}
const key = (name: string, more = {}) => ({ key: name, ctrlKey: false, metaKey: false, altKey: false, ...more });
const wheel = (deltaX: number, deltaY: number, more = {}) => ({
  deltaX,
  deltaY,
  deltaMode: 0,
  shiftKey: false,
  ...more,
});

test('a pointer that is not pressed only points', () => {
  const { made, done } = hand();
  made.move(1, 300);
  expect(done).toEqual([['point', 300]]);
  made.leave();
  expect(done.at(-1)).toEqual(['point', null]);
});

test('a drag moves the samples with the hand; a press that hardly moves is no drag', () => {
  const { made, moved } = hand();
  made.down(1, 300);
  made.move(1, 302);
  expect(moved()).toEqual([]);
  made.move(1, 320);
  made.move(1, 310);
  expect(moved()).toEqual([
    ['pan', 20],
    ['pan', -10],
  ]);
  made.up(1);
  made.move(1, 400);
  expect(moved()).toEqual([]);
});

test('two fingers zoom about the one that is still', () => {
  const { made, moved } = hand();
  made.down(1, 300);
  made.down(2, 400);
  made.move(2, 500);
  expect(moved()).toEqual([['zoom', 0.5, 300]]);
  made.down(3, 900); // a third is not listened to
  made.move(3, 700);
  expect(moved()).toEqual([]);
});

test('the wheel zooms where the pointer is, and moves along with Shift or sideways', () => {
  const { made, moved } = hand();
  made.wheel(wheel(0, -100), 250);
  const [[what, factor, at_px]] = moved() as [[string, number, number]];
  expect([what, at_px]).toEqual(['zoom', 250]);
  expect(factor).toBeLessThan(1);
  made.wheel(wheel(30, 2), 250);
  made.wheel(wheel(0, 3, { deltaMode: 1, shiftKey: true }), 250);
  expect(moved()).toEqual([
    ['pan', -30],
    ['pan', -48],
  ]);
});

test('each key of its own, and none that stops or presses', () => {
  const { made, moved } = hand();
  for (const name of ['ArrowLeft', 'ArrowRight', '+', '-', 'End']) expect(made.key(key(name))).toBe(true);
  expect(moved().map(([what, by]) => [what, by])).toEqual([
    ['pan', 100],
    ['pan', -100],
    ['zoom', 0.6667],
    ['zoom', 1.5],
    ['run', undefined],
  ]);
  for (const name of [' ', 'Enter', 'Escape', 'g', 'Tab']) expect(made.key(key(name))).toBe(false);
  expect(made.key(key('-', { ctrlKey: true }))).toBe(false); // the browser's own zoom
  expect(moved()).toEqual([]);
});
