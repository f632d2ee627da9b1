// What was measured of one run: its figures, its steps, and what happened in it.

import { clock_time, millimetres, plus_minus } from '../../format';
import { figure_named, in_order } from './figures';
import type { Moment } from './moments';
import type { RunPage } from './run_page';
import type { RunMetrics, Step } from './runs_api';
import { since_text } from './time_axis';

export function Figures({ page }: { page: RunPage }) {
  const metrics = page.metrics.value;
  return (
    <section aria-label="Figures" id="figures">
      <h2>Figures</h2>
      {page.metrics_problem.value && (
        <p class="problem" role="alert">
          {page.metrics_problem.value}
        </p>
      )}
      {!metrics && !page.metrics_problem.value && <p class="quiet">Being computed…</p>}
      {metrics && <FigureList metrics={metrics} />}
    </section>
  );
}

function FigureList({ metrics }: { metrics: RunMetrics }) {
  const named = in_order(Object.entries(metrics.figures).map(([name, value]) => ({ name, value })));
  return (
    <dl class="figure-list">
      {named.map(({ name, value }) => {
        const { title, unit, text } = figure_named(name);
        return (
          <div key={name}>
            <dt>{title}</dt>
            <dd>
              {text(value)} <span class="unit">{unit}</span>
            </dd>
          </div>
        );
      })}
    </dl>
  );
}

const kSources: Record<Step['position_source'], string> = {
  outside: 'measured from outside',
  estimate: 'the robot’s estimate',
  known: 'known',
};

export function Steps({ page }: { page: RunPage }) {
  const metrics = page.metrics.value;
  if (!metrics) return null;
  const { steps } = metrics;
  return (
    <section aria-label="Steps" id="steps">
      <h2>Steps</h2>
      {steps.length === 0 ? (
        <p class="quiet">None: a step is a new setpoint or a disturbance of 2 mm or more in auto mode.</p>
      ) : (
        <div class="wide-table" tabIndex={0} role="group" aria-label="Table of the steps">
          <table>
            <thead>
              <tr>
                <th scope="col">At</th>
                <th scope="col">Cause</th>
                <th scope="col">From → to, mm</th>
                <th scope="col">Rise, s</th>
                <th scope="col">Settling, s</th>
                <th scope="col">Overshoot, %</th>
                <th scope="col">Error at the end, mm</th>
              </tr>
            </thead>
            <tbody>
              {steps.map((step) => (
                <StepRow key={`${step.span}-${step.first_seq}`} step={step} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {steps.length > 0 && (
        <p class="quiet">
          Positions are {[...new Set(steps.map((step) => kSources[step.position_source]))].join(' and ')}; ± is two
          standard deviations of it.
          {steps.some((step) => step.position_source === 'estimate') &&
            ' What is measured by the robot’s own estimate is how well it follows its belief.'}
        </p>
      )}
      {steps.map(
        (step) =>
          step.position_doubt && (
            <p class="quiet" key={`${step.span}-${step.first_seq}`}>
              {since_text(step.at_s)}: {step.position_doubt}.
            </p>
          ),
      )}
    </section>
  );
}

function StepRow({ step }: { step: Step }) {
  const of = (name: string, value: number | null) => figure_named(name).text(value);
  return (
    <tr>
      <td>{since_text(step.at_s)}</td>
      <td>{step.cause}</td>
      <td>
        {millimetres(step.start_m)} → {millimetres(step.target_m)}
      </td>
      <td>{of('rise_10_90_s', step.rise_10_90_s)}</td>
      <td>{step.settling_s === null ? 'not settled' : of('settling_s', step.settling_s)}</td>
      <td>{of('overshoot_percent', step.overshoot_percent)}</td>
      <td>
        {millimetres(step.steady_state_error_m, 2)} <span class="unit">{plus_minus(step.position_sd_m)}</span>
      </td>
    </tr>
  );
}

interface MomentsProps {
  page: RunPage;
  is_clock: boolean;
  on_show(moment: Moment): void;
}

export function Moments({ page, is_clock, on_show }: MomentsProps) {
  const moments = page.moments.value;
  return (
    <section aria-label="Markers, commands and events" id="moments">
      <h2>Markers, commands and events</h2>
      {page.unread.value && (
        <p class="failed" role="alert">
          Not all of them could be read: {page.unread.value} It is tried again every 5 s.
        </p>
      )}
      {!page.are_events_whole.value && (
        <p class="quiet" id="events-left-out">
          There are more than {page.events.value.length} events: the newest are shown here. An export has all of them.
        </p>
      )}
      {moments.length === 0 && !page.unread.value && <p class="quiet">None.</p>}
      <ol class="moments">
        {moments.map((moment) => (
          <li key={moment.key} class={moment.kind}>
            <button type="button" title="Show it in the plots" onClick={() => on_show(moment)}>
              <time>
                {is_clock
                  ? clock_time(Math.round(moment.utc_us / 1000)).slice(0, 10)
                  : since_text((moment.utc_us - page.origin_us) / 1e6)}
              </time>
              <span class="kind">{moment.kind === 'alarm' ? 'event' : moment.kind}</span>
              <span class="text">{moment.text}</span>
            </button>
          </li>
        ))}
      </ol>
    </section>
  );
}
