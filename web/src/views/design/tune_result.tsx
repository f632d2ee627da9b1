// Asked against achieved, what else could be asked, and what is predicted in each fluid and under each doubt.

import type { Fluid } from '../../api';
import { fluid_text, millimetres, percent } from '../../format';
import type { Achieved, Measures, Near, RobustnessRow, Tuned } from './design_api';
import { rounded } from './ask';
import type { Solution, Specification } from './frequency';
import { curve_name } from './step_plots';
import { fixed_text, number_text, with_sigma } from './words';

interface AchievementProps {
  asked: Specification;
  tuned: Tuned | null; // the station's answer to what is asked
  own: Solution | null; // the page's
  is_dragged: boolean;
  on_ask(asked: Specification): void;
}

export function Achievement({ asked, tuned, own, is_dragged, on_ask }: AchievementProps) {
  const achieved = tuned?.feasible ? tuned.achieved : null;
  const sampled = tuned?.feasible ? tuned.sampled : null;
  const law = tuned?.feasible ? tuned : own?.law;
  return (
    <>
      <table class="design-table" id="design-achieved" data-source={tuned ? 'station' : 'page'}>
        <caption>
          {tuned
            ? `by the station, from the model: no measurement${achieved?.phase_margin_sigma_deg ? '; ± one sigma, from its fit' : ''}`
            : is_dragged
              ? 'by this page, until the slider rests'
              : 'by this page, until the station answers'}
        </caption>
        <thead>
          <tr>
            <th scope="col">Specification</th>
            <th scope="col" class="number">
              Asked
            </th>
            <th scope="col" class="number">
              Achieved
            </th>
            <th
              scope="col"
              class="number"
              title="The robot holds its duty for a period; half of it counts as dead time"
            >
              On the robot
            </th>
          </tr>
        </thead>
        <tbody>
          <Line
            name="Crossover, rad/s"
            asked={number_text(asked.crossover_rad_s)}
            of={[achieved, sampled]}
            text={(margins) => uncertain_text(margins.gain_crossover_rad_s, margins.crossover_sigma_rad_s, 3)}
          />
          <Line
            name="Phase margin, °"
            asked={number_text(asked.phase_margin_deg)}
            of={[achieved, sampled]}
            text={(margins) => uncertain_text(margins.phase_margin_deg, margins.phase_margin_sigma_deg, 2)}
          />
          <Line
            name="Phase slope, °/(rad/s)"
            asked="0"
            of={[achieved, sampled]}
            text={(margins) =>
              uncertain_text(margins.phase_slope_deg_per_rad_s, margins.phase_slope_sigma_deg_per_rad_s, 4)
            }
          />
          <Line
            name="Ms, Mt"
            asked=""
            of={[achieved, sampled]}
            text={({ ms, mt }) => `${fixed_text(ms, 3)}, ${fixed_text(mt, 3)}`}
          />
          <tr>
            <th scope="row">Controller</th>
            <td colSpan={3} class="number" id="design-law">
              {law ? `kp ${number_text(law.kp, 5)}, kd ${number_text(law.kd, 4)}, μ ${fixed_text(law.mu, 4)}` : 'none'}
            </td>
          </tr>
        </tbody>
      </table>
      {tuned?.plant_doubts_text && (
        <p class="design-caution design-note" id="design-plant-doubts">
          The model: {tuned.plant_doubts_text}.
        </p>
      )}
      {tuned?.warnings?.map((text) => (
        <p key={text} class="design-caution design-note">
          The controller: {text}.
        </p>
      ))}
      {tuned && !tuned.feasible && <NotFeasible tuned={tuned} on_ask={on_ask} />}
      {!tuned && own?.law === null && (
        <p class="design-caution design-note">
          {own.why === 'theta'
            ? 'The controller would have to add more phase than it can, or take phase away.'
            : 'The phase of the model falls too fast there to be made flat.'}
        </p>
      )}
    </>
  );
}

const uncertain_text = (value: number, sigma: number | null | undefined, decimals: number) =>
  sigma ? with_sigma(value, sigma) : fixed_text(value, decimals);

interface LineProps {
  name: string;
  asked: string;
  of: readonly (Achieved | null)[];
  text(margins: Achieved): string;
}

const Line = ({ name, asked, of, text }: LineProps) => (
  <tr>
    <th scope="row">{name}</th>
    <td class="number commanded">{asked}</td>
    {of.map((margins, at) => (
      <td key={at} class="number value">
        {margins ? text(margins) : '–'}
      </td>
    ))}
  </tr>
);

