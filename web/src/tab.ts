// What the tab says to whoever looks elsewhere: an emergency, and that the page is cut off, in title and icon.
//
// It follows the states that the station reports, which reach a tab in the background at once; timers there are slow.

import { computed, effect } from '@preact/signals';
import type { Session } from './session';

export const kName = 'Rheonaut';

export function tab_title(alarms: string[], is_cut_off: boolean): string {
  if (alarms.length > 0) return `EMERGENCY ${alarms.length === 1 ? alarms[0] : `${alarms.length} robots`} · ${kName}`;
  return is_cut_off ? `Cut off · ${kName}` : kName;
}

// A robot that is away and hidden no longer calls.
export function alarms_of(session: Session): string[] {
  const hidden = session.settings.hidden_robots.names.value;
  return session.store.robots.value
    .filter((robot) => robot.is_alarming.value && !(robot.is_away.value && hidden.has(robot.robot_id)))
    .map((robot) => robot.robot_id);
}

export function show_in_tab(page: Document, session: Session): void {
  const is_cut_off = () => session.station.value !== null && ['connecting', 'waiting'].includes(session.phase.value);
  const title = computed(() => tab_title(alarms_of(session), is_cut_off()));
  effect(() => {
    page.title = title.value;
    const icon = page.querySelector<HTMLLinkElement>('link[rel=icon]');
    const file = title.value.startsWith('EMERGENCY') ? '/favicon_emergency.svg' : '/favicon.svg';
    if (icon && icon.getAttribute('href') !== file) icon.setAttribute('href', file);
  });
}
