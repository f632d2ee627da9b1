// Models and controllers that are kept: what each was made of, and two of them beside each other.

import { useSignal } from '@preact/signals';
import { date_and_time } from '../../format';
import { format } from '../../route';
import { useAsked } from '../experiments/acts';
import { who } from '../experiments/words';
import { change_design, with_controller, with_plant } from './address';
import type { DesignComparison, StoredDesign } from './design_api';
import type { StepProps } from './parts';
import { fixed_text, kAtBound, number_text, with_sigma } from './words';

interface KeptProps extends StepProps {
  problem: string;
  is_asked: boolean;
}

export function Kept({ session, work, design, designs, problem, is_asked }: KeptProps) {
  const chosen = useSignal<number[]>([]);
  const kinds = new Set(designs.filter(({ design_id }) => chosen.value.includes(design_id)).map(({ kind }) => kind));
  const is_pair = chosen.value.length === 2 && kinds.size === 1;
  const comparison = useAsked(session, async () => (is_pair ? work.api.compare(chosen.peek()) : null), [
    chosen.value.join(','),
    is_pair,
  ]);
  const choose = (id: number, is_in: boolean) => {
    const rest = chosen.value.filter((other) => other !== id);
    chosen.value = is_in ? [...rest, id].slice(-2) : rest;
  };
  const use = (each: StoredDesign) =>
    change_design(
      each.kind === 'model' ? with_plant(design, { model: each.design_id }) : with_controller(design, each),
    );
  return (
    <section class="design-kept" id="design-kept" aria-labelledby="design-kept-title">
      <h2 id="design-kept-title">Kept models and controllers</h2>
      {problem !== '' && (
        <p class="problem" role="alert">
          {problem}
        </p>
      )}
      {designs.length === 0 ? (
        <p class="quiet design-empty">
          {is_asked ? 'None is kept yet: steps 2 and 4 keep one under a name.' : 'They are being read…'}
        </p>
      ) : (
        <div class="design-scroll">
          <table class="design-table" id="design-list">
            <thead>
              <tr>
                <th scope="col">
                  <span class="unseen">Compare</span>
                </th>
                <th scope="col" class="less number">
                  Number
                </th>
                <th scope="col">Name</th>
                <th scope="col">Kind</th>
                <th scope="col">Made from</th>
                <th scope="col" class="less">
                  By
                </th>
                <th scope="col" class="less">
                  At
                </th>
                <th scope="col">
                  <span class="unseen">Use</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {designs.map((each) => (
                <tr
                  key={each.design_id}
                  class={each.design_id === design.model || each.design_id === design.controller ? 'design-chosen' : ''}
                >
                  <td>
                    <input
                      type="checkbox"
                      autoComplete="off"
                      aria-label={`Compare ${each.kind} ${each.design_id}, ${each.name}`}
                      checked={chosen.value.includes(each.design_id)}
                      onChange={(event) => choose(each.design_id, event.currentTarget.checked)}
                    />
                  </td>
                  <td class="less number">{each.design_id}</td>
                  <td class="name">{each.name}</td>
                  <td>{each.kind}</td>
                  <td>
                    <Ancestry design={each} designs={designs} />
                  </td>
                  <td class="less">{who(each.made_by, session.store.actor.value)}</td>
                  <td class="less">{date_and_time(each.made_at_us / 1000)}</td>
                  <td>
                    <button type="button" class="design-small" onClick={() => use(each)}>
                      {each.kind === 'model' ? 'Tune for it' : 'Use it'}
                      <span class="unseen">: {each.name}</span>
                    </button>
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {chosen.value.length === 2 && kinds.size === 2 && (
        <p class="quiet design-note" role="status">
          A model and a controller have nothing in common to compare: choose two of one kind.
        </p>
      )}
      {is_pair && comparison.problem !== '' && <p class="problem">{comparison.problem}</p>}
      {is_pair && comparison.answer && <Compared comparison={comparison.answer} />}
      {designs.length > 1 && chosen.value.length < 2 && (
        <p class="quiet design-note">Choose two of one kind to compare them.</p>
      )}
    </section>
  );
}

function Ancestry({ design, designs }: { design: StoredDesign; designs: StoredDesign[] }) {
  const name_of = (id: number) => designs.find(({ design_id }) => design_id === id)?.name;
  const { model_id, parent_id, runs } = design;
  return (
    <>
      {runs.map(({ run_id }, at) => (
        <span key={at}>
          {at > 0 && ', '}
          <a href={format({ view: 'runs', parts: [String(run_id)] })}>run {run_id}</a>
        </span>
      ))}
      {model_id !== null && `model ${model_id}${name_of(model_id) ? `, ${name_of(model_id)}` : ''}`}
      {parent_id !== null && ` a change of ${parent_id}`}
      {runs.length === 0 && model_id === null && parent_id === null && <span class="quiet">nothing that is kept</span>}
    </>
  );
}

function Compared({ comparison }: { comparison: DesignComparison }) {
  const together = comparison.together[1];
  return (
    <div class="design-scroll-x">
      <table class="design-table" id="design-comparison">
        <caption>{comparison.kind === 'model' ? 'divided by b3' : 'parameters'}</caption>
        <thead>
          <tr>
            <th scope="col">Parameter</th>
            {comparison.designs.map(({ design_id, name }) => (
              <th scope="col" key={design_id} class="number">
                {name} ({design_id})
              </th>
            ))}
            <th scope="col" class="number">
              Relative
            </th>
            <th scope="col" class="number">
              Apart, in sigmas
            </th>
          </tr>
        </thead>
        <tbody>
          {comparison.parameters.map(({ name, values, one_sigma, at_bound, relative_to_first, sigmas_from_first }) => (
            <tr key={name}>
              <th scope="row">{name}</th>
              {values.map((value, at) => (
                <td key={at} class="number">
                  {with_sigma(value, one_sigma[at] ?? null)}
                  {at_bound[at] && <small> {kAtBound}</small>}
                </td>
              ))}
              <td class="number">{number_text(relative_to_first[1], 4)}</td>
              <td class="number">{fixed_text(sigmas_from_first[1], 1)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {together && (
        <p class="quiet">
          All parameters together, with their correlations: chi-square {number_text(together.chi_square, 3)} with{' '}
          {together.degrees_of_freedom} degrees of freedom, p = {number_text(together.p, 2)}.
        </p>
      )}
    </div>
  );
}
