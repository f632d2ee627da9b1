// What is wrong now: one word in the status line, the list behind it, and whether an alarm is heard or notified.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { useCloseOnEscape } from '../keys';
import { format } from '../route';
import type { Session } from '../session';

export function AlarmList({ session }: { session: Session }) {
  const open = useSignal(false);
  const root = useRef<HTMLSpanElement>(null);
  const close = () => (open.value = false);
  useCloseOnEscape(close);
  useEffect(() => {
    const listener = (event: PointerEvent) => root.current?.contains(event.target as Node) || close();
    addEventListener('pointerdown', listener);
    return () => removeEventListener('pointerdown', listener);
  }, []);
  const alarms = session.alarms.value;
  const worst = alarms[0]?.level ?? 'none';
  const [serious, cautions] = [count_of(alarms, 'alarm'), count_of(alarms, 'caution')];
  const words = [serious > 0 && plural(serious, 'alarm'), cautions > 0 && plural(cautions, 'caution')].filter(Boolean);
  return (
    <span class="alarms" ref={root}>
      <button
        type="button"
        id="show-alarms"
        class={`plain lamp ${worst}`}
        data-worst={worst}
        aria-expanded={open.value}
        aria-controls="alarm-list"
        onClick={() => (open.value = !open.value)}
      >
        {words.join(', ') || 'No alarms'}
      </button>
      <section class="panel" id="alarm-list" aria-label="Alarms" hidden={!open.value}>
        {alarms.length === 0 && <p class="quiet">Nothing is wrong, as far as this page knows.</p>}
        <ul>
          {alarms.map((alarm) => (
            <li key={alarm.key} class={`lamp ${alarm.level}`}>
              {alarm.robot_id !== null && (
                <a href={format({ view: 'robot', parts: [alarm.robot_id] })} onClick={close}>
                  {alarm.robot_id}
                </a>
              )}
              <span>{alarm.text}</span>
            </li>
          ))}
        </ul>
        <Ways session={session} />
      </section>
    </span>
  );
}

const count_of = (alarms: { level: string }[], level: string) => alarms.filter((alarm) => alarm.level === level).length;
const plural = (number: number, noun: string) => `${number} ${noun}${number === 1 ? '' : 's'}`;

function Ways({ session: { alerts } }: { session: Session }) {
  const { sound, notification } = alerts.settings;
  return (
    <div class="alert-ways">
      <label>
        <input
          type="checkbox"
          autoComplete="off"
          id="alert-sound"
          checked={sound.on.value}
          onChange={(event) => alerts.set_sound(event.currentTarget.checked)}
        />
        A new alarm sounds
      </label>
      <label>
        <input
          type="checkbox"
          autoComplete="off"
          id="alert-notification"
          checked={notification.on.value}
          onChange={(event) => void alerts.set_notification(event.currentTarget.checked)}
        />
        and is notified by this device
      </label>
      <p class="quiet">
        {alerts.problem.value ||
          'In this browser only. It plays a sound only after a press on the page, and while it asks for leave to notify it keeps Escape for itself.'}
      </p>
    </div>
  );
}
