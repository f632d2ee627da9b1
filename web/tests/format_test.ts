// Numbers as people read them.
import { expect, test } from 'vitest';
import * as format from '../src/format';

test('SI units become what an operator reads', () => {
  expect(format.millimetres(0.09843)).toBe('98.4');
  expect(format.millimetres_per_s(0.0123)).toBe('12.3');
  expect(format.percent(-0.425)).toBe('\u221242.5');
  expect(format.volts_of_mv(3712)).toBe('3.71');
  expect(format.milliseconds_of_us(1840)).toBe('1.8');
});

test('a missing or non-finite value is a dash, never 0 or NaN', () => {
  for (const value of [null, undefined, NaN, Infinity]) expect(format.millimetres(value)).toBe('–');
  expect(format.count(null)).toBe('–');
});

test('a value that rounds to zero has no sign', () => {
  expect(format.millimetres(-0.00001)).toBe('0.0');
});

test('counts are grouped and keep their sign', () => {
  expect(format.count(1234567)).toBe('1\u202f234\u202f567');
  expect(format.count(-58)).toBe('\u221258');
});

test('a typed length is taken with comma, point and either minus, and nothing else', () => {
  expect(format.parse_millimetres('100')).toBe(0.1);
  expect(format.parse_millimetres(' 100,3 ')).toBe(0.1003);
  expect(format.parse_millimetres('\u221212.5')).toBe(-0.0125);
  expect(format.parse_millimetres('-.5')).toBe(-0.0005);
  for (const text of ['', 'abc', '1e3', '10 mm', '--1', '1.2.3', 'NaN', 'Infinity']) {
    expect(format.parse_millimetres(text), text).toBeNull();
  }
});

test('what is shown can be typed back', () => {
  for (const length_m of [0, 0.1, -0.0333, 0.1003]) {
    expect(format.parse_millimetres(format.millimetres(length_m))).toBeCloseTo(length_m, 4);
  }
});

test('ages and durations are one short word', () => {
  expect(format.age(343)).toBe('340 ms');
  expect(format.age(2100)).toBe('2.1 s');
  expect(format.age(300_000)).toBe('5 min');
  expect(format.duration(7_900)).toBe('0:07');
  expect(format.duration(3_723_000)).toBe('1:02:03');
});

test('the spread of an estimate is two standard deviations', () => {
  expect(format.plus_minus(0.0031)).toBe('± 6.2');
  expect(format.plus_minus(null)).toBe('± –');
});
