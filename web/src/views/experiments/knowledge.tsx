// How well the parameter of an experiment with `until` is known: sigma after each run against the target.

import type { ExperimentRun, Knowledge } from '../../experiments_api';

// The places of a logarithmic axis that has room for all of them.
export function sigma_axis(sigmas: readonly number[], target: number): (sigma: number) => number {
  const all = [...sigmas.filter((sigma) => sigma > 0), target];
  const low = Math.log10(Math.min(...all)) - 0.15;
  const high = Math.log10(Math.max(...all)) + 0.15;
  return (sigma) => (high - low < 1e-9 ? 0.5 : (Math.log10(sigma) - low) / (high - low));
}

const three_digits = (value: number | null) => (value === null ? '–' : Number(value.toPrecision(3)).toString());

export function KnowledgePanel({ runs }: { runs: readonly ExperimentRun[] }) {
  const known = runs.filter((run): run is ExperimentRun & { knowledge: Knowledge } => run.knowledge !== null);
  const last = known.at(-1)?.knowledge;
  if (!last) return null;
  const { parameter, target_sigma, reachable_sigma, choices } = last;
  return (
    <section aria-label="What is known" id="knowledge">
      <h2>
        {parameter}: sigma {three_digits(last.sigma)}, wanted {three_digits(target_sigma)}
      </h2>
      <SigmaPlot
        known={known.map(({ number, knowledge }) => ({ number, sigma: knowledge.sigma }))}
        target={target_sigma}
      />
      <div class="table-box">
        <table class="figures">
          <thead>
            <tr>
              <th scope="col">After run</th>
              <th scope="col">{parameter}</th>
              <th scope="col">Sigma</th>
              <th scope="col">Promised for the next</th>
            </tr>
          </thead>
          <tbody>
            {known.map(({ number, knowledge }) => (
              <tr key={number}>
                <th scope="row">{number}</th>
                <td>{three_digits(value_of(knowledge))}</td>
                <td>
                  {three_digits(knowledge.sigma)}
                  {knowledge.at_bound && <small> at its bound, where it means little</small>}
                </td>
                <td>{three_digits(knowledge.promised_sigma)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {reachable_sigma !== null && (
        <p class="quiet">The runs that may follow cannot come below {three_digits(reachable_sigma)}.</p>
      )}
      {choices.length > 0 && (
        <ul class="choices">
          {choices.map((choice, index) => (
            <li key={index} class={choice.forbidden === null ? '' : 'quiet'}>
              Step {choice.step}, duty × {choice.duty_factor}:{' '}
              {choice.forbidden ?? `promises ${three_digits(choice.promised_sigma)}`}
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

function value_of({ fit, parameter }: Knowledge): number | null {
  const { parameters } = fit as { parameters?: Record<string, number> };
  return parameters?.[parameter] ?? null;
}

const [kWide, kHigh, kEdge] = [300, 110, 14];

function SigmaPlot({ known, target }: { known: { number: number; sigma: number | null }[]; target: number }) {
  const sigmas = known.flatMap(({ sigma }) => (sigma === null ? [] : [sigma]));
  const place = sigma_axis(sigmas, target);
  const y = (sigma: number) => kHigh - kEdge - place(sigma) * (kHigh - 2 * kEdge);
  const x = (index: number) => kEdge + ((index + 0.5) * (kWide - 2 * kEdge)) / known.length;
  const dots = known.flatMap(({ number, sigma }, index) => (sigma === null ? [] : [{ number, sigma, at: x(index) }]));
  return (
    <svg
      class="sigma-plot"
      viewBox={`0 0 ${kWide} ${kHigh}`}
      role="img"
      aria-label={`Sigma after each run: ${sigmas.map(three_digits).join(', ')}; wanted ${three_digits(target)}`}
    >
      <line class="target" x1={0} x2={kWide} y1={y(target)} y2={y(target)} />
      <text x={kWide - 2} y={y(target) - 4} text-anchor="end">
        wanted {three_digits(target)}
      </text>
      <polyline points={dots.map(({ at, sigma }) => `${at},${y(sigma)}`).join(' ')} />
      {dots.map(({ number, sigma, at }) => (
        <circle key={number} cx={at} cy={y(sigma)} r={3.5} />
      ))}
    </svg>
  );
}
