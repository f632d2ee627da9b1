// What became of a stop, of one robot or of every robot: counts and a few names, and the sentences that say so.
//
// A fleet of hundreds gives as few lines as one robot, so that nothing below them moves out of reach.

import type { CommandRecord, StopSummary } from './api';
import { sentence } from './reasons';

export interface StopOutcome {
  summary: StopSummary;
  reason: string; // of the first that failed
}

// What telemetry and robots' states show since a press, in robots. `open`: neither latched nor kept.
export interface StopEvidence {
  latched: number;
  kept: number; // not connected, and the station has the stop for it
  cleared: number; // was latched since, and is not any more
  open: number;
}

export const is_complete = ({ latched, kept, open }: StopEvidence) => open === 0 && latched + kept > 0;

const kNames = 3;
const kMaxNamed = 100; // as the station's own summary

type Named = StopSummary['not_acknowledged'][number]['outcome'];

// The outcome of a stop by its command records: of one robot, or of a station that answers without a summary.
export function outcome_of(records: CommandRecord[]): StopOutcome {
  const of = (named: Named) => records.filter((record) => outcome_of_state(record.state) === named);
  const [failed, unanswered, kept] = [of('failed'), of('unanswered'), of('kept')];
  const named = [...failed, ...unanswered, ...kept].map(({ robot_id, state }) => ({
    robot_id,
    outcome: outcome_of_state(state) as Named,
  }));
  return {
    summary: {
      robots: records.length,
      acknowledged: records.length - named.length,
      unanswered: unanswered.length,
      failed: failed.length,
      kept: kept.length,
      left_out: 0,
      not_acknowledged: named.slice(0, kMaxNamed),
      not_named: Math.max(0, named.length - kMaxNamed),
    },
    reason: failed[0]?.reason || failed[0]?.state || '',
  };
}

function outcome_of_state(state: CommandRecord['state']): Named | 'acknowledged' {
  if (state === 'acknowledged' || state === 'verified') return 'acknowledged';
  if (state === 'queued') return 'kept';
  return state === 'sent' ? 'unanswered' : 'failed';
}

// One word for the answers of all robots that were stopped: the worst decides.
export function phase_of({ summary }: StopOutcome): 'stopped' | 'kept' | 'unanswered' | 'failed' {
  if (summary.failed > 0 || summary.robots === summary.left_out) return 'failed';
  if (summary.unanswered > 0) return 'unanswered';
  return summary.kept > 0 ? 'kept' : 'stopped';
}

// The sentences of a stop of every robot.
export function words_of_all({ summary, reason }: StopOutcome, answered_in: string): string {
  const { robots, acknowledged, unanswered, failed, kept, left_out } = summary;
  if (robots === 0) return 'The stop may not have arrived: the station knows no robot.';
  const parts = [
    failed > 0 &&
      `${names(summary, 'failed', failed)}: the stop may not have arrived (${sentence(reason) || 'the station’s log says why'}). Press again, or cut the power.`,
    `Stopped ${acknowledged} of ${count(robots - left_out, 'robot')} in ${answered_in}.`,
    unanswered > 0 && `${names(summary, 'unanswered', unanswered)}: not answered yet; the stop is repeated.`,
    kept > 0 && `${names(summary, 'kept', kept)}: not connected; kept, and sent first on return.`,
    left_out > 0 && `Left out: ${left_out} retired and not connected.`,
  ];
  return parts.filter(Boolean).join(' ');
}

const count = (number: number, noun: string) => `${number} ${noun}${number === 1 ? '' : 's'}`;

// "a, b, c and 615 more"
function names(summary: StopSummary, outcome: Named, total: number): string {
  const known = summary.not_acknowledged.filter((each) => each.outcome === outcome).map((each) => each.robot_id);
  const first = known.slice(0, kNames);
  if (first.length === 0) return count(total, 'robot');
  return total > first.length ? `${first.join(', ')} and ${total - first.length} more` : first.join(', ');
}
