// The runs of an experiment: what each was, what became of it, and its figures.

import type { components } from '../../api_types';
import type { Experiment, ExperimentRun } from '../../experiments_api';
import { fluid_text, millimetres, words } from '../../format';
import { format } from '../../route';
import type { Session } from '../../session';
import { useAsked } from './acts';
import { how_long, kStates } from './words';

type Metrics = components['schemas']['RunMetrics'];

const kMostMeasured = 12; // the newest ones have figures

interface Variant {
  fluid?: string | null;
  controller?: string | null;
  duty_factor?: number;
  setpoint_factor?: number;
  repeat?: number;
  step?: number | null;
}

interface RunsTableProps {
  session: Session;
  experiment: Experiment;
  plotted: number | null; // the run whose plot is shown
}

export function RunsTable({ session, experiment, plotted }: RunsTableProps) {
  const { runs } = experiment;
  const measured = runs.filter((run) => run.run_id !== null && run.ended_at_us !== null).slice(-kMostMeasured);
  const asked = useAsked(session, async () => {
    const found = await Promise.all(
      measured.map(({ run_id }) => session.api.ask<Metrics>('GET', `/runs/${run_id}/metrics`).catch(() => null)),
    );
    return new Map(measured.map((run, index) => [run.number, found[index] ?? null]));
  }, [measured.map((run) => run.run_id).join()]);
  if (runs.length === 0) return <p class="quiet empty">No run has begun yet.</p>;
  return (
    <div class="table-box">
      <table class="figures" id="experiment-runs">
        <thead>
          <tr>
            <th scope="col">Run</th>
            <th scope="col">State</th>
            <th scope="col">Recorded as</th>
            <th scope="col">What</th>
            <th scope="col">Takes</th>
            <th scope="col">Settling</th>
            <th scope="col">Overshoot</th>
            <th scope="col">Lost samples</th>
            <th scope="col">± 2 sd, mm</th>
          </tr>
        </thead>
        <tbody>
          {runs.map((run) => (
            <Row
              key={run.number}
              run={run}
              metrics={asked.answer?.get(run.number) ?? null}
              plot={run.has_prediction ? format(plot_of(experiment, run)) : null}
              is_plotted={run.number === plotted}
            />
          ))}
        </tbody>
      </table>
    </div>
  );
}

const plot_of = ({ experiment_id }: Experiment, { number }: ExperimentRun) => ({
  view: 'experiments',
  parts: [`${experiment_id}`],
  query: { run: `${number}` },
});

interface RowProps {
  run: ExperimentRun;
  metrics: Metrics | null;
  plot: string | null; // the address at which it is shown
  is_plotted: boolean;
}

function Row({ run, metrics, plot, is_plotted }: RowProps) {
  const step = metrics?.steps.find((each) => each.cause === 'setpoint') ?? null;
  const figures = metrics?.figures ?? {};
  const figure = (name: string) => (figures as Record<string, number | null | undefined>)[name] ?? null;
  const lasted_s = run.ended_at_us === null ? null : (run.ended_at_us - run.started_at_us) / 1e6;
  const sd_m = figure('position_sd_max_m');
  return (
    <tr>
      <th scope="row">
        {plot === null ? (
          run.number
        ) : (
          <a href={plot} aria-label={`plot of run ${run.number}`} aria-current={is_plotted ? 'true' : undefined}>
            {run.number}
          </a>
        )}
      </th>
      <td>
        <span class={`state ${run.state}`}>{kStates[run.state]}</span>
        {run.reason !== null && <span class="quiet"> {words(run.reason)}</span>}
      </td>
      <td>
        {run.run_id === null ? '–' : <a href={format({ view: 'runs', parts: [`${run.run_id}`] })}>run {run.run_id}</a>}
      </td>
      <td>{what_of(run.variant as Variant)}</td>
      <td>{lasted_s === null ? '–' : how_long(lasted_s)}</td>
      <td>{fixed(step?.settling_s, 2, 's')}</td>
      <td>{fixed(step?.overshoot_percent, 1, '%')}</td>
      <td>{figure('samples_lost') ?? '–'}</td>
      <td>{sd_m === null ? '–' : millimetres(2 * sd_m)}</td>
    </tr>
  );
}

const fixed = (value: number | null | undefined, decimals: number, unit: string) =>
  typeof value === 'number' ? `${value.toFixed(decimals)} ${unit}` : '–';

function what_of({ fluid, controller, duty_factor = 1, setpoint_factor = 1, repeat = 1, step }: Variant): string {
  return (
    [
      step ? `step ${step}` : '',
      fluid ? fluid_text(fluid) : '',
      controller ?? '',
      duty_factor === 1 ? '' : `duty × ${duty_factor}`,
      setpoint_factor === 1 ? '' : `setpoint × ${setpoint_factor}`,
      repeat > 1 ? `repeat ${repeat}` : '',
    ]
      .filter((part) => part !== '')
      .join(', ') || 'as written'
  );
}
