// Step 1: the runs that a model is to be identified from.

import { count, date_and_time, fluid_text } from '../../format';
import { format } from '../../route';
import { length_text } from '../runs/record';
import type { Run } from '../runs/runs_api';
import { change_design, kMostRuns, with_run } from './address';
import type { StepProps } from './parts';
import { Step } from './step';
import type { StepState } from './words';

export function RunsStep({ work, design, runs }: StepProps) {
  const known = runs.answer?.runs ?? [];
  const chosen = known.filter(({ run_id }) => design.runs.includes(run_id));
  return (
    <Step
      work={work}
      number={1}
      name="runs"
      title="Runs"
      state={state(design.runs, runs.answer !== null, known.length)}
    >
      {runs.problem !== '' && (
        <p class="problem" role="alert">
          {runs.problem}
        </p>
      )}
      {runs.answer === null && runs.problem === '' && <p class="quiet">The runs are being read…</p>}
      {runs.answer && known.length === 0 && (
        <p class="design-empty">
          There is no run yet. <a href={kRecord}>Record an identification set</a>: 193 s in which the duty excites the
          robot at several rates. Or go on to step 3 with a model of the paper.
        </p>
      )}
      {known.length > 0 && (
        <>
          <div class="design-scroll">
            <table class="design-table" id="design-run-list">
              <thead>
                <tr>
                  <th scope="col">
                    <span class="unseen">Chosen</span>
                  </th>
                  <th scope="col">Run</th>
                  <th scope="col">Name</th>
                  <th scope="col">Robot</th>
                  <th scope="col" class="less">
                    Fluid
                  </th>
                  <th scope="col" class="number">
                    Length
                  </th>
                  <th scope="col" class="less">
                    Begun
                  </th>
                  <th scope="col" class="number">
                    Lost
                  </th>
                </tr>
              </thead>
              <tbody>
                {known.map((run) => (
                  <Row
                    key={run.run_id}
                    run={run}
                    is_in={design.runs.includes(run.run_id)}
                    is_full={design.runs.length >= kMostRuns}
                    on_choose={(is_in) => change_design(with_run(design, run.run_id, is_in))}
                  />
                ))}
              </tbody>
            </table>
          </div>
          {design.runs.length > 1 && <SameConditions runs={chosen} />}
          <p class="quiet design-note">
            One model is fitted to all chosen runs together. <a href={kRecord}>Record another</a>.
          </p>
        </>
      )}
    </Step>
  );
}

const kRecord = format({ view: 'experiments', parts: ['new'], query: { profile: 'identification_set' } });

function state(chosen: number[], is_read: boolean, known: number): StepState {
  if (chosen.length > 0)
    return { kind: 'done', text: chosen.length === 1 ? `run ${chosen[0]}` : `runs ${chosen.join(', ')}` };
  if (is_read && known === 0) return { kind: 'needs', text: 'needs a recorded run' };
  return { kind: 'ready', text: 'choose one or several' };
}

function Row(props: { run: Run; is_in: boolean; is_full: boolean; on_choose(is_in: boolean): void }) {
  const { run, is_in, is_full, on_choose } = props;
  const is_open = run.state === 'open';
  return (
    <tr class={is_in ? 'design-chosen' : ''}>
      <td>
        <input
          type="checkbox"
          autoComplete="off"
          id={`design-run-${run.run_id}`}
          aria-label={`Run ${run.run_id}, ${run.name}`}
          checked={is_in}
          disabled={!is_in && (is_full || is_open)}
          onChange={(event) => on_choose(event.currentTarget.checked)}
        />
      </td>
      <td>
        <a href={format({ view: 'runs', parts: [String(run.run_id)] })}>#{run.run_id}</a>
      </td>
      <td class="name">{run.name}</td>
      <td class="robot">{run.robot_id}</td>
      <td class="less">{run.fluid ? fluid_text(run.fluid) : '–'}</td>
      <td class="number">{is_open ? 'open' : length_text(run)}</td>
      <td class="less">{date_and_time(run.started_at_us / 1000)}</td>
      <td class={`number ${run.samples_lost > 0 ? 'design-caution' : ''}`}>{count(run.samples_lost)}</td>
    </tr>
  );
}

function SameConditions({ runs }: { runs: Run[] }) {
  const fluids = new Set(runs.map(({ fluid }) => fluid ?? ''));
  const robots = new Set(runs.map(({ robot_id }) => robot_id));
  if (fluids.size < 2 && robots.size < 2) return null;
  return (
    <p class="design-caution" id="design-different-runs">
      The runs are of different{' '}
      {[fluids.size > 1 && 'fluids', robots.size > 1 && 'robots'].filter(Boolean).join(' and ')}: one model can hardly
      describe them all.
    </p>
  );
}
