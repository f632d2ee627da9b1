// What the tab says to a person who looks elsewhere: the worst of all robots and of the connection, in title and icon.
//
// It follows the states that the station reports, which reach a tab in the background at once; timers there are slow.

import { computed, effect } from '@preact/signals';
import type { Alarm } from './alarms';
import type { Session } from './session';

export const kName = 'Rheonaut';

export interface TabSign {
  title: string;
  icon: string;
}

// An emergency hides everything else, being cut off everything but that.
export function tab_sign(alarms: readonly Alarm[], is_cut_off: boolean): TabSign {
  const of = (key: string) => alarms.filter((alarm) => alarm.key.startsWith(`${key} `));
  const names = (found: Alarm[]) => (found.length === 1 ? found[0]?.robot_id : `${found.length} robots`);
  const emergencies = of('emergency');
  if (emergencies.length > 0)
    return { title: `EMERGENCY ${names(emergencies)} · ${kName}`, icon: '/favicon_emergency.svg' };
  if (is_cut_off) return { title: `Cut off · ${kName}`, icon: '/favicon_cut_off.svg' };
  const [worst] = alarms;
  if (worst?.level === 'alarm')
    return { title: `Alarm ${worst.robot_id ?? ''} · ${kName}`, icon: '/favicon_caution.svg' };
  if (worst) return { title: kName, icon: '/favicon_caution.svg' };
  return { title: kName, icon: '/favicon.svg' };
}

export function show_in_tab(page: Document, session: Session): void {
  const is_cut_off = () => session.station.value !== null && ['connecting', 'waiting'].includes(session.phase.value);
  const sign = computed(() => tab_sign(session.alarms.value, is_cut_off() || session.cut_off.value !== null));
  effect(() => {
    const { title, icon } = sign.value;
    page.title = title;
    const link = page.querySelector<HTMLLinkElement>('link[rel=icon]');
    if (link && link.getAttribute('href') !== icon) link.setAttribute('href', icon);
  });
}
