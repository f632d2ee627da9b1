// The last step before a robot moves: which one, in which order, whether somebody stays, and the button that starts it.

import type { Signal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import { Choice } from '../../parts/choice';
import type { Robot } from '../../robot';
import { change_query } from '../../route';
import type { Session } from '../../session';
import type { Plan } from './outlook';

export interface Options {
  priority: number;
  is_unattended: boolean;
}
export const kOptions: Options = { priority: 0, is_unattended: false };
const kMostPriority = 100;

interface StartPanelProps {
  session: Session;
  robot: Robot | null;
  asked_id: string | undefined; // the robot of the address
  plan: Plan;
  options: Signal<Options>;
  notes: Signal<string | null>; // null: none were typed
  waits: boolean; // something of the check list is not ready
  blocked: string; // why it cannot be started, '': it can
  problem: string;
  on_start(): void;
  children: ComponentChildren; // the check list
}

export function StartPanel(props: StartPanelProps) {
  const { session, robot, asked_id, plan, options, notes, waits, blocked, problem, on_start, children } = props;
  const { store } = session;
  const robots = store.robots.value;
  const change = (next: Partial<Options>) => (options.value = { ...options.value, ...next });
  const priority = (by: number) =>
    change({ priority: Math.max(-kMostPriority, Math.min(kMostPriority, options.value.priority + by)) });
  const choose = (robot_id: string) => {
    store.select(robot_id);
    change_query({ robot: robot_id });
  };
  const may_be_unattended = plan.profile?.is_unattended === true;
  const is_unattended = may_be_unattended && options.value.is_unattended;
  const is_unknown = asked_id !== undefined && robots.length > 0 && !robots.some((each) => each.robot_id === asked_id);
  return (
    <>
      {is_unknown && (
        <p class="problem" role="status">
          The station knows no robot “{asked_id}”. The stop button still names {robot?.robot_id ?? 'all robots'}.
        </p>
      )}
      <div class="start-fields">
        <div class="field-of">
          <span class="label">Robot</span>
          <Choice
            id="experiment-robot"
            label="Robot"
            options={robots.map((each) => ({
              value: each.robot_id,
              text: each.is_away.value ? `${each.robot_id} (away)` : each.robot_id,
            }))}
            value={robot?.robot_id ?? ''}
            disabled={robots.length === 0}
            on_choose={choose}
          />
        </div>
        <div class="field-of">
          <span class="label" id="priority-label">
            Priority
          </span>
          <div class="stepper" role="group" aria-labelledby="priority-label">
            <button type="button" aria-label="Lower priority" onClick={() => priority(-1)}>
              −
            </button>
            <output id="priority">{`${options.value.priority}`.replace('-', '−')}</output>
            <button type="button" aria-label="Higher priority" onClick={() => priority(1)}>
              +
            </button>
          </div>
        </div>
        <div class="field-of notes">
          <label for="experiment-notes">Notes of its runs</label>
          <input
            id="experiment-notes"
            autoComplete="off"
            maxLength={4000}
            value={notes.value ?? ''}
            onInput={(event) => (notes.value = event.currentTarget.value)}
          />
        </div>
      </div>
      {children}
      {may_be_unattended && (
        <label class="tick">
          <input
            type="checkbox"
            autoComplete="off"
            id="unattended"
            checked={options.value.is_unattended}
            onChange={(event) => change({ is_unattended: event.currentTarget.checked })}
          />
          <span>Unattended: it may go on while nobody is there</span>
        </label>
      )}
      <p class={`presence ${is_unattended ? 'unattended' : ''}`} id="presence">
        {is_unattended
          ? 'Unattended: once it has begun it goes on without this page, until the time limit of the robot’s auto mode. Somebody must be here when it begins.'
          : 'This page must stay open: the robot moves only while it is. Closed or cut off, a duty ends within 0.9 s, and the experiment after 3 s.'}
      </p>
      <button
        type="button"
        class="primary start"
        id="start-experiment"
        disabled={blocked !== ''}
        aria-describedby="start-note"
        onClick={on_start}
      >
        {robot === null ? 'Start' : waits ? `Put into the queue of ${robot.robot_id}` : `Start on ${robot.robot_id}`}
      </button>
      <p class="start-note quiet" id="start-note">
        {blocked ||
          (waits
            ? 'It waits, and begins by itself when nothing above is left to wait for.'
            : `${robot?.robot_id ?? 'The robot'} begins to move at once.`)}
      </p>
      <p class="problem" role="alert" id="start-problem">
        {problem}
      </p>
    </>
  );
}
