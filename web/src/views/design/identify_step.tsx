// Step 2: a model from the runs. The station searches; the page shows how far it is, and what came of it.

import { useSignal } from '@preact/signals';
import { useEffect, useLayoutEffect } from 'preact/hooks';
import { Choice } from '../../parts/choice';
import { useActs } from '../experiments/acts';
import { change_design, kLimit, kStructures, with_plant, type Design, type Structure } from './address';
import type { Identified } from './design_api';
import { FitResult } from './fit_result';
import { is_at_work, type JobBody } from './jobs';
import type { StepProps } from './parts';
import { Step } from './step';
import { is_problem, texts_of, times_of, type TimeField } from './typed_times';
import { capital, kStructureNames, state_of } from './words';

export const may_record = (session: StepProps['session']) =>
  (session.me.value?.scopes ?? '').split(',').some((scope) => scope === 'record' || scope === 'command');

export function identify_body(design: Design): JobBody {
  const { runs, from_s, to_s, structure, validation } = design;
  const window = { from_s, ...(to_s === null ? {} : { to_s }) };
  const of_runs =
    runs.length === 1 ? { run_id: runs[0]!, ...window } : { runs: runs.map((run_id) => ({ run_id, ...window })) };
  return {
    kind: 'identify',
    ...of_runs,
    ...(structure === '' ? {} : { structure }),
    ...(design.limit_s === kLimit.usual ? {} : { time_limit_s: design.limit_s }),
    cut_at_gaps: true,
    residuals: true,
    ...(validation === null
      ? {}
      : {
          validation_run_id: validation,
          // The same run: what the fit has not seen of it.
          ...(runs.includes(validation) && to_s !== null ? { validation_from_s: to_s } : {}),
        }),
  };
}

export function IdentifyStep(props: StepProps) {
  const { session, work, design } = props;
  const answer = work.fit.answer.value;
  const is_live = session.phase.value === 'live';
  const body = JSON.stringify(identify_body(design));
  const fields = useTimes(design);
  // A link names the job; without one, what was found for other runs is not shown.
  useEffect(() => {
    if (!is_live) return;
    if (design.fit !== null && answer.job_id !== design.fit) work.fit.open(`job ${design.fit}`, design.fit);
    else if (design.fit === null && answer.phase !== 'idle' && answer.key !== body) work.fit.forget();
  }, [is_live, design.fit, body]);
  // The number of the job that was begun here stands in the address.
  useEffect(() => {
    if (answer.key !== body || answer.job_id === null || design.fit === answer.job_id) return;
    work.note({ ...design, fit: answer.job_id });
  }, [answer.job_id]);

  const result = answer.phase === 'done' ? answer.result : null;
  const is_known = result !== null && (answer.key === body || answer.job_id === design.fit);
  const state = state_of(
    answer,
    design.runs.length === 0 ? { kind: 'needs', text: 'needs a run' } : { kind: 'ready', text: 'ready' },
  );
  return (
    <Step
      work={work}
      number={2}
      name="identify"
      title="Identify a model"
      state={state}
      share={answer.share}
      on_cancel={() => work.fit.cancel()}
    >
      <div class="design-columns">
        <div>
          <Options {...props} fields={fields} />
          <button
            type="button"
            class="primary"
            id="design-identify"
            disabled={
              !is_live ||
              design.runs.length === 0 ||
              is_at_work(answer.phase) ||
              is_known ||
              fields.problem !== null ||
              !may_record(session)
            }
            onClick={() => work.fit.ask(body, identify_body(design))}
          >
            {is_known ? 'Identified' : 'Identify'}
          </button>
          <p class="quiet design-note" id="design-identify-note">
            {is_at_work(answer.phase) && answer.stage !== ''
              ? `${answer.stage}.`
              : may_record(session)
                ? 'The station searches. What it finds is a model of what the robot recorded, not a measurement.'
                : 'Your role may look and stop. To identify needs the role operator.'}
          </p>
        </div>
        <div>
          {result ? (
            <>
              <FitResult session={session} work={work} design={design} fit={result} />
              <KeepModel {...props} job_id={answer.job_id!} fit={result} />
            </>
          ) : (
            <p class="quiet design-empty">
              {is_at_work(answer.phase)
                ? 'The model and its residuals are shown here when they are found.'
                : 'A model is shown here with its uncertainty, beside the data and with its residuals.'}
            </p>
          )}
        </div>
      </div>
    </Step>
  );
}

