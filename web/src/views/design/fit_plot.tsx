// Model against data over time, and below what is left over. Dragging over a plot shows that stretch.

import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { useAsked } from '../experiments/acts';
import { RunPlot, type PlotContent, type PlotOptions, type PlotTrace } from '../runs/run_plot';
import { since_text, time_splits, time_step_s } from '../runs/time_axis';
import type { Identified } from './design_api';
import { residuals_of, samples_of, thinned, traces_of_fit, window_of, type FitTraces } from './fit_data';
import type { StepProps } from './parts';
import { fixed_text } from './words';

const kChannelNames: Record<string, { title: string; unit: string; factor: number }> = {
  acceleration_m_s2: { title: 'Acceleration', unit: 'm/s²', factor: 1 },
  velocity_m_s: { title: 'Velocity', unit: 'mm/s', factor: 1e3 },
  position_m: { title: 'Position', unit: 'mm', factor: 1e3 },
};
const kMostRows = 2400;
const kFirst_s = 12; // so that the two traces can be told apart

interface FitPlotProps extends Pick<StepProps, 'session' | 'work' | 'design'> {
  fit: Identified;
  at: number; // of a joint fit, which run
}

export function FitPlot({ session, work, design, fit, at }: FitPlotProps) {
  const { residuals, run_id } = residuals_of(fit, at);
  const samples = useAsked(session, async () => (run_id === null ? [] : samples_of(work.api, run_id)), [run_id]);
  const from_s = window_of(fit.runs?.[at]?.warnings ?? fit.warnings ?? [], design.from_s);
  const traces = useMemo(
    () => (residuals && samples.answer ? traces_of_fit(residuals, samples.answer, from_s) : null),
    [residuals, samples.answer, from_s],
  );
  if (!residuals) return <p class="quiet">This fit was made without residuals: identify anew to see them.</p>;
  if (samples.problem !== '') return <p class="problem">{samples.problem}</p>;
  if (!traces) return <p class="quiet design-plot-wait">The samples of the run are being read…</p>;
  return <Traces key={`${run_id}-${traces.time_s.length}`} traces={traces} run_id={run_id} />;
}

function Traces({ traces, run_id }: { traces: FitTraces; run_id: number | null }) {
  const hosts = [useRef<HTMLDivElement>(null), useRef<HTMLDivElement>(null)];
  const plots = useRef<(RunPlot | null)[]>([]); // null: nothing to be drawn there
  const whole: [number, number] = [traces.time_s[0] ?? 0, traces.time_s.at(-1) ?? 1];
  const view = useSignal<[number, number]>([whole[0], Math.min(whole[1], whole[0] + kFirst_s)]);
  const cursor = useSignal<number | null>(null);
  const { title, unit, factor } = kChannelNames[traces.channel]!;
  const is_whole = view.value[0] <= whole[0] && view.value[1] >= whole[1];

  useEffect(() => {
    const options = (shows_x: boolean, least_span: number): PlotOptions => ({
      group: `design-fit-${run_id}`,
      label: (value) => fixed_text(value * factor, factor === 1 ? 2 : 0),
      least_span,
      shows_x,
      x_label: (value) => since_text(value),
      x_splits: (from, to, width_px) => time_splits(from, to, time_step_s(to - from, Math.max(2, width_px / 90))),
      on_select: (from, to) => (view.value = [from, to]),
      on_cursor: (time_s) => (cursor.value = time_s),
    });
    const least = 0.02 / factor;
    plots.current = hosts.map((host, at) => host.current && new RunPlot(host.current, options(at === 1, least)));
    const theme = matchMedia('(prefers-color-scheme: light)');
    const restyle = () => plots.current.forEach((plot) => plot?.restyle());
    theme.addEventListener('change', restyle);
    return () => {
      theme.removeEventListener('change', restyle);
      for (const plot of plots.current) plot?.destroy();
      plots.current = [];
    };
  }, [traces]);
  useEffect(() => {
    const shown = thinned(traces, view.value[0], view.value[1], kMostRows);
    const content = (of: PlotTrace[]): PlotContent => ({
      time_s: shown.time_s,
      bands: [],
      traces: of,
      gaps_s: [],
      lines: [],
    });
    const data: PlotTrace[] = [];
    // What was recorded lies over the model, as a thin line on a broad one.
    if (shown.model) data.push({ values: shown.model, colour: '--duty', width_px: 2.5 });
    if (shown.measured) data.push({ values: shown.measured, colour: '--measured', width_px: 1 });
    const rest: PlotTrace[] = [{ values: shown.residual, colour: '--seen', width_px: 1 }];
    plots.current[0]?.show(content(data), view.value, { traces: extremes(data) });
    plots.current[1]?.show(content(rest), view.value, { traces: extremes(rest) });
  }, [traces, view.value]);

  const row = cursor.value === null ? -1 : nearest(traces.time_s, cursor.value);
  const at = (values: (number | null)[] | null) => {
    const value = row < 0 ? null : values?.[row];
    return value === null || value === undefined ? '–' : fixed_text(value * factor, factor === 1 ? 3 : 1);
  };
  return (
    <div
      class="design-fit-plot"
      role="group"
      aria-label={`Model against data${run_id === null ? '' : ` of run ${run_id}`}`}
    >
      <figure>
        <figcaption>
          <b>{title}</b> <span class="unit">{unit}</span>
          {traces.measured && (
            <>
              <span class="design-key measured">recorded</span>
              <span class="design-key model">model</span>
              <output>
                {row < 0 ? '' : `${since_text(traces.time_s[row]!)}: ${at(traces.measured)}, model ${at(traces.model)}`}
              </output>
            </>
          )}
          <span class="design-fit-view">
            <button type="button" class="design-small" disabled={is_whole} onClick={() => (view.value = whole)}>
              Whole run
            </button>
          </span>
        </figcaption>
        {traces.measured ? (
          <div class="design-fit-data" ref={hosts[0]!} />
        ) : (
          <p class="quiet">
            Recorded values cannot be laid beside the residuals here: those are not of the robot’s own ticks.
          </p>
        )}
      </figure>
      <figure>
        <figcaption>
          <b>Left over</b> <span class="unit">{unit}</span> <span class="quiet">recorded less model</span>
          <output>{row < 0 ? '' : at(traces.residual)}</output>
        </figcaption>
        <div class="design-fit-rest" ref={hosts[1]!} />
      </figure>
    </div>
  );
}

function extremes(traces: PlotTrace[]): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (const { values } of traces) {
    for (const value of values) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  return low <= high ? [low, high] : null;
}

function nearest(time_s: number[], at_s: number): number {
  let [low, high] = [0, time_s.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time_s[middle]! < at_s) low = middle + 1;
    else high = middle;
  }
  return low;
}
