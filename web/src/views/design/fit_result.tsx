// What the station has found: the parameters with their uncertainty, what it is worth in words, and model against data.

import { useSignal } from '@preact/signals';
import { fluid_text } from '../../format';
import { kParameters, type Fit, type Identified, type Quality } from './design_api';
import { FitPlot } from './fit_plot';
import type { StepProps } from './parts';
import { fixed_text, knowledge_text, kStructureNames, kSymbols, number_text, sentences_of, with_sigma } from './words';

interface FitResultProps extends Pick<StepProps, 'session' | 'work' | 'design'> {
  fit: Identified;
}

export function FitResult({ session, work, design, fit }: FitResultProps) {
  const at = useSignal(0);
  const runs = fit.runs ?? [];
  const chosen = Math.min(at.value, Math.max(0, runs.length - 1));
  return (
    <div class="design-fit" id="design-fit">
      <div class="design-fit-numbers">
        <Parameters fit={fit} />
        <Qualities fit={fit} />
      </div>
      <ul class="design-sentences">
        {sentences_of(fit).map((text) => (
          <li key={text}>{text}</li>
        ))}
        {fit.channels_reason && !fit.channels.includes('position_m') && (
          <li>
            Fitted is the acceleration, since the robot’s position is an estimate that a model is built into already.
          </li>
        )}
      </ul>
      {fit.warnings.length > 0 && (
        <ul class="design-warnings" id="design-warnings" aria-label="Warnings of the station">
          {fit.warnings.map((text) => (
            <li key={text}>{text}.</li>
          ))}
        </ul>
      )}
      {runs.length > 1 && (
        <p class="design-runs-of-fit" role="group" aria-label="Run that is drawn">
          {runs.map((run, index) => (
            <button
              key={index}
              type="button"
              class="design-small"
              aria-pressed={index === chosen}
              onClick={() => (at.value = index)}
            >
              run {run.run_id}: {fixed_text(run.fit_percent, 1)} %
            </button>
          ))}
        </p>
      )}
      <FitPlot session={session} work={work} design={design} fit={fit} at={chosen} />
    </div>
  );
}

const is_at_bound = (fit: Identified, name: string) =>
  (fit.doubts ?? []).some(({ code, parameter }) => code === 'parameter_at_bound' && parameter === name);

function Parameters({ fit }: { fit: Identified }) {
  return (
    <table class="design-table" id="design-parameters">
      <caption>
        {kStructureNames[fit.structure]}: kp / (b1 s<sup>α</sup> + b2 s<sup>β</sup> + 1)
      </caption>
      <thead>
        <tr>
          <th scope="col">Parameter</th>
          <th scope="col">Value ± one sigma</th>
          <th scope="col">In words</th>
        </tr>
      </thead>
      <tbody>
        {kParameters.map((name) => (
          <tr key={name}>
            <th scope="row">
              {kSymbols[name].symbol} <span class="unit">{kSymbols[name].unit}</span>
              {kSymbols[name].power !== '' && (
                <span class="unit">
                  s<sup>{kSymbols[name].power}</sup>
                </span>
              )}
            </th>
            <td class="value">{with_sigma(fit.parameters[name], fit.one_sigma[name])}</td>
            <td class="quiet">{knowledge_text(fit.parameters[name], fit.one_sigma[name], is_at_bound(fit, name))}</td>
          </tr>
        ))}
        {fit.dead_time_s > 0 && (
          <tr>
            <th scope="row">
              dead time <span class="unit">s</span>
            </th>
            <td class="value">{with_sigma(fit.dead_time_s, fit.dead_time_sigma_s)}</td>
            <td />
          </tr>
        )}
      </tbody>
    </table>
  );
}

function Qualities({ fit }: { fit: Identified }) {
  const in_use = fit.model_in_use;
  const runs = fit.runs ?? [];
  return (
    <table class="design-table" id="design-quality">
      <caption>how well it follows the data</caption>
      <thead>
        <tr>
          <th scope="col">Model, on</th>
          <th scope="col" class="number">
            Fit, %
          </th>
          <th scope="col" class="number">
            Left over, sd
          </th>
          <th scope="col" class="number">
            AIC
          </th>
        </tr>
      </thead>
      <tbody>
        {(fit.compared ?? [fit]).map((each) => (
          <Row
            key={each.structure}
            name={`${kStructureNames[each.structure]}, ${runs.length > 1 ? 'these runs' : 'this run'}`}
            quality={each}
            aic={each.aic}
            is_best={each.structure === fit.structure}
          />
        ))}
        {fit.validation && (
          <Row
            name={`validated on run ${fit.validation.run_id}, not fitted`}
            quality={fit.validation}
            id="design-validated"
          />
        )}
        {in_use ? (
          in_use.runs ? (
            in_use.runs.map((run) => (
              <Row key={run.run_id} name={`in use in ${fluid_text(in_use.fluid)}, run ${run.run_id}`} quality={run} />
            ))
          ) : (
            <Row name={`in use in ${fluid_text(in_use.fluid)}`} quality={in_use} />
          )
        ) : (
          <tr>
            <td colSpan={4} class="quiet">
              The fluid of the run has no model in use to compare with.
            </td>
          </tr>
        )}
      </tbody>
    </table>
  );
}

function Row(props: { name: string; quality: Quality; aic?: Fit['aic']; is_best?: boolean; id?: string }) {
  const { name, quality, aic, is_best = false, id } = props;
  return (
    <tr id={id} class={is_best ? 'design-best' : ''}>
      <th scope="row">{name}</th>
      <td class="number">{fixed_text(quality.fit_percent, 1)}</td>
      <td class="number">{number_text(quality.residual_sd, 3)}</td>
      <td class="number">{aic === undefined ? '' : fixed_text(aic, 0)}</td>
    </tr>
  );
}
