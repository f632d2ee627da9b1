// One run: its plots, what happened in it, its figures and steps, its impedance map; its record stands below the stop.

import { date_and_time, fluid_text } from '../../format';
import { format, go_to, type Route } from '../../route';
import type { Session } from '../../session';
import { ImpedanceSection } from './impedance';
import { RunPlots } from './plots';
import { length_text, Record } from './record';
import { RunPage } from './run_page';
import type { Run, RunsApi } from './runs_api';
import { Figures, Moments, Steps } from './tables';
import { useRunPage } from './use_run_page';
import { around, window_query } from './windows';
import { ReplayView } from './replay/replay_view';

const kAround_us = 5_000_000; // shown to either side of a moment

interface Props {
  session: Session;
  api: RunsApi;
  route: Route;
}

let shown: RunPage | null = null;

// Plots and record show the same page; the one before is let go.
function page_of(api: RunsApi, run_id: number): RunPage {
  if (shown?.run_id === run_id) return shown;
  shown?.stop();
  return (shown = new RunPage(api, run_id));
}

const number_of = (route: Route): number | null => {
  const run_id = Number(route.parts[0]);
  return Number.isSafeInteger(run_id) && run_id > 0 ? run_id : null;
};

export function RunHands({ session, api, route }: Props) {
  const run_id = number_of(route);
  return run_id === null || route.parts[1] === 'replay' ? null : (
    <Record session={session} api={api} page={page_of(api, run_id)} />
  );
}

export function RunView({ session, api, route }: Props) {
  const run_id = number_of(route);
  if (run_id === null) return <NoSuchRun text={`“${route.parts[0] ?? ''}” is no number of a run.`} />;
  if (route.parts[1] === 'replay')
    return <ReplayView key={`replay-${run_id}`} session={session} page={page_of(api, run_id)} route={route} />;
  return <OneRun session={session} page={page_of(api, run_id)} api={api} route={route} />;
}

function OneRun({ session, page, api, route }: Props & { page: RunPage }) {
  const run = page.run.value;
  useRunPage(session, page);

  if (page.problem.value && !run) return <NoSuchRun text={page.problem.value} />;
  if (!run) {
    return (
      <main class="view-body run-view" aria-label={`Run ${page.run_id}`}>
        <p class="quiet">Run {page.run_id} is being read…</p>
      </main>
    );
  }
  const bounds = page.bounds;
  return (
    <>
      <section class="view-head run-head" aria-label="Run">
        <p class="way-back">
          <a href={format({ view: 'runs' })}>Runs</a>
        </p>
        <h1>
          <span class="run-number">#{run.run_id}</span> {run.name}
        </h1>
        <p class="quiet" id="run-line">
          {run.robot_id} · {date_and_time(run.started_at_us / 1000)} · <State session={session} run={run} />
          {run.fluid && ` · ${fluid_text(run.fluid)}`}
          {run.verdict && ` · ${run.verdict}`}
        </p>
        {run.state !== 'discarded' && (
          <a
            class="button replay-link"
            id="open-replay"
            href={format({ view: 'runs', parts: [`${run.run_id}`, 'replay'] })}
          >
            Replay
          </a>
        )}
        {run.state !== 'discarded' && run.state !== 'open' && (
          <a
            class="button replay-link"
            id="run-to-design"
            href={format({ view: 'design', query: { runs: `${run.run_id}` } })}
          >
            Identify a model from it
          </a>
        )}
      </section>
      <main class="view-body run-view" aria-label={`Run ${run.run_id}`}>
        {run.state === 'discarded' ? (
          <p class="quiet">This run was discarded: its samples are no longer held, and there is nothing to draw.</p>
        ) : (
          <>
            <RunPlots key={page.run_id} page={page} route={route} />
            <div class="run-sections">
              <Moments
                page={page}
                is_clock={route.query['time'] === 'clock'}
                on_show={({ utc_us }) => {
                  page.picked_s.value = (utc_us - page.origin_us) / 1e6;
                  const window = bounds && around(utc_us, kAround_us, bounds);
                  go_to({ ...route, query: { ...route.query, ...window_query(window) } });
                }}
              />
              <Figures page={page} />
            </div>
            <Steps page={page} />
            <ImpedanceSection api={api} runs={[run.run_id]} route={route} />
          </>
        )}
      </main>
    </>
  );
}

// SAFETY: that a run is open may have changed since the station was heard.
export function State({ session, run }: { session: Session; run: Run }) {
  if (run.state !== 'open') return <>{`${length_text(run)}, ${run.state}`}</>;
  return <>{session.store.is_current.value ? 'open' : 'was open when the station was last heard'}</>;
}

function NoSuchRun({ text }: { text: string }) {
  return (
    <main class="view-body run-view" aria-label="Not found">
      <div class="waiting" id="no-such-run">
        <h2>This run cannot be shown</h2>
        <p role="alert">{text}</p>
        <a class="button" href="#/runs">
          Show all runs
        </a>
      </div>
    </main>
  );
}
