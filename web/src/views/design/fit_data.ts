// The data that a model was fitted to, beside what the model says: the station gives the residuals, measured less model,
// and the page reads what was measured.

import type { StoredSample } from '../../api';
import type { DesignApi, Identified, Residuals } from './design_api';

export type FittedChannel = keyof Residuals;

export interface FitTraces {
  channel: FittedChannel;
  time_s: number[]; // since the first sample of the run
  measured: (number | null)[] | null; // null: not known tick by tick, e.g. of a camera
  model: (number | null)[] | null;
  residual: (number | null)[];
}

const kChannels: readonly FittedChannel[] = ['acceleration_m_s2', 'position_m', 'velocity_m_s'];
const kPages = 40; // of 10 000 samples: more than an hour
const kTick_s = 0.01;

// Which run's residuals there are: of a joint fit one for each window, in the order of the request.
export function residuals_of(fit: Identified, at: number): { residuals: Residuals | null; run_id: number | null } {
  const of_run = fit.runs?.[at];
  if (of_run) return { residuals: of_run.residuals ?? null, run_id: of_run.run_id };
  return { residuals: fit.residuals ?? null, run_id: fit.run_id ?? null };
}

// "…, from 3.210 to 18.700 s": the part without gaps that the station has fitted.
export function window_of(warnings: readonly string[], from_s: number): number {
  const cut = warnings.map((each) => /the recording has gaps: .* from ([\d.]+) to [\d.]+ s/.exec(each)?.[1]);
  return Number(cut.find((each) => each !== undefined) ?? from_s);
}

// The row of the samples where a window begins.
const first_row = (samples: readonly Pick<StoredSample, 'robot_time_us'>[], from_s: number): number => {
  const origin_us = samples[0]?.robot_time_us ?? 0;
  return samples.findIndex(({ robot_time_us }) => (robot_time_us - origin_us) / 1e6 >= from_s - kTick_s / 2);
};

export function traces_of_fit(
  residuals: Residuals,
  samples: readonly Pick<StoredSample, 'robot_time_us' | FittedChannel>[],
  from_s: number,
): FitTraces | null {
  const channel = kChannels.find((name) => residuals[name].length > 0);
  if (channel === undefined) return null;
  const residual = residuals[channel];
  const first = first_row(samples, from_s);
  const rows = first < 0 ? [] : samples.slice(first, first + residual.length);
  const origin_us = samples[0]?.robot_time_us ?? 0;
  const is_whole = rows.length === residual.length && is_even(rows);
  if (!is_whole) {
    return { channel, time_s: residual.map((_, at) => from_s + at * kTick_s), measured: null, model: null, residual };
  }
  const measured = rows.map((row) => row[channel] ?? null);
  return {
    channel,
    time_s: rows.map(({ robot_time_us }) => (robot_time_us - origin_us) / 1e6),
    measured,
    model: measured.map((value, at) => {
      const rest = residual[at] ?? null;
      return value === null || rest === null ? null : value - rest;
    }),
    residual,
  };
}

// Without a gap: residuals are of consecutive ticks.
function is_even(rows: readonly Pick<StoredSample, 'robot_time_us'>[]): boolean {
  if (rows.length < 2) return true;
  const period_us = rows[1]!.robot_time_us - rows[0]!.robot_time_us;
  return rows.every((row, at) => at === 0 || row.robot_time_us - rows[at - 1]!.robot_time_us === period_us);
}

// All samples of some of the run's spans: a model is fitted to the first one.
export async function samples_of(
  api: Pick<DesignApi, 'samples'>,
  run_id: number,
  spans: readonly number[] = [0],
): Promise<StoredSample[]> {
  const found: StoredSample[] = [];
  const last = Math.max(...spans);
  let after: string | null = null;
  for (let page = 0; page < kPages; ++page) {
    const answer = await api.samples(run_id, after);
    found.push(...answer.samples.filter(({ span }) => spans.includes(span)));
    after = answer.next;
    if (after === null || (answer.samples.at(-1)?.span ?? 0) > last) break; // they come in the order of the spans
  }
  return found;
}

// At most `most` rows; of each group the extremes, so that no peak is lost.
export function thinned(traces: FitTraces, from_s: number, to_s: number, most: number): FitTraces {
  const { time_s } = traces;
  const rows = time_s.map((_, at) => at).filter((at) => time_s[at]! >= from_s && time_s[at]! <= to_s);
  const group = Math.ceil(rows.length / (most / 2));
  if (group < 2) return picked(traces, rows);
  const kept: number[] = [];
  const key = traces.measured ?? traces.residual;
  for (let at = 0; at < rows.length; at += group) {
    const part = rows.slice(at, at + group);
    const value = (row: number) => key[row] ?? 0;
    const low = part.reduce((best, row) => (value(row) < value(best) ? row : best), part[0]!);
    const high = part.reduce((best, row) => (value(row) > value(best) ? row : best), part[0]!);
    kept.push(...(low === high ? [low] : [Math.min(low, high), Math.max(low, high)]));
  }
  return picked(traces, kept);
}

function picked(traces: FitTraces, rows: number[]): FitTraces {
  const of = <Value>(column: Value[]) => rows.map((row) => column[row] as Value);
  return {
    channel: traces.channel,
    time_s: of(traces.time_s),
    measured: traces.measured && of(traces.measured),
    model: traces.model && of(traces.model),
    residual: of(traces.residual),
  };
}
