// Every robot at a glance: link, mode, position, alarms, supply, completeness of the recording, open run.
//
// Samples come of those that are in sight, up to a number; of the others nothing is shown as present that is not.

import { useComputed, useSignal, type Signal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { count_by, FleetRow } from '../parts/fleet_row';
import { is_hidden } from '../parts/robot_list';
import { Waiting } from '../parts/waiting';
import { kFleetStates, listed } from '../fleet';
import { next_range } from '../range';
import { change_query, route } from '../route';
import type { Session } from '../session';
import type { ViewProps } from './table';

const kPage = 60; // rows that are drawn at first, and more when their end comes into sight

export default function FleetView({ session }: ViewProps) {
  const { store } = session;
  const hides = useSignal(false);
  const query = useComputed(() => {
    const { state = '', search = '' } = route.value.query;
    return { state, search };
  });
  const shown = useComputed(() =>
    listed(store.robots.value, { ...query.value, hidden: (robot) => is_hidden(session, robot) }),
  );
  const limit = useSignal(kPage);
  const list = useRef<HTMLUListElement>(null);
  useEffect(() => void (limit.value = kPage), [query.value]);
  useEffect(() => watch_sight(session, list.current, () => (limit.value += kPage)), [shown.value, limit.value]);
  useEffect(() => () => void (session.in_sight.value = []), []);
  const scale = useScale(session);

  return (
    <>
      <Head session={session} hides={hides.value} on_hides={() => (hides.value = !hides.value)} />
      <main class="view-body fleet" aria-label="Fleet">
        {store.robots.value.length === 0 ? (
          <Waiting session={session} />
        ) : (
          <>
            <div class="fleet-row fleet-titles" aria-hidden="true">
              {['Robot', 'Mode', '', 'Position', 'Setpoint', 'Link', 'Supply', 'Recording', 'Run'].map((title) => (
                <span key={title} class={title === 'Recording' ? 'kept' : title.toLowerCase()}>
                  {title}
                </span>
              ))}
            </div>
            <ul ref={list} id="fleet-list">
              {shown.value.slice(0, limit.value).map((robot) => (
                <FleetRow key={robot.robot_id} session={session} robot={robot} hides={hides.value} scale={scale} />
              ))}
              {shown.value.length > limit.value && <li class="more quiet">…</li>}
            </ul>
            {shown.value.length === 0 && (
              <p class="quiet none" id="none-listed">
                No robot {query.value.search && `whose name has “${query.value.search}” `}is listed here.{' '}
                <button type="button" onClick={() => change_query({ state: '', search: '' })}>
                  Show all
                </button>
              </p>
            )}
          </>
        )}
      </main>
    </>
  );
}

// One scale for the tapes of all robots, so that they can be compared. It changes seldom.
function useScale(session: Session): Signal<[number, number]> {
  const scale = useSignal<[number, number]>([-0.02, 0.22]);
  useEffect(() => {
    const look = () => {
      const seen = session.store.robots.peek().map((robot) => robot.readout.peek());
      const values_m = seen
        .filter(({ watched, stale }) => watched && !stale)
        .flatMap(({ estimate_m, setpoint_m }) => [estimate_m, setpoint_m])
        .filter((value_m) => value_m !== null);
      const next = next_range(scale.peek(), Math.min(0, ...values_m), Math.max(0, ...values_m), 0.24);
      if (next.join() !== scale.peek().join()) scale.value = next;
    };
    look();
    const timer = setInterval(look, 500);
    return () => clearInterval(timer);
  }, []);
  return scale;
}

function Head({ session, hides, on_hides }: { session: Session; hides: boolean; on_hides(): void }) {
  const { store, settings } = session;
  const counts = useComputed(() => count_by(session));
  const { state = '', search = '' } = route.value.query;
  const { total, connected, hidden, hidden_alarms } = counts.value;
  const hide_away = () => {
    const away = store.robots.peek().filter((robot) => robot.is_away.peek());
    settings.hidden_robots.add(...away.map((robot) => robot.robot_id));
  };
  const chip = (name: string, number: number, text: string, title = '') => (
    <button
      type="button"
      key={name}
      id={`show-${name || 'all'}`}
      class={`chip ${name}`}
      aria-pressed={state === name}
      disabled={number === 0 && state !== name && name !== ''}
      title={title}
      onClick={() => change_query({ state: state === name ? '' : name })}
    >
      <b>{number}</b> {text}
    </button>
  );
  return (
    <section class="view-head fleet-head" aria-label="Filters of the fleet">
      <h1>
        Fleet{' '}
        <small id="fleet-sum">
          {connected} of {total} connected
        </small>
      </h1>
      <div class="chips" role="group" aria-label="Filter by state">
        {chip('', total - hidden, 'listed')}
        {kFleetStates.map((each) => chip(each.state, counts.value[each.state], each.text, each.title))}
        {hidden > 0 && chip('hidden', hidden, 'hidden', 'In this browser only: they are stopped like any other')}
        {hidden_alarms > 0 && <strong class="lamp alarm">{hidden_alarms} hidden in emergency</strong>}
      </div>
      <div class="fleet-tools">
        <input
          id="fleet-search"
          type="text"
          aria-label="Filter by name"
          placeholder="Filter by name"
          autoComplete="off"
          spellcheck={false}
          value={search}
          onInput={(event) => change_query({ search: event.currentTarget.value })}
        />
        {total > 1 && (
          <button type="button" id="hide-robots" aria-pressed={hides} onClick={on_hides}>
            {hides ? 'Done' : 'Hide…'}
          </button>
        )}
        {hides && (
          <button type="button" id="hide-all-away" onClick={hide_away}>
            Hide all that are away
          </button>
        )}
      </div>
    </section>
  );
}

// Tells the session which rows are in sight, and calls when the end of the list is.
function watch_sight(session: Session, list: HTMLElement | null, at_end: () => void): () => void {
  if (!list) return () => undefined;
  const seen = new Set<Element>();
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting: is_seen } of entries) {
      if (is_seen) seen.add(target);
      else seen.delete(target);
    }
    if ([...seen].some((row) => row.classList.contains('more'))) at_end();
    const ids = [...list.children].filter((row) => seen.has(row)).map((row) => (row as HTMLElement).dataset['robot']);
    session.in_sight.value = ids.filter((id) => id !== undefined);
  });
  for (const row of list.children) observer.observe(row);
  return () => observer.disconnect();
}
