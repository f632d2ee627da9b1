// Below the robot, one of three: the log, its commands with every stage, or what is in force on it.

import { useSignal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { CommandTable } from './command_table';
import { InForce } from './in_force';
import { LogStrip } from './log_strip';

const kPages = [
  { name: 'log', text: 'Log' },
  { name: 'commands', text: 'Commands' },
  { name: 'in-force', text: 'In force' },
] as const;
type PageName = (typeof kPages)[number]['name'];

export function LogPanel({ session, robot }: { session: Session; robot: Robot | null }) {
  const chosen = useSignal<PageName>('log');
  const shown = robot ? chosen.value : 'log';
  const is_current = session.store.is_current.value;
  const tabs = robot && (
    <div class="log-tabs" role="tablist" aria-label="Log, commands, what is in force">
      {kPages.map(({ name, text }) => (
        <button
          type="button"
          role="tab"
          key={name}
          id={`log-tab-${name}`}
          aria-selected={shown === name}
          aria-controls="log-page"
          onClick={() => (chosen.value = name)}
        >
          {text}
        </button>
      ))}
    </div>
  );
  if (robot && shown === 'commands') {
    return (
      <LogPage tabs={tabs} is_current={is_current} label={`Commands of ${robot.robot_id}`}>
        <CommandTable key={robot.robot_id} session={session} robot={robot} />
      </LogPage>
    );
  }
  if (robot && shown === 'in-force') {
    return (
      <LogPage tabs={tabs} is_current={is_current} label={`In force on ${robot.robot_id}`}>
        <InForce key={robot.robot_id} session={session} robot={robot} />
      </LogPage>
    );
  }
  return (
    <LogPage tabs={tabs} label="Events and commands">
      <LogStrip session={session} />
    </LogPage>
  );
}

interface LogPageProps {
  tabs: ComponentChildren;
  label: string;
  is_current?: boolean; // of what shows states, not moments
  children: ComponentChildren;
}

function LogPage({ tabs, label, is_current = true, children }: LogPageProps) {
  return (
    <section class="log-strip" aria-label={label}>
      {tabs || <h2>Log</h2>}
      <div
        class={`log-page ${is_current ? '' : 'stale'}`}
        id="log-page"
        role={tabs ? 'tabpanel' : undefined}
        aria-label={label}
      >
        {!is_current && (
          <p class="quiet" role="status">
            Cut off from the station: this was known last.
          </p>
        )}
        {children}
      </div>
    </section>
  );
}
