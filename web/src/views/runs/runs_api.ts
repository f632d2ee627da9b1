// What the view of runs asks of the station, with the types of the API.

import type { Api, EventRecord } from '../../api';
import type { components } from '../../api_types';

type Schemas = components['schemas'];
export type Run = Schemas['Run'];
export type RunState = Schemas['RunState'];
export type Certificate = Schemas['Certificate'];
export type FinalizedRun = Schemas['FinalizedRun'];
export type Marker = Schemas['Marker'];
export type Overview = Schemas['Overview'];
export type RunMetrics = Schemas['RunMetrics'];
export type Step = Schemas['Step'];
export type StoredSample = Schemas['StoredSample'];
export type RunComparison = Schemas['RunComparison'];
export type ComparedValue = Schemas['ComparedValue'];
export type AlignedRuns = Schemas['AlignedRuns'];
export type AlignedRun = Schemas['AlignedRun'];
export type ImpedanceMap = Schemas['ImpedanceMap'];
export type ImpedanceBins = Schemas['ImpedanceBins'];
export type GapList = Schemas['GapList'];
export interface Losses extends Pick<GapList, 'gaps' | 'missing'> {
  is_whole: boolean; // there are no more
}
export type Annotation = Schemas['RunAnnotationBody'];

export interface AskedRuns {
  robot_id: string;
  state: string;
  before: number | null; // only runs with a smaller number
  limit: number;
}

export interface Window {
  from_us: number;
  to_us: number;
}

export const kMostComparedTraces = 12;
const kMostGapPages = 10;
const kMostEventPages = 10;

// A query of what is not empty.
export function query(members: Record<string, string | number | null | undefined>): string {
  const said = Object.entries(members).filter(([, value]) => value !== null && value !== undefined && value !== '');
  return new URLSearchParams(said.map(([name, value]) => [name, String(value)])).toString();
}

// From the start of a run to some time after its end: what happened during an outage of the link is received later.
const kLate_us = 600_000_000;
export function time_of(run: Run): { from_us: number; to_us?: number } {
  return run.ended_at_us === null
    ? { from_us: run.started_at_us }
    : { from_us: run.started_at_us, to_us: run.ended_at_us + kLate_us };
}

export class RunsApi {
  constructor(private readonly api: Pick<Api, 'read' | 'change'>) {}

  // Gives up what is missing of it, if that is still this number of samples.
  finalize = (run_id: number, samples_missing: number) =>
    this.api.change<FinalizedRun>(`/runs/${run_id}/finalize`, { samples_missing });

  page = async ({ robot_id, state, before, limit }: AskedRuns, signal?: AbortSignal): Promise<Run[]> =>
    (await this.api.read<{ runs: Run[] }>(`/runs?${query({ robot_id, state, before, limit })}`, signal)).runs;
  run = (run_id: number) => this.api.read<Run>(`/runs/${run_id}`);
  certificate = (run_id: number) => this.api.read<Certificate>(`/runs/${run_id}/certificate`);
  metrics = (run_id: number) => this.api.read<RunMetrics>(`/runs/${run_id}/metrics`);
  markers = async (run_id: number): Promise<Marker[]> => {
    const found: Marker[] = [];
    let after: string | null = null;
    do {
      const path: string = `/runs/${run_id}/markers?${query({ after, limit: 1000 })}`;
      const page: Schemas['RunMarkerList'] = await this.api.read<Schemas['RunMarkerList']>(path);
      found.push(...page.markers);
      after = page.next;
    } while (after !== null);
    return found;
  };
  // What is not there of a run; of a run with very many gaps the first ones.
  losses = async (run_id: number): Promise<Losses> => {
    const found: Losses = { gaps: [], missing: [], is_whole: false };
    for (let after: string | null = null, pages = 0; pages < kMostGapPages; ++pages) {
      const page: GapList = await this.api.read<GapList>(`/runs/${run_id}/gaps?${query({ after, limit: 1000 })}`);
      found.gaps.push(...page.gaps);
      found.missing.push(...page.missing);
      if (page.next === null) return { ...found, is_whole: true };
      after = page.next;
    }
    return found;
  };
  // In the time of the run; of very many the newest.
  events = async (run: Run): Promise<{ events: EventRecord[]; is_whole: boolean }> => {
    const events: EventRecord[] = [];
    for (let before: string | null = null, pages = 0; pages < kMostEventPages; ++pages) {
      const asked = query({ ...time_of(run), before, limit: 1000 });
      const path: string = `/robots/${encodeURIComponent(run.robot_id)}/events?${asked}`;
      const page: Schemas['EventList'] = await this.api.read<Schemas['EventList']>(path);
      events.push(...page.events);
      if (page.next === null) return { events, is_whole: true };
      before = page.next;
    }
    return { events, is_whole: false };
  };
  overview = (run_id: number, window: Window | null, points: number, signal?: AbortSignal) =>
    this.api.read<Overview>(`/runs/${run_id}/overview?${query({ ...window, points })}`, signal);
  // The first sample of the robot at or after a moment; null where there is none.
  sample_at = async (robot_id: string, from_us: number, signal?: AbortSignal): Promise<StoredSample | null> => {
    const path = `/robots/${encodeURIComponent(robot_id)}/samples?${query({ from_us, limit: 1 })}`;
    return (await this.api.read<{ samples: StoredSample[] }>(path, signal)).samples[0] ?? null;
  };
  // The sample after a place "span-seq" of the run.
  first_after = async (run_id: number, after: string): Promise<StoredSample | null> =>
    (await this.api.read<{ samples: StoredSample[] }>(`/runs/${run_id}/samples?${query({ after, limit: 1 })}`))
      .samples[0] ?? null;
  // The impedance map of one run, or of several together.
  impedance = async (runs: number[], bin_mm: number): Promise<ImpedanceMap> => {
    if (runs.length === 1) return this.api.read<ImpedanceMap>(`/runs/${runs[0]}/impedance-map?${query({ bin_mm })}`);
    const path = `/run-comparison/impedance-map?${query({ runs: runs.join(','), bin_mm })}`;
    return (await this.api.read<{ together: ImpedanceMap }>(path)).together;
  };
  annotate = (run_id: number, said: Annotation) => this.api.change<Run>(`/runs/${run_id}/annotate`, said);
  add_marker = (robot_id: string, text: string, at_us: number) =>
    this.api.change<Marker>(`/robots/${encodeURIComponent(robot_id)}/markers`, { text, at_us: Math.round(at_us) });

  comparison = (runs: number[]) => this.api.read<RunComparison>(`/run-comparison?${query({ runs: runs.join(',') })}`);
  aligned = (said: Record<string, string | number | null>, signal?: AbortSignal) =>
    this.api.read<AlignedRuns>(`/run-comparison/traces?${query(said)}`, signal);
}
