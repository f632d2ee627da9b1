// The robots that the station knows, each with link, mode and position; a click looks at one.
//
// A robot may be hidden here. SAFETY: that is a setting of this view alone, kept by the browser: a hidden robot is stopped
// like any other, and one that is in an emergency is counted where the hidden ones are.

import { useComputed, useSignal } from '@preact/signals';
import { millimetres, plus_minus } from '../format';
import type { Robot } from '../robot';
import { go_to } from '../route';
import type { Session } from '../session';

// Not listed here: hidden by somebody, or retired and away. The one that is selected never is.
export const is_hidden = ({ store, settings }: Session, robot: Robot) =>
  robot.robot_id !== store.selected_id.value &&
  (settings.hidden_robots.names.value.has(robot.robot_id) || robot.is_left_out.value);

export function RobotList({ session }: { session: Session }) {
  const { store, settings } = session;
  const edits = useSignal(false);
  const hidden_here = (robot: Robot) => is_hidden(session, robot);
  const shown = useComputed(() => store.robots.value.filter((robot) => edits.value || !hidden_here(robot)));
  const hidden = useComputed(() => store.robots.value.filter(hidden_here).length);
  const alarms = useComputed(
    () => store.robots.value.filter((robot) => hidden_here(robot) && robot.is_alarming.value).length,
  );
  const hide_away = () => {
    const away = store.robots.peek().filter((robot) => robot.is_away.peek());
    settings.hidden_robots.add(...away.map((robot) => robot.robot_id));
  };
  const button_text = edits.value ? 'Done' : hidden.value > 0 ? `${hidden.value} hidden` : 'Hide…';
  return (
    <nav class="robot-list" aria-label="Robots">
      <h2>Robots</h2>
      {store.robots.value.length > 1 && (
        <button
          type="button"
          class="edit-list"
          id="edit-robots"
          aria-pressed={edits.value}
          title="Only this view: a hidden robot is stopped like any other"
          onClick={() => (edits.value = !edits.value)}
        >
          {button_text}
          {alarms.value > 0 && <b class="alarm"> {alarms.value} in emergency</b>}
        </button>
      )}
      {store.robots.value.length === 0 && <p class="quiet">None has connected.</p>}
      {edits.value && (
        <button type="button" id="hide-away" onClick={hide_away}>
          Hide all that are away
        </button>
      )}
      <ul>
        {shown.value.map((robot) => (
          <li key={robot.robot_id}>
            <RobotEntry session={session} robot={robot} />
            {edits.value && <HideButton session={session} robot_id={robot.robot_id} />}
          </li>
        ))}
      </ul>
    </nav>
  );
}

function RobotEntry({ session, robot }: { session: Session; robot: Robot }) {
  const { store } = session;
  const { robot_id, link, retired } = robot.state.value;
  const { watched, mode, stale, estimate_m, position_sd_m } = robot.readout.value;
  const is_current = store.is_current.value;
  const away = link !== 'connected';
  // Green says that samples arrive; of a robot whose samples are not asked for nobody here knows that.
  const tone =
    mode === 'emergency'
      ? 'alarm'
      : away
        ? 'off'
        : !is_current || (watched && stale)
          ? 'caution'
          : watched
            ? 'good'
            : 'unwatched';
  const what = !is_current
    ? 'not known: cut off'
    : away
      ? retired
        ? 'retired'
        : 'not connected'
      : watched && stale
        ? 'silent'
        : mode;
  return (
    <button
      type="button"
      class="robot-entry"
      aria-pressed={store.selected_id.value === robot_id}
      data-tone={tone}
      onClick={() => go_to({ view: 'robot', parts: [robot_id] })}
    >
      <span class={`dot ${tone}`} />
      <span class="name">{robot_id}</span>
      <span class="what">{what}</span>
      {watched && estimate_m !== null && (
        <span class={`figure ${stale ? 'stale' : ''}`}>
          {millimetres(estimate_m)} {plus_minus(position_sd_m)} mm
        </span>
      )}
    </button>
  );
}

export function HideButton({ session, robot_id }: { session: Session; robot_id: string }) {
  const { hidden_robots } = session.settings;
  const is_hidden = hidden_robots.names.value.has(robot_id);
  return (
    <button
      type="button"
      class="hide"
      aria-pressed={is_hidden}
      aria-label={`${is_hidden ? 'Show' : 'Hide'} ${robot_id}`}
      onClick={() => (is_hidden ? hidden_robots.remove(robot_id) : hidden_robots.add(robot_id))}
    >
      {is_hidden ? 'Show' : 'Hide'}
    </button>
  );
}
