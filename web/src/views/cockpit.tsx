// The cockpit: one page with everything an operator watches and touches, and the stop always in reach.

import { Access } from './access';
import { SignedOut } from './signed_out';
import { ControlLine } from '../parts/control_line';
import { AutoControl } from '../parts/auto_control';
import { LinkPanel } from '../parts/link_panel';
import { LogStrip } from '../parts/log_strip';
import { ManualControl } from '../parts/manual_control';
import { ModeAnnunciator } from '../parts/mode_annunciator';
import { Plots } from '../parts/plots';
import { Readouts } from '../parts/readouts';
import { RobotList } from '../parts/robot_list';
import { RunControl } from '../parts/run_control';
import { StopPanel } from '../parts/stop_panel';
import { TopBar } from '../parts/top_bar';
import type { Session } from '../session';

export function Cockpit({ session }: { session: Session }) {
  if (session.phase.value === 'signed_out') return <SignedOut session={session} />;
  const may_command = session.me.value?.role !== 'viewer';
  const robot = session.store.selected.value;
  const key = session.store.selected_id.value; // controls begin anew with another robot
  return (
    <div class="cockpit">
      <TopBar session={session} />
      <aside class="side">
        <RobotList session={session} />
        {robot && <LinkPanel robot={robot} />}
      </aside>
      <main class="scope" aria-label={robot ? `Robot ${key}` : 'No robot'}>
        {session.shows_access.value ? (
          <Access session={session} />
        ) : robot ? (
          <>
            <ModeAnnunciator robot={robot} is_current={session.store.is_current.value} />
            <Readouts robot={robot} />
            <Plots robot={robot} />
          </>
        ) : (
          <Waiting session={session} />
        )}
      </main>
      <div class="hands">
        <StopPanel session={session} />
        <section class="controls" aria-label="Controls">
          {robot && <ControlLine key={`control-${key}`} session={session} robot={robot} />}
          {robot && !may_command && (
            <p class="viewer-note quiet">You may look and stop. Commands and runs need the role operator.</p>
          )}
          {robot && may_command && (
            <>
              <AutoControl key={`auto-${key}`} session={session} robot={robot} />
              <ManualControl key={`manual-${key}`} session={session} robot={robot} />
              <RunControl key={`run-${key}`} session={session} robot={robot} />
            </>
          )}
        </section>
      </div>
      <LogStrip session={session} />
    </div>
  );
}

function Waiting({ session }: { session: Session }) {
  const address = session.station.value?.robots_address;
  return (
    <div class="waiting">
      <h2>No robot yet</h2>
      <p>
        Robots connect to the station by themselves
        {address && (
          <>
            , at <code>{address}</code>
          </>
        )}
        . The first one that does is shown here.
      </p>
    </div>
  );
}
