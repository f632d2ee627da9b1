// Sound and notification of new alarms.
import { signal } from '@preact/signals';
import { expect, test } from 'vitest';
import type { Alarm } from '../src/alarms';
import { Alerts } from '../src/alerts';
import { ViewSettings } from '../src/settings';

const alarm = (key: string, level: Alarm['level'] = 'alarm'): Alarm => ({ key, level, robot_id: 'a', text: key });

function alerts_with(may_notify = true) {
  const done: string[] = [];
  const kept = new Map<string, string>();
  const shelf = {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
  };
  const alerts = new Alerts(new ViewSettings(shelf), {
    beep: () => void done.push('beep'),
    chime: () => void done.push('chime'),
    notify: (_, text) => void done.push(text),
    ask: () => Promise.resolve(may_notify),
  });
  const alarms = signal<Alarm[]>([]);
  alerts.follow(alarms);
  return { alerts, alarms, done, shelf };
}

test('both are off until somebody turns them on, and stay on in this browser', async () => {
  const { alerts, alarms, done, shelf } = alerts_with();
  alarms.value = [alarm('x')];
  expect(done).toEqual([]);
  alerts.set_sound(true);
  expect(done).toEqual(['beep']); // so that it was heard once
  await alerts.set_notification(true);
  const again = new ViewSettings(shelf);
  expect([again.sound.on.value, again.notification.on.value]).toEqual([true, true]);
  alerts.set_sound(false);
  expect(new ViewSettings(shelf).sound.on.value).toBe(false);
});

test('an alarm sounds when it is new, not for as long as it lasts', async () => {
  const { alerts, alarms, done } = alerts_with();
  await alerts.set_notification(true);
  alerts.set_sound(true);
  done.length = 0;
  alarms.value = [alarm('x')];
  expect(done).toEqual(['beep', 'a: x']);
  alarms.value = [alarm('x'), alarm('y', 'caution')];
  expect(done).toHaveLength(2);
  alarms.value = [alarm('x'), alarm('z')];
  expect(done.slice(2)).toEqual(['beep', 'a: z']);
  alarms.value = [];
  alarms.value = [alarm('x')];
  expect(done).toHaveLength(6);
});

test('what the browser does not allow stays off, and the reason is said', async () => {
  const { alerts } = alerts_with(false);
  await alerts.set_notification(true);
  expect(alerts.settings.notification.on.value).toBe(false);
  expect(alerts.problem.value).toMatch(/does not allow/);
});
