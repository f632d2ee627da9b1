// Figures and steps of several runs, each with its mean and its spread over the runs.

import { words } from '../../format';
import { figure_named, in_order } from './figures';
import type { ComparedValue, RunComparison } from './runs_api';

export function ComparedFigures({ metrics, problem }: { metrics: RunComparison | null; problem: string }) {
  return (
    <section aria-label="Figures" id="figures">
      <h2>Figures and their repeatability</h2>
      {problem && (
        <p class="problem" role="alert">
          {problem}
        </p>
      )}
      {!metrics && !problem && <p class="quiet">Being computed…</p>}
      {metrics && (
        <>
          {metrics.differing_conditions.length > 0 && (
            <p class="caution" id="differing">
              Not the same in all runs: {metrics.differing_conditions.map(words).join(', ')}. The spread is not that of
              repeats.
            </p>
          )}
          <Table metrics={metrics} />
          <p class="quiet">
            ± is the half width of the 95 % confidence interval of the mean; two further runs differ by less than the
            repeatability limit in 95 % of cases, by Student’s t for so few.
          </p>
        </>
      )}
    </section>
  );
}

function Table({ metrics }: { metrics: RunComparison }) {
  const { runs, steps, figures } = metrics;
  return (
    <div class="wide-table" tabIndex={0} role="group" aria-label="Table of the figures">
      <table>
        <thead>
          <tr>
            <th scope="col">Figure</th>
            {runs.map(({ run_id, name }) => (
              <th scope="col" key={run_id} title={name}>
                #{run_id}
              </th>
            ))}
            <th scope="col">Mean</th>
            <th scope="col">±</th>
            <th scope="col">sd</th>
            <th scope="col">Limit</th>
          </tr>
        </thead>
        {steps.map((step, at) => (
          <tbody key={at}>
            <tr>
              <th scope="rowgroup" colSpan={runs.length + 5} class="group">
                Step {at + 1}: {step.cause}
                {step.position_source.includes('estimate') && ', by the robot’s own estimate'}
              </th>
            </tr>
            {in_order(step.measures).map((value) => (
              <Row key={value.name} value={value} />
            ))}
            {step.position_doubt.map(
              (doubt, of) =>
                doubt !== '' && (
                  <tr key={of}>
                    <td colSpan={runs.length + 5}>
                      #{runs[of]?.run_id}: {doubt}.
                    </td>
                  </tr>
                ),
            )}
          </tbody>
        ))}
        <tbody>
          {steps.length > 0 && (
            <tr>
              <th scope="rowgroup" colSpan={runs.length + 5} class="group">
                Whole runs
              </th>
            </tr>
          )}
          {in_order(figures).map((value) => (
            <Row key={value.name} value={value} />
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Row({ value }: { value: ComparedValue }) {
  const { title, unit, text } = figure_named(value.name);
  return (
    <tr>
      <th scope="row">
        {title} {unit && <span class="unit">{unit}</span>}
      </th>
      {value.values.map((each, at) => (
        <td key={at}>{text(each)}</td>
      ))}
      <td>{text(value.mean)}</td>
      <td>{text(value.confidence_half_width)}</td>
      <td>{text(value.sd)}</td>
      <td>{text(value.repeatability_limit)}</td>
    </tr>
  );
}
