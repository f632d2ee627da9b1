// The top bar: whose page this is, whether it is live, what is being recorded, and the stop for every robot.

import { age, duration } from '../format';
import { stop_button_keys } from '../keys';
import type { Session } from '../session';
import { format, route } from '../route';
import { kViews } from '../views/table';
import { KeyList } from './key_list';
import { LossBanner } from './loss_banner';

export function TopBar({ session }: { session: Session }) {
  const { store, station } = session;
  return (
    <header class="top-bar">
      <a class="wordmark" href="#/robot" title={station.value ? `station ${station.value.version}` : ''}>
        <svg viewBox="0 0 34 20" aria-hidden="true">
          <path d="M1 12c4.5 0 4.5-8 9-8s4.5 8 9 8 4.5-8 9-8" />
          <circle cx="19" cy="12" r="3.4" />
        </svg>
        Rheonaut
      </a>
      <Navigation session={session} />
      <ConnectionState session={session} />
      {station.value?.security.exposed && (
        <strong class="exposed" role="alert" title="tls.insecure is set: docs/operations.md says how to set up TLS">
          Not encrypted: anyone on this network can read along and drive
        </strong>
      )}
      <LossBanner session={session} />
      {station.value?.security.certificate?.expires_soon && (
        <span class="lamp caution" title="rheonaut certificate --renew">
          Certificate expires soon
        </span>
      )}
      <span class="recording" aria-live="polite">
        {/* What may have ended meanwhile is not claimed. */}
        {(store.is_current.value ? store.runs.value : []).map((run) => (
          <span class="lamp recording-lamp" key={run.run_id}>
            Run “{run.name}” <RunTime session={session} started_at_us={run.started_at_us} />
          </span>
        ))}
      </span>
      <WhoIsIn session={session} />
      <KeyList />
      <button
        type="button"
        class="stop-all"
        id="stop-all"
        title="Hidden ones as well"
        {...stop_button_keys}
        onClick={session.stop_all}
      >
        Stop all robots
      </button>
    </header>
  );
}

// A link to the robot keeps the one that is selected.
export function Navigation({ session }: { session: Session }) {
  const selected_id = session.store.selected_id.value;
  return (
    <nav class="views" aria-label="Views">
      {kViews.map(({ name, title, key }) => (
        <a
          key={name}
          id={`open-${name}`}
          href={format({ view: name, parts: name === 'robot' && selected_id !== null ? [selected_id] : [] })}
          aria-current={route.value.view === name ? 'page' : undefined}
          title={`g ${key}`}
        >
          {title}
        </a>
      ))}
    </nav>
  );
}

function WhoIsIn({ session }: { session: Session }) {
  const me = session.me.value;
  if (!me) return null;
  const leave = () => session.log_out().catch((error: Error) => session.store.note(error.message));
  return (
    <span class="who">
      <span id="who" title={me.actor}>
        {me.user || 'by link'} <span class="quiet">{me.role}</span>
      </span>
      <button type="button" id="log-out" onClick={() => void leave()}>
        Sign out
      </button>
    </span>
  );
}

function RunTime({ session, started_at_us }: { session: Session; started_at_us: number }) {
  void session.store.now_ms.value; // ten times a second
  return <time>{duration(Date.now() - started_at_us / 1000)}</time>;
}

function ConnectionState({ session }: { session: Session }) {
  const phase = session.phase.value;
  if (phase === 'live' && !session.store.is_current.value) {
    return (
      <span class="lamp caution" role="status">
        No sign of the station
      </span>
    );
  }
  if (phase === 'live') {
    return (
      <span class="lamp good" role="status">
        Live
      </span>
    );
  }
  return (
    <span class="lamp caution" role="status">
      {session.link.attempt === 0 ? 'Connecting' : 'Reconnecting'} <LostFor session={session} />
    </span>
  );
}

function LostFor({ session }: { session: Session }) {
  const now_ms = session.store.now_ms.value;
  const lost_at_ms = session.link.lost_at_ms;
  return <time aria-hidden="true">{lost_at_ms === null ? '' : age(now_ms - lost_at_ms)}</time>;
}
