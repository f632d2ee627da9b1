// The top of every view: the way to the others, who is signed in, the stop for every robot, and below that the status.

import { stop_button_keys } from '../keys';
import { is_outdated } from '../page_build';
import type { Session } from '../session';
import { format, route } from '../route';
import { kViews } from '../views/table';
import { KeyList } from './key_list';
import { LossBanner } from './loss_banner';
import { StatusStrip } from './status_strip';

export function TopBar({ session }: { session: Session }) {
  const { station } = session;
  return (
    <header class="top-bar">
      <div class="bar">
        <a
          class="wordmark"
          href="#/robot"
          title={station.value ? `Rheonaut, station ${station.value.version}` : 'Rheonaut'}
        >
          <svg viewBox="0 0 34 20" aria-hidden="true">
            <path d="M1 12c4.5 0 4.5-8 9-8s4.5 8 9 8 4.5-8 9-8" />
            <circle cx="19" cy="12" r="3.4" />
          </svg>
          <span>Rheonaut</span>
        </a>
        <Navigation session={session} />
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
      </div>
      <StatusStrip session={session} />
      <Notices session={session} />
    </header>
  );
}

// Of the station as a whole, until somebody has seen to it.
export function Notices({ session }: { session: Session }) {
  const security = session.station.value?.security;
  return (
    <div class="notices">
      {security?.exposed && (
        <strong class="exposed" role="alert" title="tls.insecure is set: docs/operations.md says how to set up TLS">
          Not encrypted: anyone on this network can read along and drive
        </strong>
      )}
      <LossBanner session={session} />
      {is_outdated.value && <Outdated />}
      {security?.certificate?.expires_soon && (
        <span class="lamp caution" title="rheonaut certificate --renew">
          Certificate expires soon
        </span>
      )}
    </div>
  );
}

// What runs here goes on; views that were not opened yet may be gone, and the station may mean something else by now.
function Outdated() {
  return (
    <span class="outdated" id="outdated" role="status">
      <span class="lamp caution">The station has a newer version of this page</span>
      <button
        type="button"
        id="load-new-page"
        title="What was typed and not sent is lost"
        onClick={() => location.reload()}
      >
        Load it
      </button>
    </span>
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
    <span class="signed-in">
      <span id="who" title={me.actor}>
        {me.user || 'by link'} <span class="quiet">{me.role}</span>
      </span>
      <button type="button" id="log-out" onClick={() => void leave()}>
        Sign out
      </button>
    </span>
  );
}
