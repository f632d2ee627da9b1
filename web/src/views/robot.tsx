// The view of one robot: what it does, how it is connected, and below the stop button the controls.

import { AutoControl } from '../parts/auto_control';
import { ControlLine } from '../parts/control_line';
import { DisturbanceControl } from '../parts/disturbance_control';
import { LinkPanel } from '../parts/link_panel';
import { LogPanel } from '../parts/log_panel';
import { ManualControl } from '../parts/manual_control';
import { ModeAnnunciator } from '../parts/mode_annunciator';
import { Plots } from '../parts/plots';
import { Readouts } from '../parts/readouts';
import { RobotList } from '../parts/robot_list';
import { RunControl } from '../parts/run_control';
import { AlertLine } from '../parts/threshold_list';
import { Vessel } from '../parts/vessel';
import { Waiting } from '../parts/waiting';
import type { Session } from '../session';
import type { ViewProps } from './table';

export default function RobotView({ session, route }: ViewProps) {
  const robot = session.store.selected.value;
  const asked_id = route.parts[0];
  const is_other = asked_id !== undefined && robot !== null && asked_id !== robot.robot_id;
  return (
    <>
      <aside class="side" aria-label="Robots and link">
        <RobotList session={session} />
        {robot && !is_other && <LinkPanel robot={robot} is_current={session.store.is_current.value} />}
      </aside>
      <main class="scope" aria-label={robot ? `Robot ${robot.robot_id}` : 'No robot'}>
        {is_other ? (
          <UnknownRobot session={session} robot_id={asked_id} />
        ) : robot ? (
          <>
            <ModeAnnunciator robot={robot} is_current={session.store.is_current.value} />
            <AlertLine session={session} robot={robot} />
            <Readouts robot={robot} />
            <Vessel session={session} robot={robot} />
            <Plots session={session} robot={robot} />
          </>
        ) : (
          <Waiting session={session} />
        )}
      </main>
      <LogPanel session={session} robot={is_other ? null : robot} />
    </>
  );
}

export function Hands({ session, route }: ViewProps) {
  const robot = session.store.selected.value;
  if (!robot || (route.parts[0] ?? robot.robot_id) !== robot.robot_id) return null;
  const may_command = session.me.value?.role !== 'viewer';
  const key = robot.robot_id; // controls begin anew with another robot
  return (
    <>
      <ControlLine key={`control-${key}`} session={session} robot={robot} />
      {may_command ? (
        <>
          <AutoControl key={`auto-${key}`} session={session} robot={robot} />
          <DisturbanceControl key={`disturbance-${key}`} session={session} robot={robot} />
          <ManualControl key={`manual-${key}`} session={session} robot={robot} />
          <RunControl key={`run-${key}`} session={session} robot={robot} />
        </>
      ) : (
        <p class="viewer-note quiet">You may look and stop. Commands and runs need the role operator.</p>
      )}
    </>
  );
}

// SAFETY: the selection does not follow by itself when such a robot appears: the stop button keeps its name.
function UnknownRobot({ session, robot_id }: { session: Session; robot_id: string }) {
  const { store } = session;
  const is_known = store.robots.value.some((robot) => robot.robot_id === robot_id);
  return (
    <div class="waiting">
      <h2>{is_known ? `${robot_id} is known now` : `The station knows no robot “${robot_id}”`}</h2>
      <p>
        The stop button still names {store.selected_id.value}.
        {!is_known && ' Choose a robot from the list, or look at the address again.'}
      </p>
      {is_known && (
        <button type="button" class="primary" id="show-robot" onClick={() => store.want(robot_id)}>
          Show {robot_id}
        </button>
      )}
    </div>
  );
}
