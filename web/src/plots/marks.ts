// What stands on the time axis beside the samples: markers, events and commands as moments, runs as stretches.

import type { CommandRecord, EventRecord, MarkerRecord, RunRecord } from '../api';
import { describe } from '../parts/log_strip';
import type { LogLine } from '../store';

export interface Mark {
  key: string;
  at_s: number; // UTC
  kind: 'marker' | 'event' | 'command';
  tone: string; // '', 'caution' or 'alarm'
  text: string;
}

export interface RunStretch {
  run_id: number;
  from_s: number;
  to_s: number | null; // null: it is open
  text: string;
}

const kMost = 4000; // the oldest are dropped

interface Kept {
  at_s: number;
  mark: Mark;
  line: LogLine | null; // that it was made of
}

export class Marks {
  runs: RunStretch[] = [];
  private moments: Kept[] = []; // by time
  private readonly by_key = new Map<string, Kept>();

  // `known`: of a line what is known at the moment that is shown, or the line itself where that is all of it.
  constructor(private readonly known: (line: LogLine) => LogLine = (line) => line) {}

  get all(): readonly Mark[] {
    return this.moments.map((kept) => this.shown(kept));
  }

  take_events(events: EventRecord[]): void {
    this.put(events.map((event) => kept_of(line_of({ event }), event.received_at_us)));
  }

  take_commands(commands: CommandRecord[]): void {
    this.put(commands.map((command) => kept_of(line_of({ command }), command.submitted_at_us)));
  }

  // What has happened since; `lines` are of every robot, and of the page.
  take_log(lines: readonly LogLine[], robot_id: string): void {
    const ours = lines.filter((line) => line.robot_id === robot_id && line.note === null);
    this.put(ours.map((line) => kept_of(line, line.at_ms * 1000)));
  }

  take_markers(markers: MarkerRecord[]): void {
    this.put(
      markers.map(({ marker_id, utc_us, made_at_us, text }): Kept => {
        const at_s = (utc_us ?? made_at_us) / 1e6;
        const mark: Mark = { key: `marker-${marker_id}`, at_s, kind: 'marker', tone: '', text: text || 'marker' };
        return { at_s, mark, line: null };
      }),
    );
  }

  set_runs(runs: RunRecord[]): void {
    this.runs = runs.map(({ run_id, name, started_at_us, ended_at_us }) => ({
      run_id,
      from_s: started_at_us / 1e6,
      to_s: ended_at_us === null ? null : ended_at_us / 1e6,
      text: name || `run ${run_id}`,
    }));
  }

  within(from_s: number, to_s: number): Mark[] {
    return this.moments.slice(this.first_from(from_s), this.first_from(to_s)).map((kept) => this.shown(kept));
  }

  // The one next to a time, if there is one so near.
  near(at_s: number, reach_s: number): Mark | null {
    let best: Mark | null = null;
    for (const mark of this.within(at_s - reach_s, at_s + reach_s)) {
      if (!best || Math.abs(mark.at_s - at_s) < Math.abs(best.at_s - at_s)) best = mark;
    }
    return best;
  }

  private first_from(at_s: number): number {
    let [low, high] = [0, this.moments.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.moments[middle] as Kept).at_s < at_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  private shown({ mark, line }: Kept): Mark {
    const known = line && this.known(line);
    return known === line ? mark : mark_of(known as LogLine, mark.at_s);
  }

  private put(added: Kept[]): void {
    if (added.length === 0) return;
    for (const kept of added) this.by_key.set(kept.mark.key, kept);
    const sorted = [...this.by_key.values()].sort((a, b) => a.at_s - b.at_s);
    for (const { mark } of sorted.slice(0, Math.max(0, sorted.length - kMost))) this.by_key.delete(mark.key);
    this.moments = sorted.slice(-kMost);
  }
}

const line_of = (what: { event?: EventRecord; command?: CommandRecord }): LogLine => ({
  key: what.command
    ? `command-${what.command.command_id}`
    : `event-${what.event?.robot_id}-${what.event?.boot_id ?? ''}-${what.event?.event_seq ?? ''}-${what.event?.received_at_us}`,
  at_ms: 0,
  robot_id: '',
  event: what.event ?? null,
  command: what.command ?? null,
  note: null,
  position_sd_m: undefined, // the band around the trace shows it
});

function mark_of(line: LogLine, at_s: number): Mark {
  const [tone, , text] = describe(line);
  return { key: line.key, at_s, kind: line.command ? 'command' : 'event', tone, text };
}

function kept_of(line: LogLine, at_us: number): Kept {
  const at_s = at_us / 1e6;
  return { at_s, mark: mark_of(line, at_s), line };
}
