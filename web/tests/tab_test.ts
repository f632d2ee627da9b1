// What title and icon of the tab say.
import { expect, test } from 'vitest';
import type { Alarm } from '../src/alarms';
import { tab_sign } from '../src/tab';

const emergency = (robot_id: string): Alarm => ({ key: `emergency ${robot_id}`, level: 'alarm', robot_id, text: '' });
const silent: Alarm = { key: 'silent a', level: 'caution', robot_id: 'a', text: '' };
const unreachable: Alarm = { key: 'stop_path a', level: 'alarm', robot_id: 'a', text: '' };
const title = (...given: Parameters<typeof tab_sign>) => tab_sign(...given).title;
const icon = (...given: Parameters<typeof tab_sign>) => tab_sign(...given).icon;

test('an emergency is named, several are counted, and nothing hides one', () => {
  expect(title([], false)).toBe('Rheonaut');
  expect(title([emergency('rheo-1')], false)).toBe('EMERGENCY rheo-1 · Rheonaut');
  expect(title([emergency('a'), emergency('b')], false)).toBe('EMERGENCY 2 robots · Rheonaut');
  expect(title([], true)).toBe('Cut off · Rheonaut');
  expect(title([emergency('rheo-1'), silent], true)).toContain('EMERGENCY');
  expect(icon([emergency('rheo-1')], true)).toBe('/favicon_emergency.svg');
});

test('the icon is of the worst that there is', () => {
  expect(icon([], false)).toBe('/favicon.svg');
  expect(icon([silent], false)).toBe('/favicon_caution.svg');
  expect(title([unreachable, silent], false)).toBe('Alarm a · Rheonaut');
  expect(icon([unreachable], true)).toBe('/favicon_cut_off.svg');
});
