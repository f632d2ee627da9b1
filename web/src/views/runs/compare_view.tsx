// Several runs over each other, at the same moment: traces, what they differ by, figures with their spread.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { words } from '../../format';
import { Choice } from '../../parts/choice';
import { change_query, format, type Route } from '../../route';
import type { Session } from '../../session';
import { asked, grid_us, kMoments, parse_comparison, type Comparison } from './alignment';
import { ComparePlots } from './compare_plots';
import { ComparedFigures } from './compare_table';
import { ImpedanceSection } from './impedance';
import { said } from './run_page';
import { query, type AlignedRuns, type RunComparison, type RunsApi } from './runs_api';

const kChannels = 'position_m,duty,velocity_m_s,impedance_mv';
const kPoints = 1200;
const kMostValues = 200_000; // the station's bound is 250000
const kColumns = 5; // a run has in an answer: the channels, and one
const kEvents = [
  'detection',
  'delivery_started',
  'delivery_ended',
  'setpoint_changed',
  'mode_changed',
  'emergency',
  'link_lost',
  'limit_hit',
];
const kMomentTexts = {
  start: 'their start',
  step: 'a step',
  disturbance: 'a disturbance',
  event: 'an event',
  marker: 'a marker',
};

interface Props {
  session: Session;
  api: RunsApi;
  route: Route;
}

export function CompareView({ session, api, route }: Props) {
  const comparison = parse_comparison(route.query);
  const aligned = useSignal<AlignedRuns | null>(null);
  const metrics = useSignal<RunComparison | null>(null);
  const problem = useSignal('');
  const metrics_problem = useSignal('');
  const is_loading = useSignal(false);
  const is_live = session.phase.value === 'live';
  const runs_key = comparison.runs.join(',');
  const key = JSON.stringify(asked(comparison));
  useEffect(() => {
    if (!is_live || comparison.problem) return;
    const cancel = new AbortController();
    is_loading.value = true;
    aligned_runs(api, comparison, cancel.signal).then(
      (found) => ((aligned.value = found), (problem.value = ''), (is_loading.value = false)),
      (error: unknown) => {
        if (cancel.signal.aborted) return;
        aligned.value = null;
        problem.value = said(error);
        is_loading.value = false;
      },
    );
    return () => cancel.abort();
  }, [key, is_live]);
  useEffect(() => {
    if (!is_live || comparison.problem) return;
    let is_ours = true;
    api.comparison(comparison.runs).then(
      (found) => is_ours && ((metrics.value = found), (metrics_problem.value = '')),
      (error: unknown) => is_ours && ((metrics.value = null), (metrics_problem.value = said(error))),
    );
    return () => void (is_ours = false);
  }, [runs_key, is_live]);

  return (
    <>
      <section class="view-head run-head" aria-label="Comparison">
        <p class="way-back">
          <a href={format({ view: 'runs', query: { chosen: runs_key } })}>Runs</a>
        </p>
        <h1>{comparison.runs.length} runs side by side</h1>
        {comparison.problem ? (
          <p class="problem" role="alert" id="compare-problem">
            {comparison.problem}
          </p>
        ) : (
          <AlignTools comparison={comparison} />
        )}
      </section>
      <main class="view-body run-view" aria-label="Comparison of runs">
        {problem.value && (
          <p class="problem" role="alert" id="align-problem">
            {problem.value}
          </p>
        )}
        {comparison.problem ? (
          <a class="button" href={format({ view: 'runs', query: { chosen: runs_key } })}>
            Choose runs
          </a>
        ) : (
          <>
            {aligned.value && (
              <ComparePlots aligned={aligned.value} comparison={comparison} is_loading={is_loading.value} />
            )}
            {!aligned.value && !problem.value && <p class="quiet">The runs are being read…</p>}
            <ComparedFigures metrics={metrics.value} problem={metrics_problem.value} />
            <ImpedanceSection api={api} runs={comparison.runs} route={route} />
          </>
        )}
      </main>
    </>
  );
}

// On a grid that is about as fine as can be drawn.
async function aligned_runs(api: RunsApi, comparison: Comparison, signal: AbortSignal): Promise<AlignedRuns> {
  const points = Math.min(kPoints, Math.floor(kMostValues / comparison.runs.length / kColumns));
  const { window_s } = comparison;
  const length_s = window_s ? window_s[1] - window_s[0] : await longest_s(api, comparison.runs);
  const said_so = { ...asked(comparison), channels: kChannels, grid_us: grid_us(length_s, points) };
  return api.aligned(said_so, signal);
}