function Options({ design, runs, fields }: StepProps & { fields: Times }) {
  const others = (runs.answer?.runs ?? []).filter(
    ({ run_id, state }) => state !== 'open' && !design.runs.includes(run_id),
  );
  const rest = design.to_s === null ? [] : design.runs;
  return (
    <div class="design-options">
      <div>
        <span class="design-label">Structure</span>
        <Choice
          id="design-structure"
          label="Structure"
          options={kStructures.map((value) => ({
            value,
            text: value === '' ? 'all three, the best by AIC' : kStructureNames[value],
          }))}
          value={design.structure}
          on_choose={(value) => change_design({ ...design, structure: value as Structure, fit: null })}
        />
      </div>
      <div class="design-pair">
        <Seconds field="from" label="From, s" placeholder="start" fields={fields} />
        <Seconds field="to" label="To, s" placeholder="end" fields={fields} />
      </div>
      <Seconds field="limit" label="Search at most, s" placeholder={String(kLimit.usual)} fields={fields} />
      <p class="problem" id="design-times-problem" role="alert">
        {fields.problem?.text ?? ''}
      </p>
      <div>
        <span class="design-label">Validate on</span>
        <Choice
          id="design-validation"
          label="Validate on another run"
          options={[
            { value: '', text: 'no other run' },
            ...rest.map((id) => ({ value: String(id), text: `the rest of run ${id}` })),
            ...others.map(({ run_id, name }) => ({ value: String(run_id), text: `run ${run_id}: ${name}` })),
          ]}
          value={String(design.validation ?? '')}
          on_choose={(value) =>
            change_design({ ...design, validation: value === '' ? null : Number(value), fit: null })
          }
        />
      </div>
    </div>
  );
}

type Times = ReturnType<typeof useTimes>;

// The fields together: a window is wrong by both of its ends, and is taken when both are right.
function useTimes(design: Design) {
  const known = texts_of(design);
  const typed = useSignal<Partial<Record<TimeField, string>>>({}); // an answer that comes meanwhile leaves it alone
  // What is taken of one field leaves alone what is being typed in another.
  for (const field of ['from', 'to', 'limit'] as const)
    useLayoutEffect(() => void (typed.value = { ...typed.peek(), [field]: known[field] }), [known[field]]);
  const texts = { ...known, ...typed.value };
  const found = times_of(texts);
  return {
    texts,
    problem: is_problem(found) ? found : null,
    type: (field: TimeField, text: string) => (typed.value = { ...typed.value, [field]: text }),
    take() {
      const now = times_of({ ...known, ...typed.peek() });
      if (is_problem(now)) return;
      const is_other = (['from_s', 'to_s', 'limit_s'] as const).some((name) => now[name] !== design[name]);
      if (is_other) change_design({ ...design, ...now, fit: null });
      else typed.value = {};
    },
  };
}

// A time that a person types; Enter or leaving the field takes it.
function Seconds(props: { field: TimeField; label: string; placeholder: string; fields: Times }) {
  const { field, label, placeholder, fields } = props;
  const id = `design-${field}`;
  return (
    <div>
      <label class="design-label" for={id}>
        {label}
      </label>
      <input
        id={id}
        inputMode="decimal"
        autoComplete="off"
        placeholder={placeholder}
        value={fields.texts[field]}
        aria-invalid={fields.problem?.field === field}
        onInput={(event) => fields.type(field, event.currentTarget.value)}
        onChange={() => fields.take()}
        onKeyDown={(event) => event.key === 'Enter' && fields.take()}
      />
    </div>
  );
}

// A model gets a name, and is then what is tuned for.
function KeepModel({ session, work, design, job_id, fit }: StepProps & { job_id: number; fit: Identified }) {
  const name = useSignal('');
  const { pending, problem, act } = useActs();
  const usual = `${capital(kStructureNames[fit.structure])}, run ${design.runs.join(', ') || (fit.run_id ?? '')}`;
  const keep = () =>
    act('keep', async () => {
      const kept = await work.api.keep('model', name.peek().trim() || usual, job_id);
      work.kept.value += 1;
      change_design(with_plant(design, { model: kept.design_id }));
    });
  return (
    <form
      class="design-keep"
      onSubmit={(event) => {
        event.preventDefault();
        void keep();
      }}
    >
      <input
        id="design-model-name"
        aria-label="Name of the model"
        autoComplete="off"
        maxLength={200}
        placeholder={usual}
        value={name.value}
        onInput={(event) => (name.value = event.currentTarget.value)}
      />
      <button
        type="submit"
        id="design-keep-model"
        disabled={pending.value !== '' || fit.fit_percent === null || !may_record(session)}
      >
        Keep this model and tune for it
      </button>
      <p class="problem" role="alert">
        {problem.value}
      </p>
    </form>
  );
}
