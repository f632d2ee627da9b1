// The list of runs: what is looked for stands in the address, and what is chosen for a comparison too.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { count, fluid_text } from '../../format';
import { Choice, type Option } from '../../parts/choice';
import { change_query, format, type Route } from '../../route';
import type { Session } from '../../session';
import { completeness, parse_filter, parse_numbers, started_text } from './filter';
import { length_text } from './record';
import { kMostComparedTraces, type Run, type RunsApi } from './runs_api';
import { RunSearch } from './search';

const kTyping_ms = 250;
const kStates: readonly Option[] = [
  { value: '', text: 'any state' },
  { value: 'open', text: 'open' },
  { value: 'ended', text: 'ended' },
  { value: 'interrupted', text: 'interrupted' },
  { value: 'discarded', text: 'discarded' },
];

export function RunList({ session, api, route }: { session: Session; api: RunsApi; route: Route }) {
  const search = useSearch(api);
  const { filter, problem } = parse_filter(route.query);
  const key = JSON.stringify(filter);
  const is_live = session.phase.value === 'live';
  const open_runs = session.store.runs.value;
  const key_before = useRef('');
  useEffect(() => {
    if (!is_live || problem) return;
    const is_same = key_before.current === key;
    key_before.current = key;
    void search.begin(filter, is_same);
  }, [key, is_live, problem, open_runs]);
  useEffect(() => () => search.stop(), []);

  const chosen = parse_numbers(route.query['chosen']);
  const choose = (run_id: number, is_chosen: boolean) => {
    const rest = chosen.filter((other) => other !== run_id);
    change_query({ chosen: (is_chosen ? [...rest, run_id] : rest).join(',') });
  };
  const runs = search.found.value;
  return (
    <>
      <section class="view-head runs-head" aria-label="Search runs">
        <h1>Runs</h1>
        <Filters session={session} route={route} problem={problem} />
      </section>
      <main class="view-body runs-view" aria-label="Runs">
        <Chosen chosen={chosen} />
        {search.problem.value && (
          <p class="problem" role="alert" id="runs-problem">
            {search.problem.value}
          </p>
        )}
        {runs.length > 0 ? (
          <Table runs={runs} chosen={chosen} is_current={session.store.is_current.value} on_choose={choose} />
        ) : (
          search.is_done.value && <Nothing is_filtered={key !== kNoFilter} />
        )}
        <More search={search} />
      </main>
    </>
  );
}

const kNoFilter = JSON.stringify(parse_filter({}).filter);

function useSearch(api: RunsApi): RunSearch {
  const made = useRef<RunSearch | null>(null);
  return (made.current ??= new RunSearch(api.page));
}

function Filters({ session, route, problem }: { session: Session; route: Route; problem: string }) {
  const { query } = route;
  const robots = session.store.robots.value.map((robot) => robot.state.peek().robot_id);
  const fluids = (session.fluids.value ?? []).map(({ fluid }) => fluid);
  const with_own = (names: string[], own: string | undefined) =>
    own && !names.includes(own) ? [...names, own] : names;
  return (
    <search class="run-filters">
      <TextFilter name="q" label="Search" placeholder="Name, notes, tube, #12…" value={query['q'] ?? ''} />
      <Choice
        id="filter-robot"
        label="Robot"
        value={query['robot'] ?? ''}
        options={[
          { value: '', text: 'any robot' },
          ...with_own(robots, query['robot']).map((name) => ({ value: name, text: name })),
        ]}
        on_choose={(robot) => change_query({ robot })}
      />
      <Choice
        id="filter-fluid"
        label="Fluid"
        value={query['fluid'] ?? ''}
        options={[
          { value: '', text: 'any fluid' },
          ...with_own(fluids, query['fluid']).map((name) => ({ value: name, text: fluid_text(name) })),
        ]}
        on_choose={(fluid) => change_query({ fluid })}
      />
      <Choice
        id="filter-state"
        label="State"
        value={query['state'] ?? ''}
        options={kStates}
        on_choose={(state) => change_query({ state })}
      />
      <TextFilter name="from" label="Begun from" placeholder="from 2026-11-26" value={query['from'] ?? ''} />
      <TextFilter name="to" label="Begun to" placeholder="to 2026-11-27" value={query['to'] ?? ''} />
      {problem && (
        <p class="problem" role="alert" id="filter-problem">
          {problem}
        </p>
      )}
    </search>
  );
}

interface TextFilterProps {
  name: string;
  label: string;
  placeholder: string;
  value: string;
}

// It is looked for when the typing rests, or at once with Enter.
function TextFilter({ name, label, placeholder, value }: TextFilterProps) {
  const typed = useSignal<string | null>(null);
  const timer = useRef<ReturnType<typeof setTimeout>>();
  const apply = (text: string) => {
    clearTimeout(timer.current);
    typed.value = null;
    change_query({ [name]: text });
  };
  useEffect(() => () => clearTimeout(timer.current), []);
  return (
    <input
      id={`filter-${name}`}
      type="text"
      aria-label={label}
      placeholder={placeholder}
      autoComplete="off"
      value={typed.value ?? value}
      onInput={(event) => {
        const text = event.currentTarget.value;
        typed.value = text;
        clearTimeout(timer.current);
        timer.current = setTimeout(() => apply(text), kTyping_ms);
      }}
      onKeyDown={(event) => event.key === 'Enter' && apply(event.currentTarget.value)}
      onBlur={(event) => typed.value !== null && apply(event.currentTarget.value)}
    />
  );
}

