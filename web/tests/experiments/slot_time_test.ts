// Days and times as they are typed for a reservation.
import { expect, test } from 'vitest';
import { day_text, parse_clock, parse_day, parse_slot } from '../../src/views/experiments/slot_time';

const kNow_ms = new Date(2026, 10, 26, 13, 20).getTime(); // Thursday
const day = (text: string) => {
  const found = parse_day(text, kNow_ms);
  return found && day_text(found.getTime());
};

test('days are taken as people write them', () => {
  expect(['2026-11-27', '27.11.', '1.3.', '27.11.2027', 'Tomorrow', '', 'today'].map(day)).toEqual([
    '2026-11-27',
    '2026-11-27',
    '2027-03-01',
    '2027-11-27',
    '2026-11-27',
    '2026-11-26',
    '2026-11-26',
  ]);
  expect(['31.11.', '2026-13-01', 'soon', '11/26/2026'].map(day)).toEqual([null, null, null, null]);
});

test('times of day, 24:00 included', () => {
  expect(['14:30', '14.30', '9', ' 9:05 ', '24:00'].map(parse_clock)).toEqual([870, 870, 540, 545, 1440]);
  expect(['', '25:00', '14:60', '24:01', '2pm', '14:3'].map(parse_clock)).toEqual([null, null, null, null, null, null]);
});

const slot = (from_day: string, from_clock: string, until_day: string, until_clock: string) =>
  parse_slot({ from_day, from_clock, until_day, until_clock }, kNow_ms);
const at = (day_of_month: number, hours: number, minutes = 0) =>
  new Date(2026, 10, day_of_month, hours, minutes).getTime();

test('a slot from now, of one day, and over midnight', () => {
  expect(slot('', '', '', '15:00')).toEqual({ from_ms: null, until_ms: at(26, 15) });
  expect(slot('tomorrow', '9', '', '11:30')).toEqual({ from_ms: at(27, 9), until_ms: at(27, 11, 30) });
  expect(slot('', '22:00', 'tomorrow', '2')).toEqual({ from_ms: at(26, 22), until_ms: at(27, 2) });
});

test('what cannot be is named by its field', () => {
  const problem = (...texts: [string, string, string, string]) => (slot(...texts) as { problem: string }).problem;
  expect(problem('soon', '9', '', '10')).toMatch(/^From: “soon” is no day\. Type a day like/);
  expect(problem('', 'noon', '', '15:00')).toMatch(/^From: “noon” is no time/);
  expect(problem('tomorrow', '', '', '15:00')).toMatch(/^From: the time is missing/);
  expect(problem('', '', '', '')).toMatch(/^Until: the time is missing/);
  expect(problem('', '12:00', '', '15:00')).toMatch(/in the past/);
  expect(problem('', '', '', '13:00')).toMatch(/^Until: that is not after/);
  expect(problem('', '', '2026-12-04', '15:00')).toMatch(/at most 7 days/);
});