async function longest_s(api: RunsApi, run_ids: number[]): Promise<number> {
  const runs = await Promise.all(run_ids.map((run_id) => api.run(run_id)));
  return Math.max(...runs.map((run) => ((run.ended_at_us ?? Date.now() * 1000) - run.started_at_us) / 1e6));
}

function AlignTools({ comparison }: { comparison: Comparison }) {
  const { at, number, event, marker } = comparison;
  return (
    <div class="align-tools" role="group" aria-label="What the runs are aligned at">
      <span class="quiet">Aligned at</span>
      <Choice
        id="align-at"
        label="Aligned at"
        value={at}
        options={kMoments.map((moment) => ({ value: moment, text: kMomentTexts[moment] }))}
        on_choose={(next) => change_query({ at: next, number: '', from: '', to: '' })}
      />
      {at === 'event' && (
        <Choice
          id="align-event"
          label="Kind of the event"
          value={event}
          options={[...new Set([...kEvents, event])].map((kind) => ({ value: kind, text: words(kind) }))}
          on_choose={(next) => change_query({ event: next })}
        />
      )}
      {at === 'marker' && (
        <TextOnEnter
          id="align-marker"
          label="Text of the marker"
          placeholder="any marker"
          value={marker}
          on_text={(text) => change_query({ marker: text })}
        />
      )}
      {at !== 'start' && (
        <TextOnEnter
          id="align-number"
          label="Which one"
          placeholder="1"
          value={String(number)}
          on_text={(text) => change_query({ number: text, from: '', to: '' })}
        />
      )}
    </div>
  );
}

interface TextProps {
  id: string;
  label: string;
  placeholder: string;
  value: string;
  on_text(text: string): void;
}

function TextOnEnter({ id, label, placeholder, value, on_text }: TextProps) {
  const typed = useRef(value);
  return (
    <input
      id={id}
      class={id}
      type="text"
      aria-label={label}
      placeholder={placeholder}
      autoComplete="off"
      value={value}
      onInput={(event) => (typed.current = event.currentTarget.value)}
      onKeyDown={(event) => event.key === 'Enter' && on_text(typed.current.trim())}
      onBlur={(event) => event.currentTarget.value !== value && on_text(event.currentTarget.value.trim())}
    />
  );
}

export function CompareHands({ session, api, route }: Props) {
  const comparison = parse_comparison(route.query);
  const names = useSignal<Record<number, string>>({});
  const is_live = session.phase.value === 'live';
  const key = comparison.runs.join(',');
  useEffect(() => {
    if (!is_live) return;
    for (const run_id of comparison.runs.slice(0, 12)) {
      if (names.peek()[run_id] !== undefined) continue;
      api.run(run_id).then(
        (run) => (names.value = { ...names.peek(), [run_id]: run.name }),
        (error: unknown) => (names.value = { ...names.peek(), [run_id]: said(error) }),
      );
    }
  }, [key, is_live]);
  const leave_out = (run_id: number) =>
    change_query({ runs: comparison.runs.filter((other) => other !== run_id).join(',') });
  const { from_ms, to_ms, ...whole } = asked(comparison);
  const of_window = from_ms === undefined || to_ms === undefined ? {} : { from_ms, to_ms };
  return (
    <div class="record">
      <section aria-label="Runs">
        <h2>Runs</h2>
        <ul class="compared">
          {comparison.runs.map((run_id, at) => (
            <li key={run_id}>
              <span class={`run-swatch run-${at % 12}`} />
              <a href={format({ view: 'runs', parts: [String(run_id)] })}>
                <span class="run-number">#{run_id}</span> {names.value[run_id] ?? ''}
              </a>
              <button
                type="button"
                aria-pressed={run_id === comparison.reference}
                title="Differences are from this run"
                onClick={() => change_query({ reference: String(run_id) })}
              >
                Reference
              </button>
              <button
                type="button"
                aria-label={`Leave out run ${run_id}`}
                title="Leave it out"
                onClick={() => leave_out(run_id)}
              >
                ×
              </button>
            </li>
          ))}
        </ul>
      </section>
      {!comparison.problem && (
        <section aria-label="Files" id="files">
          <h2>Files</h2>
          <ul class="files">
            <li>
              <a href={`/api/v1/run-comparison/report.html?${query({ ...whole, ...of_window })}`} download="">
                Report
              </a>
              <span class="quiet">of the comparison, one HTML file</span>
            </li>
          </ul>
        </section>
      )}
    </div>
  );
}