function Chosen({ chosen }: { chosen: number[] }) {
  if (chosen.length === 0) return null;
  const problem =
    chosen.length < 2
      ? 'Choose one more to compare.'
      : chosen.length > kMostComparedTraces
        ? `At most ${kMostComparedTraces} can be compared: take some out.`
        : '';
  return (
    <div class="chosen" id="chosen" role="status">
      <span>
        Chosen: <b>{chosen.map((run_id) => `#${run_id}`).join(', ')}</b>
      </span>
      {problem ? (
        <span class="quiet">{problem}</span>
      ) : (
        <a
          class="button"
          id="compare"
          href={format({ view: 'runs', parts: ['compare'], query: { runs: chosen.join(',') } })}
        >
          Compare {chosen.length} runs
        </a>
      )}
      <button type="button" id="choose-none" onClick={() => change_query({ chosen: '' })}>
        Choose none
      </button>
    </div>
  );
}

interface TableProps {
  runs: Run[];
  chosen: number[];
  is_current: boolean;
  on_choose(run_id: number, is_chosen: boolean): void;
}

function Table({ runs, chosen, is_current, on_choose }: TableProps) {
  return (
    <table class="run-table" id="run-table">
      <thead>
        <tr>
          <th scope="col">
            <span class="unseen">Compare</span>
          </th>
          <th scope="col">Run</th>
          <th scope="col">Robot</th>
          <th scope="col">Fluid</th>
          <th scope="col">Began</th>
          <th scope="col" class="number">
            Length
          </th>
          <th scope="col">Record</th>
          <th scope="col">Verdict</th>
        </tr>
      </thead>
      <tbody>
        {runs.map((run) => (
          <Row
            key={run.run_id}
            run={run}
            is_chosen={chosen.includes(run.run_id)}
            is_current={is_current}
            on_choose={on_choose}
          />
        ))}
      </tbody>
    </table>
  );
}

interface RowProps {
  run: Run;
  is_chosen: boolean;
  is_current: boolean;
  on_choose(run_id: number, is_chosen: boolean): void;
}

// SAFETY: that a run is open may have changed since the station was heard.
export const state_word = (state: Run['state'], is_current: boolean): string =>
  state === 'open' && !is_current ? 'was open' : state;

function Row({ run, is_chosen, is_current, on_choose }: RowProps) {
  const { tone, text } = completeness(run);
  const is_open = run.state === 'open';
  const state = state_word(run.state, is_current);
  return (
    <tr data-run={run.run_id} class={is_chosen ? 'is-chosen' : ''}>
      <td class="pick">
        <input
          type="checkbox"
          autoComplete="off"
          aria-label={`Compare run ${run.run_id}, ${run.name}`}
          checked={is_chosen}
          onChange={(event) => on_choose(run.run_id, event.currentTarget.checked)}
        />
      </td>
      <th scope="row" class="name">
        <a href={format({ view: 'runs', parts: [String(run.run_id)] })}>
          <span class="run-number">#{run.run_id}</span> {run.name}
        </a>
        {run.notes && <span class="notes">{run.notes}</span>}
      </th>
      <td class="robot">{run.robot_id}</td>
      <td class="fluid">{run.fluid ? fluid_text(run.fluid) : '–'}</td>
      <td class="began">
        <time>{started_text(run)}</time>
      </td>
      <td class="number length">{is_open ? '' : length_text(run)}</td>
      <td class={`is-record ${tone}`}>
        {run.state !== 'ended' && <span class={`state ${run.state}`}>{state}</span>}
        {!is_open && <span class={text === 'complete' ? 'complete' : ''}>{text}</span>}
      </td>
      <td class="verdict">{run.verdict}</td>
    </tr>
  );
}

function Nothing({ is_filtered }: { is_filtered: boolean }) {
  if (is_filtered) {
    return (
      <div class="waiting" id="no-match">
        <h2>No run is like that</h2>
        <p>Search in fewer words, or take a filter out.</p>
        <a class="button" href="#/runs">
          Show all runs
        </a>
      </div>
    );
  }
  return (
    <div class="waiting" id="no-runs">
      <h2>No run yet</h2>
      <p>
        The station records each robot all the time. A run gives a stretch of it a name and its conditions: open{' '}
        <a href="#/robot">the robot</a>, write a name under “Run” and press “Start run”.
      </p>
      <p>
        From a script: <code>POST /api/v1/runs</code>, also afterwards, for what was recorded already.
      </p>
    </div>
  );
}

// More rows come by themselves where the list ends.
function More({ search }: { search: RunSearch }) {
  const end = useRef<HTMLDivElement>(null);
  const found = search.found.value.length;
  const is_done = search.is_done.value;
  useEffect(() => {
    if (!end.current || is_done) return;
    const observer = new IntersectionObserver((seen) => seen.some((each) => each.isIntersecting) && void search.more());
    observer.observe(end.current);
    return () => observer.disconnect();
  }, [found, is_done]);
  const through = search.looked_through.value;
  return (
    <div class="list-end" ref={end}>
      <p class="quiet" id="runs-count" role="status">
        {search.is_busy.value
          ? `Looking: ${count(found)} found in ${count(through)} runs`
          : found > 0 && `${count(found)} ${found === 1 ? 'run' : 'runs'}${is_done ? '' : ' so far'}`}
      </p>
      {!is_done && !search.is_busy.value && found > 0 && (
        <button type="button" id="more-runs" onClick={() => void search.more()}>
          Show more
        </button>
      )}
    </div>
  );
}