function NotFeasible({ tuned, on_ask }: { tuned: Tuned; on_ask(asked: Specification): void }) {
  const line = (near: Near, may_ask: boolean) => (
    <li key={near.name}>
      <span>
        {number_text(near.crossover_rad_s, 4)} rad/s, {fixed_text(near.phase_margin_deg, 1)}°
        <span class="quiet"> {near.name}</span>
      </span>
      {may_ask && (
        <button type="button" class="design-small" onClick={() => on_ask(inside(near))}>
          Ask for this
        </button>
      )}
    </li>
  );
  return (
    <div class="design-refused" id="design-refused" role="status">
      <p>Nothing meets this: {tuned.reason}.</p>
      <ul>
        {tuned.nearest_all.map((near) => line(near, true))}
        {tuned.relaxed.map((near) => line(near, false))}
      </ul>
    </div>
  );
}

// Rounded as the sliders are, and not over the edge of the region that it lies at.
export const inside = ({ crossover_rad_s, phase_margin_deg }: Specification): Specification =>
  rounded({ crossover_rad_s, phase_margin_deg: Math.floor(phase_margin_deg * 10) / 10 });

interface PredictionsProps {
  tuned: Tuned;
  fluids: readonly Fluid[];
}

export function Predictions({ tuned, fluids }: PredictionsProps) {
  const predicted = new Set(tuned.predicted.map(({ fluid }) => fluid));
  const without = fluids.filter(({ fluid }) => !predicted.has(fluid)).map(({ fluid }) => fluid_text(fluid));
  const first = tuned.predicted[0]?.experiment;
  return (
    <div class="design-predictions">
      <div class="design-scroll-x">
        <table class="design-table" id="design-predicted">
          <caption>
            predicted by the station
            {first &&
              `, for a step of ${millimetres(first.setpoint_m, 0)} mm and a disturbance of ${millimetres(first.disturbance_m, 0)} mm`}
          </caption>
          <MeasuresHead name="Model" />
          <tbody>
            {tuned.predicted.map((each) => (
              <MeasuresRow
                key={each.fluid ?? ''}
                name={curve_name(each)}
                step={each.step}
                disturbance={each.disturbance}
                note={each.is_diverging ? 'diverges' : `${percent(each.clipped_fraction)} % clipped`}
              />
            ))}
          </tbody>
        </table>
      </div>
      {without.length > 0 && (
        <p class="quiet design-note">
          {without.join(', ')}: without a model that has a plant, nothing is predicted there.
        </p>
      )}
      {tuned.robustness && (
        <details class="design-robustness">
          <summary>What if the model is wrong? {summary_of(tuned.robustness.rows)}</summary>
          <div class="design-scroll-x">
            <table class="design-table" id="design-robustness">
              <MeasuresHead name="If" />
              <tbody>
                {tuned.robustness.rows.map((row, at) => (
                  <MeasuresRow
                    key={at}
                    name={`${row.name}${row.duty_min === 0 ? ', no reverse' : ''}`}
                    step={row.step}
                    disturbance={row.disturbance}
                    note={row.is_diverging ? 'diverges' : row.is_stable ? 'stable' : 'unstable'}
                  />
                ))}
              </tbody>
            </table>
          </div>
          <p class="quiet design-note">
            Duty noise: {number_text(tuned.robustness.duty_sd_per_noise_sd, 3)} per metre of noise on the position.
          </p>
        </details>
      )}
    </div>
  );
}

// In words: stable in all, or in how many not.
export function summary_of(rows: readonly Pick<RobustnessRow, 'is_stable' | 'is_diverging'>[]): string {
  const bad = rows.filter(({ is_stable, is_diverging }) => !is_stable || is_diverging).length;
  return bad === 0 ? `Stable in all ${rows.length} cases.` : `Not stable in ${bad} of ${rows.length} cases.`;
}

const kMeasures = [
  { title: 'Settling, s', of: (measures: Measures) => fixed_text(measures.settling_s, 2) },
  { title: 'Overshoot, %', of: (measures: Measures) => fixed_text(measures.overshoot_percent, 1) },
  { title: 'Rise, s', of: (measures: Measures) => fixed_text(measures.rise_10_90_s, 2) },
] as const;

function MeasuresHead({ name }: { name: string }) {
  return (
    <thead>
      <tr>
        <th scope="col">{name}</th>
        {kMeasures.map(({ title }) => (
          <th scope="col" key={title} class="number">
            {title}
          </th>
        ))}
        <th scope="col" class="number">
          After the disturbance, s
        </th>
        <th scope="col">Note</th>
      </tr>
    </thead>
  );
}

function MeasuresRow(props: { name: string; step: Measures; disturbance: Measures; note: string }) {
  const { name, step, disturbance, note } = props;
  return (
    <tr>
      <th scope="row">{name}</th>
      {kMeasures.map(({ title, of }) => (
        <td key={title} class="number">
          {of(step)}
        </td>
      ))}
      <td class="number">{fixed_text(disturbance.settling_s, 2)}</td>
      <td class="quiet">{note}</td>
    </tr>
  );
}
