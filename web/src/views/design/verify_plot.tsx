// Each step that the robot made, beside what the model predicts of it: the position with its ±, since the step began.

import { useMemo } from 'preact/hooks';
import type { StoredSample } from '../../api';
import { kSpread_sd, millimetres } from '../../format';
import { useAsked } from '../experiments/acts';
import type { Step as StepMeasures } from '../runs/runs_api';
import type { Measures, Tuned } from './design_api';
import { samples_of } from './fit_data';
import { Graph, path_of, type Axis, type GraphPoint } from './graph';
import type { StepProps } from './parts';
import { curves_of, line_of, type Curve } from './step_plots';

export interface MeasuredRow {
  t_s: number; // since the first sample of the step
  position_m: number; // as the controller saw it
  sd_m: number;
}

type Sampled = Pick<StoredSample, 'span' | 'seq' | 'robot_time_us' | 'position_m' | 'position_sd_m'>;

const kMostRows = 600;

// The robot's own position during a step, in parts without a gap.
export function measured_parts(
  samples: readonly Sampled[],
  { span, first_seq, last_seq }: Pick<StepMeasures, 'span' | 'first_seq' | 'last_seq'>,
  length_s: number,
): MeasuredRow[][] {
  const rows = samples.filter((row) => row.span === span && row.seq >= first_seq && row.seq <= last_seq);
  const origin_us = rows[0]?.robot_time_us ?? 0;
  const shown = rows.filter(({ robot_time_us }) => (robot_time_us - origin_us) / 1e6 <= length_s);
  const every = Math.max(1, Math.ceil(shown.length / kMostRows));
  const parts: MeasuredRow[][] = [];
  let last_seq_seen = NaN;
  shown.forEach(({ seq, robot_time_us, position_m, position_sd_m }, at) => {
    if (position_m === null || position_sd_m === null) return;
    const is_gap = seq !== last_seq_seen + 1;
    last_seq_seen = seq;
    if (is_gap) parts.push([]);
    if (is_gap || at % every === 0)
      parts.at(-1)!.push({ t_s: (robot_time_us - origin_us) / 1e6, position_m, sd_m: position_sd_m });
  });
  return parts;
}

interface Compared {
  step: StepMeasures;
  predicted: Measures;
}

// In which spans of the run the steps are; each boot of the robot has one.
export const spans_of = (compared: readonly { step: Pick<StepMeasures, 'span'> }[]): number[] => [
  ...new Set(compared.map(({ step }) => step.span)),
];

interface VerifyPlotsProps extends Pick<StepProps, 'session' | 'work'> {
  run_id: number;
  tuned: Tuned;
  compared: Compared[];
}

export function VerifyPlots({ session, work, run_id, tuned, compared }: VerifyPlotsProps) {
  const curve = useMemo(() => curves_of(tuned)[0], [tuned]);
  const spans = spans_of(compared);
  const of = `${run_id} ${spans.join()}`;
  const asked = useAsked(
    session,
    async () => ({ of, samples: spans.length === 0 ? [] : await samples_of(work.api, run_id, spans) }),
    [of],
  );
  const samples = asked.answer?.of === of ? asked.answer.samples : null;
  if (!curve || compared.length === 0) return null;
  if (asked.problem !== '') return <p class="problem">{asked.problem}</p>;
  if (!samples) return <p class="quiet design-plot-wait">The samples of the run are being read…</p>;
  return (
    <figure class="design-figure design-verify-plots">
      <figcaption>
        <b>Measured and predicted</b> <span class="quiet">position in mm, as the controller sees it</span>
      </figcaption>
      {compared.map((each, at) => (
        <StepGraph key={at} id={`design-verify-${at}`} {...each} curve={curve} samples={samples} />
      ))}
      <p class="design-keys">
        <span class="design-key measured">by the robot’s own estimate, ± {kSpread_sd} sd</span>
        <span class="design-key curve-0 predicted">predicted</span>
        <span class="design-key commanded">setpoint</span>
      </p>
    </figure>
  );
}

const kLeast_s = 2;

function StepGraph(props: Compared & { id: string; curve: Curve; samples: readonly Sampled[] }) {
  const { id, step, predicted, curve, samples } = props;
  const { experiment } = curve.predicted;
  const is_setpoint = step.cause === 'setpoint';
  const begins_s = is_setpoint ? 0 : experiment.disturbance_at_s;
  const most_s = is_setpoint ? experiment.disturbance_at_s : experiment.duration_s - begins_s;
  const settled_s = Math.max(predicted.settling_s ?? most_s, step.settling_s ?? most_s);
  const length_s = Math.min(most_s, Math.max(kLeast_s, Math.ceil(settled_s * 1.6)));
  const parts = measured_parts(samples, step, length_s);
  // The same step from elsewhere is predicted as one from 0.
  const shift_m = step.target_m - experiment.setpoint_m;
  const model = line_of(curve.response, begins_s, length_s).map(([t_s, at_m]): GraphPoint => [t_s, at_m + shift_m]);
  const edge = (part: readonly MeasuredRow[], sign: number) =>
    part.map(({ t_s, position_m, sd_m }): GraphPoint => [t_s, position_m + sign * kSpread_sd * sd_m]);
  const values = [...model, ...parts.flatMap((part) => [...edge(part, -1), ...edge(part, 1)])].map(([, y]) => y);
  const [low, high] = [Math.min(step.target_m, ...values), Math.max(step.target_m, ...values)];
  const pad = (high - low) * 0.06;
  const x: Axis = { from: 0, to: length_s, text: (value) => `${Number(value.toFixed(2))} s` };
  const y: Axis = { from: low - pad, to: high + pad, text: (value) => millimetres(value, 0) };
  const name = `${step.cause}, ${millimetres(step.start_m, 0)} to ${millimetres(step.target_m, 0)} mm`;
  return (
    <Graph
      id={id}
      label={`Measured and predicted position after the ${name}; the figures are in the table above`}
      x={x}
      y={y}
      height_px={150}
      draw={(place) => (
        <>
          <line
            class="crossover"
            x1={place.left}
            x2={place.right}
            y1={place.y(step.target_m)}
            y2={place.y(step.target_m)}
          />
          {parts.map((part, at) => (
            <path key={at} class="spread" d={`${path_of(place, [...edge(part, -1), ...edge(part, 1).reverse()])}Z`} />
          ))}
          {parts.map((part, at) => (
            <path key={at} class="curve measured" d={path_of(place, edge(part, 0))} />
          ))}
          <path class="curve curve-0 predicted" d={path_of(place, model)} />
        </>
      )}
    />
  );
}
