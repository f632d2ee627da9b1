// What several sections show: the station, its recording and its figures, asked for again and again.

import { useComputed } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { Recording, Station } from '../../api';
import { plot_settings } from '../../plots/strips';
import type { Session } from '../../session';
import { refusal, useAsked } from '../experiments/acts';
import { judge, type Fleet, type HealthLine } from './health';
import type { Metrics } from './metrics';
import { PaceMeter, type Pace } from './pace';
import type { StationApi } from './station_api';

export interface Facts {
  station: Station;
  recording: Recording;
  metrics: Metrics | null;
  metrics_problem: string; // why there are none
  pace: Pace | null;
  clock_off_ms: number; // the station's clock less this machine's
  asked_at_ms: number; // UTC
  began_ms: number; // the same moment, by this page
}

// What each section is given.
export interface Context {
  session: Session;
  api: StationApi;
  facts: Facts | null;
  problem: string;
  is_current: boolean; // SAFETY: else nothing is shown as what is so now
  is_admin: boolean;
  is_utc: boolean;
  query: Record<string, string>;
}

const kLook_ms = 5000;
const meter = new PaceMeter(); // goes on counting when the view is opened again

export function useFacts(session: Session, api: StationApi): { facts: Facts | null; problem: string } {
  const ask = async (): Promise<Facts> => {
    const [began_ms, asked_at_ms] = [performance.now(), Date.now()];
    let metrics_problem = '';
    const [station, recording, metrics] = await Promise.all([
      session.api
        .station()
        .then((answer) => ({ answer, halfway_ms: asked_at_ms + (performance.now() - began_ms) / 2 })),
      session.api.recording(),
      api.metrics().catch((error: unknown) => {
        metrics_problem = refusal(error);
        return null;
      }),
    ]);
    meter.note(performance.now() / 1000, recording.counters);
    return {
      station: station.answer,
      recording,
      metrics,
      metrics_problem,
      pace: meter.pace(),
      clock_off_ms: station.answer.utc_us / 1000 - station.halfway_ms,
      asked_at_ms,
      began_ms,
    };
  };
  const { answer, problem } = useAsked(session, ask, [], kLook_ms);
  useEffect(() => {
    if (!answer) return;
    session.station.value = answer.station;
    session.take_recording(answer.recording, answer.began_ms);
  }, [answer]);
  return { facts: answer, problem };
}

// Changes only when one of its figures does, however many robots report.
function useFleet(session: Session): Fleet {
  const figures = useComputed(() => {
    const robots = session.store.robots.value;
    const connected = robots.filter((robot) => !robot.is_away.value);
    const states = connected.map((robot) => robot.state.value);
    const worst_us = Math.max(0, ...states.map(({ clock }) => clock?.round_trip_us ?? 0));
    const fleet: Fleet = {
      connected: connected.length,
      known: robots.length,
      silent: connected.filter((robot) => robot.is_silent.value).length,
      unstoppable: connected.filter((robot) => robot.is_unstoppable.value).length,
      unmeasured: states.filter(({ stop_path }) => (stop_path?.round_trip_us ?? null) === null).length,
      samples_per_s: states.reduce((sum, { sample_period_us: us }) => sum + (us > 0 ? 1e6 / us : 0), 0),
      worst_ms: worst_us > 0 ? Number((worst_us / 1000).toPrecision(2)) : null,
    };
    return JSON.stringify(fleet);
  });
  return JSON.parse(figures.value) as Fleet;
}

// Robots report often: what shows no health does not follow it.
export function useHealth({ session, facts, is_current }: Context): HealthLine[] {
  const fleet = useFleet(session);
  const is_measured = useComputed(() => session.vitals.now.value.page_ms !== null).value;
  return judge({
    station: facts?.station ?? null,
    recording: facts?.recording ?? null,
    metrics: facts?.metrics ?? null,
    metrics_problem: facts?.metrics_problem ?? '',
    pace: facts?.pace ?? null,
    fleet,
    is_page_measured: is_measured,
    clock_off_ms: facts?.clock_off_ms ?? null,
    now_ms: Date.now(),
    is_current,
  });
}

export const use_utc = () => plot_settings.kept.value.is_utc;
