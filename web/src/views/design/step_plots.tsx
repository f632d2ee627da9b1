// The closed loop in time, in every fluid that has a model: a step of the setpoint and a disturbance. The curves are the
// page's, of the coefficients that the robot would run; the figures beside them are the station's.

import { useMemo } from 'preact/hooks';
import { fluid_text, millimetres } from '../../format';
import { RunningLaw } from '../../running_law';
import { sent_form } from './control_law';
import type { Predicted, Tuned } from './design_api';
import { Graph, path_of, type Axis, type GraphPoint } from './graph';
import { closed_loop, modes_of, type Response } from './time_response';
import { fixed_text } from './words';

export interface Curve {
  predicted: Predicted;
  response: Response;
}

export const curve_name = ({ fluid }: Predicted) => (fluid === null ? 'tuned for' : `in ${fluid_text(fluid)}`);

export function curves_of(tuned: Tuned): Curve[] {
  const { discretised } = tuned;
  if (!discretised) return [];
  return tuned.predicted.map((predicted) => {
    const { plant, experiment } = predicted;
    const law = new RunningLaw(sent_form(discretised), experiment.duty_min, experiment.duty_max);
    return {
      predicted,
      response: closed_loop(modes_of(plant), law, { ...experiment, period_s: discretised.period_s }),
    };
  });
}

const kMostPoints = 400;
const kLeast_s = 2;

export function StepPlots({ tuned, is_feasible }: { tuned: Tuned | null; is_feasible: boolean }) {
  const curves = useMemo(() => (tuned ? curves_of(tuned) : []), [tuned]);
  const first = curves[0]?.predicted;
  return (
    <figure class="design-figure">
      <figcaption>
        <b>Predicted</b> <span class="quiet">position in mm, as the controller sees it</span>
      </figcaption>
      {first ? (
        <>
          <ResponseGraph id="design-step" curves={curves} what="step" />
          <ResponseGraph id="design-disturbance" curves={curves} what="disturbance" />
          <p class="design-keys">
            {curves.map(({ predicted }, at) => (
              <span key={at} class={`design-key curve-${at % 6}`}>
                {curve_name(predicted)}
              </span>
            ))}
            <span class="design-key commanded">setpoint</span>
          </p>
        </>
      ) : (
        <p class="quiet design-plot-wait">
          {is_feasible
            ? 'Predicted steps come with the station’s answer.'
            : 'There is nothing to predict: no controller meets what is asked.'}
        </p>
      )}
    </figure>
  );
}

interface ResponseGraphProps {
  id: string;
  curves: Curve[];
  what: 'step' | 'disturbance';
}

function ResponseGraph({ id, curves, what }: ResponseGraphProps) {
  const { experiment } = curves[0]!.predicted;
  const begins_s = what === 'step' ? 0 : experiment.disturbance_at_s;
  const settled_s = Math.max(...curves.map(({ predicted }) => predicted[what].settling_s ?? 0));
  const most_s = what === 'step' ? experiment.disturbance_at_s : experiment.duration_s - experiment.disturbance_at_s;
  const length_s = Math.min(most_s, Math.max(kLeast_s, Math.ceil(settled_s * 1.6)));
  const lines = curves.map(({ response }) => line_of(response, begins_s, length_s));
  const values = lines.flat().map(([, position_m]) => position_m);
  const low = Math.min(0, ...values, experiment.setpoint_m + (what === 'disturbance' ? experiment.disturbance_m : 0));
  const high = Math.max(experiment.setpoint_m, ...values);
  const pad = (high - low) * 0.06;
  const x: Axis = { from: 0, to: length_s, text: (value) => `${Number(value.toFixed(2))} s` };
  const y: Axis = { from: low - pad, to: high + pad, text: (value) => millimetres(value, 0) };
  const said = curves.map(({ predicted }) => {
    const { settling_s, overshoot_percent } = predicted[what];
    return `${curve_name(predicted)} settles in ${fixed_text(settling_s, 2)} s with ${fixed_text(overshoot_percent, 1)} percent overshoot`;
  });
  return (
    <Graph
      id={id}
      label={`Predicted response to a ${what === 'step' ? 'step of the setpoint' : 'disturbance'}: ${said.join('; ')}`}
      x={x}
      y={y}
      height_px={150}
      draw={(place) => (
        <>
          <line
            class="crossover"
            x1={place.left}
            x2={place.right}
            y1={place.y(experiment.setpoint_m)}
            y2={place.y(experiment.setpoint_m)}
          />
          {lines.map((line, at) => (
            <path key={at} class={`curve curve-${at % 6}`} d={path_of(place, line)} />
          ))}
        </>
      )}
    />
  );
}

// From a moment on, with time 0 there.
export function line_of({ t_s, position_m }: Response, begins_s: number, length_s: number): GraphPoint[] {
  const rows = t_s.map((_, at) => at).filter((at) => t_s[at]! >= begins_s - 1e-9 && t_s[at]! <= begins_s + length_s);
  const every = Math.max(1, Math.ceil(rows.length / kMostPoints));
  return rows.filter((_, at) => at % every === 0).map((at) => [t_s[at]! - begins_s, position_m[at]!]);
}
