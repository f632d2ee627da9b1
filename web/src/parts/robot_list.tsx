// The robots that the station knows, each with link, mode and position; a click looks at one.

import { millimetres } from '../format';
import type { Session } from '../session';
import type { Robot } from '../store';

export function RobotList({ session }: { session: Session }) {
  const { robots } = session.store;
  return (
    <nav class="robot-list" aria-label="Robots">
      <h2>Robots</h2>
      {robots.value.length === 0 && <p class="quiet">None has connected.</p>}
      <ul>
        {robots.value.map((robot) => (
          <li key={robot.state.peek().robot_id}>
            <RobotEntry session={session} robot={robot} />
          </li>
        ))}
      </ul>
    </nav>
  );
}

function RobotEntry({ session, robot }: { session: Session; robot: Robot }) {
  const { robot_id, link } = robot.state.value;
  const { mode, stale, position_m } = robot.readout.value;
  const selected = session.store.selected_id.value === robot_id;
  const away = link !== 'connected';
  const tone = mode === 'emergency' ? 'alarm' : away ? 'off' : stale ? 'caution' : 'good';
  return (
    <button type="button" class="robot-entry" aria-pressed={selected} onClick={() => session.store.select(robot_id)}>
      <span class={`dot ${tone}`} />
      <span class="name">{robot_id}</span>
      <span class={`figure ${stale ? 'stale' : ''}`}>{millimetres(position_m)} mm</span>
      <span class="what">{away ? 'not connected' : stale ? 'silent' : mode}</span>
    </button>
  );
}
