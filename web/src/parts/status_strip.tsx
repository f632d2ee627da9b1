// The line under the navigation, the same in every view: the connection, how old and how long what is seen is on its way,
// alarms, runs that are open, other tabs. Without a connection it is that and nothing else.

import { age, clock_time, duration, milliseconds } from '../format';
import type { Session } from '../session';
import { kOld_ms, kTooOld_ms } from '../vitals';
import { AlarmList } from './alarm_list';

export function StatusStrip({ session }: { session: Session }) {
  const is_cut_off = session.cut_off.value !== null;
  return (
    <div class={`status-strip ${is_cut_off ? 'cut-off' : ''}`} id="status">
      {is_cut_off ? <CutOff session={session} /> : <Connection session={session} />}
      {!is_cut_off && <Ways session={session} />}
      <AlarmList session={session} />
      {!is_cut_off && <OpenRuns session={session} />}
      <OtherTabs session={session} />
    </div>
  );
}

function Connection({ session }: { session: Session }) {
  const is_live = session.phase.value === 'live' && session.store.is_current.value;
  return (
    <span class={`lamp ${is_live ? 'good' : ''}`} role="status">
      {is_live ? 'Live' : 'Connecting'}
    </span>
  );
}

// It stands for as long as it is true, beside the frame around the page, and says that nobody has to do anything.
function CutOff({ session }: { session: Session }) {
  const since_ms = session.cut_off.value?.since_ms ?? 0;
  void session.store.now_ms.value; // ten times a second
  return (
    <p class="lamp caution" role="alert">
      <b>Cut off from the station</b>
      <span>
        since <time>{clock_time(since_ms).slice(0, 8)}</time>
        <time aria-hidden="true" class="lasting">
          {' '}
          for {age(Date.now() - since_ms)}
        </time>
        <span class="explanation">. Nothing here is of now. It is tried again all the time.</span>
      </span>
    </p>
  );
}

function Ways({ session }: { session: Session }) {
  const { page_ms, robot_ms, seen_ms } = session.vitals.now.value;
  const robot = session.store.selected.value;
  const robot_id = robot?.robot_id ?? '';
  const tone =
    seen_ms === null || robot?.is_away.value ? '' : seen_ms > kTooOld_ms ? 'alarm' : seen_ms > kOld_ms ? 'caution' : '';
  return (
    <dl class="ways">
      <div class="way-of-page" title="Round trip between this page and the station, by the echo of its stamps">
        <dt>Station</dt>
        <dd id="page-round-trip">{page_ms === null ? '–' : milliseconds(page_ms)}</dd>
      </div>
      {robot && (
        <>
          <div class="way-of-robot" title={`Round trip between the station and ${robot_id}`}>
            <dt class="name">{robot_id}</dt>
            <dd id="robot-round-trip">
              {robot_ms === null ? (robot.is_away.value ? 'away' : '–') : milliseconds(robot_ms)}
            </dd>
          </div>
          <div
            class={tone}
            title={`Age of the newest sample of ${robot_id} on this page, by the robot’s clock: the worst of the last half second`}
          >
            <dt>Seen</dt>
            <dd id="seen-age" data-tone={tone}>
              {seen_ms === null
                ? 'nothing yet'
                : seen_ms < 1000
                  ? `${Math.round(seen_ms)} ms old`
                  : `${age(seen_ms)} old`}
            </dd>
          </div>
        </>
      )}
    </dl>
  );
}

function OpenRuns({ session }: { session: Session }) {
  const { store } = session;
  // What may have ended meanwhile is not claimed.
  const runs = store.is_current.value ? store.runs.value : [];
  return (
    <span class="recording" aria-live="polite">
      {runs.map((run) => (
        <span class="lamp recording-lamp" key={run.run_id} title={`of ${run.robot_id}`}>
          Run “{run.name}” <RunTime session={session} started_at_us={run.started_at_us} />
        </span>
      ))}
    </span>
  );
}

function RunTime({ session, started_at_us }: { session: Session; started_at_us: number }) {
  void session.store.now_ms.value; // ten times a second
  return <time>{duration((session.utc_us() - started_at_us) / 1000)}</time>;
}

function OtherTabs({ session }: { session: Session }) {
  const others = session.tabs.others.value;
  if (others.length === 0) return null;
  const running = others.find((tab) => tab.duty_robot_id !== null);
  const text = running
    ? `Another tab runs ${running.duty_robot_id}`
    : `${others.length} other ${others.length === 1 ? 'tab' : 'tabs'}`;
  return (
    <span
      class={`other-tabs ${running ? 'lamp caution' : ''}`}
      id="other-tabs"
      title="Tabs of this session in this browser: what one of them controls is controlled by all"
    >
      {text}
    </span>
  );
}
