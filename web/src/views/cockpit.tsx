// The shell of the page: what stands in the same place whatever is looked at. The stop above all; its code is loaded with
// the page, never later.

import { useComputed } from '@preact/signals';
import { useMemo } from 'preact/hooks';
import { is_outdated } from '../page_build';
import { PresentContext, present_of } from '../parts/request';
import { StopPanel } from '../parts/stop_panel';
import { TopBar } from '../parts/top_bar';
import { format, go_to, route } from '../route';
import type { Session } from '../session';
import { ViewLoader } from './loader';
import { link_code, SignedOut } from './signed_out';
import { kViews, view_named, type View } from './table';

const loader = new ViewLoader((callback, delay_ms) => setTimeout(callback, delay_ms));

// By the key of a view; false: there is none with this key.
export function open_view(key: string): boolean {
  const view = kViews.find((each) => each.key === key);
  if (view) go_to({ view: view.name });
  return view !== undefined;
}

export function Cockpit({ session }: { session: Session }) {
  const name = useComputed(() => route.value.view).value;
  const present = useMemo(() => present_of(session), [session]);
  if (session.phase.value === 'signed_out' || link_code() !== null) return <SignedOut session={session} />;
  const view = view_named(name);
  const module = view ? loader.of(view).value.module : null;
  const View = module?.default;
  const Hands = module?.has_hands?.(route.value) === false ? undefined : module?.Hands;
  return (
    <PresentContext.Provider value={present}>
      <div class={`cockpit ${name === 'robot' ? 'of-robot' : 'of-view'}`}>
        <TopBar session={session} />
        <div class="view">
          {View ? (
            <View key={name} session={session} route={route.value} />
          ) : view ? (
            <NotLoaded session={session} view={view} />
          ) : (
            <NoSuchView />
          )}
        </div>
        <div class="hands">
          <StopPanel session={session} />
          {Hands && (
            <section class="controls" aria-label="Controls">
              <Hands session={session} route={route.value} />
            </section>
          )}
        </div>
        {session.cut_off.value && <div class="cut-off-frame" id="cut-off-frame" />}
      </div>
    </PresentContext.Provider>
  );
}

// It is loaded again each second, so that it comes by itself when the station does.
function NotLoaded({ session, view }: { session: Session; view: View }) {
  const { failures } = loader.of(view).value;
  const is_live = session.store.is_current.value;
  const is_gone = is_outdated.value; // with the version of the page that runs here
  return (
    <main class="view-body" aria-label={view.title}>
      {failures > 0 && (
        <div class="waiting" id="not-loaded" role="status">
          <h2>{view.title} could not be loaded</h2>
          <p>
            {is_gone
              ? 'The station has a newer version of this page, and this view is gone with the one that runs here.'
              : is_live
                ? 'It is tried again each second, and this view comes by itself.'
                : 'The station does not answer. It is tried again each second, and this view comes by itself.'}
          </p>
          {is_gone && (
            <button type="button" class="primary" id="load-again" onClick={() => location.reload()}>
              Load the newer page
            </button>
          )}
        </div>
      )}
    </main>
  );
}

function NoSuchView() {
  return (
    <main class="view-body" aria-label="Not found">
      <div class="waiting" id="no-such-view">
        <h2>Nothing is at this address</h2>
        <p>
          <code>{format(route.value)}</code> names no view of this page. There are:
        </p>
        <ul>
          {kViews.map(({ name, title }) => (
            <li key={name}>
              <a href={format({ view: name })}>{title}</a>
            </li>
          ))}
        </ul>
      </div>
    </main>
  );
}
