// The prediction as it is shown: the response of one run, the runs of the grid, and what speaks against them.

import { useSignal } from '@preact/signals';
import { useMemo } from 'preact/hooks';
import type { Controller, FluidsInForce } from '../../experiments_api';
import { fluid_text, millimetres } from '../../format';
import { model_for, type Plan as PlanOfRuns } from './outlook';
import { kMostPreviewed, track_of, type RunPreview } from './preview';
import { is_closed_loop, kTick_s, type Profile } from './profile';
import { TrackPlot } from './track_plot';
import { how_long } from './words';

interface PlanProps {
  plan: PlanOfRuns;
  fluid: string; // that the robot is in
  fluids: FluidsInForce | null;
  controller: Controller | null;
  is_typed: boolean;
}

export function Plan({ plan, fluid, fluids, controller, is_typed }: PlanProps) {
  const chosen = useSignal(0);
  const at = Math.min(chosen.value, Math.max(0, plan.runs.length - 1));
  const run = plan.runs[at];
  const { model, name } = model_for(run?.variant.fluid || fluid, fluids);
  const track = useMemo(() => (run ? track_of(run.line, model, controller) : null), [run, model, controller]);
  if (!is_typed) return <p class="quiet empty">Choose a profile: what the robot is predicted to do is shown here.</p>;
  if (!plan.profile || !run || !track) {
    return <p class="quiet empty">There is no prediction while the text cannot be read.</p>;
  }
  // Without the control law nothing is known of the response: a robot at rest would be a false promise.
  if (!controller && plan.profile.steps.some(({ kind }) => is_closed_loop(kind))) {
    return <p class="quiet empty">There is no prediction: the controller of the robot is not known.</p>;
  }
  const is_grid = plan.runs.length > 1;
  const low = millimetres(run.position_min_m, 0);
  const high = millimetres(run.position_max_m, 0);
  return (
    <>
      <dl class="plan-figures">
        <Figure name={plan.profile.until === '' ? 'Runs' : 'Runs, at most'}>{plan.runs_planned}</Figure>
        <Figure name={plan.profile.until === '' ? 'Takes' : 'Takes, at most'}>{how_long(plan.duration_s)}</Figure>
        <Figure name="Position">
          {low} to {high} <span class="unit">mm</span>
        </Figure>
        <Figure name="Travel">
          {millimetres(run.travel_m, 0)} <span class="unit">mm</span>
        </Figure>
        {plan.profile.until !== '' && <Figure name="Until">{plan.profile.until.replace('<=', '≤')}</Figure>}
      </dl>
      <TrackPlot
        track={track}
        label={`Predicted response of run ${at + 1}: from ${low} to ${high} mm in ${how_long(run.duration_s)}`}
        step_begins_s={run.line.step_begins.map((tick) => tick * kTick_s)}
      />
      <p class="track-legend">
        <span class="track-key predicted">predicted position</span> <span class="track-key setpoint">setpoint</span>{' '}
        <span class="track-key duty">duty</span>
        <span class="quiet">
          {' '}
          With {name}; without noise, flow, or the error of the estimate. With the run the station stores its own
          prediction, with a band where the model’s uncertainty is known.
        </span>
      </p>
      {plan.problems.length > 0 && (
        <div class="plan-problems" id="plan-problems" role="status">
          <ul>
            {plan.problems.slice(0, 6).map(({ run: number, text }) => (
              <li key={`${number}-${text}`}>
                {is_grid && <b>Run {number}: </b>}
                {text}
              </li>
            ))}
            {plan.problems.length > 6 && <li>…and {plan.problems.length - 6} more.</li>}
          </ul>
        </div>
      )}
      {is_grid && (
        <Grid profile={plan.profile} runs={plan.runs} at={at} on_choose={(index) => (chosen.value = index)} />
      )}
      {plan.runs.length === kMostPreviewed && (
        <p class="quiet">Of a larger grid the first {kMostPreviewed} are predicted.</p>
      )}
    </>
  );
}

function Figure({ name, children }: { name: string; children: preact.ComponentChildren }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{children}</dd>
    </div>
  );
}

interface GridProps {
  profile: Profile;
  runs: RunPreview[];
  at: number;
  on_choose(index: number): void;
}

// Only the axes that the grid has are columns.
function Grid({ profile, runs, at, on_choose }: GridProps) {
  const has = {
    step: profile.until !== '',
    fluid: profile.fluids.length > 1,
    controller: profile.controllers.length > 0,
    setpoint: profile.setpoint_factors.length > 0,
    duty: profile.duty_factors.length > 0,
  };
  return (
    <div class="table-box">
      <table class="figures" id="plan-grid">
        <thead>
          <tr>
            <th scope="col">
              {has.step ? 'Choice' : profile.repeats > 1 ? `Run, ${profile.repeats} times each` : 'Run'}
            </th>
            {has.step && <th scope="col">Step</th>}
            {has.fluid && <th scope="col">Fluid</th>}
            {has.controller && <th scope="col">Controller</th>}
            {has.setpoint && <th scope="col">Setpoint ×</th>}
            {has.duty && <th scope="col">Duty ×</th>}
            <th scope="col">Takes</th>
            <th scope="col">Position, mm</th>
            <th scope="col">Travel, mm</th>
          </tr>
        </thead>
        <tbody>
          {runs.map(({ variant, ...run }, index) => (
            <tr key={index} class={`${index === at ? 'at' : ''} ${run.problems.length > 0 ? 'faulty' : ''}`}>
              <th scope="row">
                <button type="button" aria-pressed={index === at} onClick={() => on_choose(index)}>
                  {index + 1}
                </button>
              </th>
              {has.step && (
                <td>
                  {variant.step} {profile.steps[variant.step - 1]?.kind}
                </td>
              )}
              {has.fluid && <td>{fluid_text(variant.fluid)}</td>}
              {has.controller && <td>{variant.controller}</td>}
              {has.setpoint && <td>{variant.setpoint_factor}</td>}
              {has.duty && <td>{variant.duty_factor}</td>}
              <td>{how_long(run.duration_s)}</td>
              <td>
                {millimetres(run.position_min_m, 0)} to {millimetres(run.position_max_m, 0)}
              </td>
              <td>{millimetres(run.travel_m, 0)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
