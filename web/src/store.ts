// What the page knows, as signals. Samples go into rings at full rate; numerals follow at 10 Hz; nothing else is kept.
//
// One flow: /live message → Store.receive → rings and pending values → Store.refresh (10 Hz) → signals → views.

import { batch, computed, signal } from '@preact/signals';
import type { CommandRecord, EventRecord, LiveMessage, RobotState, RunRecord } from './api';
import { natural_order } from './fleet';
import { Latches } from './latches';
import { ExperimentsStore } from './experiments_store';
import { Robot } from './robot';
import type { StopEvidence } from './stop_outcome';

export const kRefresh_ms = 100;
export const kLogLines = 50;

export interface LogLine {
  key: string;
  at_ms: number;
  robot_id: string;
  event: EventRecord | null;
  command: CommandRecord | null;
  note: string | null; // of the page itself
  position_sd_m: number | null | undefined; // of the position in an event; null: not known; undefined: not looked up
}

export class Store {
  readonly robots = signal<Robot[]>([]);
  readonly actor = signal(''); // who looks at this page, as the station calls them
  readonly client = signal(''); // and this tab
  utc_minus_steady_us: number | null = null; // of the station's clocks; null before its first message
  readonly selected_id = signal<string | null>(null);
  readonly selected = computed(() => {
    void this.robots.value;
    return this.by_id.get(this.selected_id.value ?? '') ?? null;
  });
  readonly log = signal<LogLine[]>([]);
  // The page receives from the station. While it does not, it does not know who is in control, nor whether a run is open.
  readonly is_current = signal(false);
  readonly runs = signal<RunRecord[]>([]); // that are open, at most one for each robot
  readonly are_runs_known = signal(false); // since the station listed them
  readonly interrupted = signal<RunRecord[]>([]); // of each robot its newest run, if the station stopped in it
  private run_reports = 0; // so far
  private readonly runs_reported = new Map<number, number>(); // of each run: the number of its latest report
  readonly latches = new Latches();
  readonly command_listeners = new Set<(command: CommandRecord) => void>(); // called with each record that comes
  readonly now_ms = signal(0); // page time, for ages
  readonly experiments = new ExperimentsStore();
  private readonly by_id = new Map<string, Robot>();
  private pending_log: LogLine[] = [];
  private notes = 0;
  // The selection stays: by a person, or because what is selected was there.
  readonly is_chosen = signal(false);
  private wanted_id = ''; // by the address of the page

  constructor(private readonly clocks: { page_ms(): number; utc_ms(): number }) {}

  // The robots that the user of this page controls.
  controlled(): string[] {
    const is_ours = (robot: Robot) => robot.state.peek().control?.holder === this.actor.peek();
    const ours = this.robots.peek().filter(is_ours);
    return ours.map(({ robot_id }) => robot_id);
  }

  receive(message: LiveMessage): void {
    switch (message.type) {
      case 'welcome':
        batch(() => {
          this.actor.value = message.actor;
          this.client.value = message.client ?? '';
          this.take_states(message.robots, false);
          this.utc_minus_steady_us = message.utc_us - message.stamp_us;
        });
        break;
      case 'robot':
        this.take_states([message.robot]);
        break;
      case 'samples':
        this.find(message.robot_id)?.receive(message, this.clocks.page_ms());
        break;
      case 'event':
        this.take_event(message.event);
        break;
      case 'command':
        this.take_command(message.command);
        break;
      case 'log':
        message.events.forEach((event) => this.take_event(event));
        message.commands.forEach((command) => this.take_command(command));
        break;
      case 'run':
        this.take_run(message.run);
        break;
      case 'dropped':
        this.note(`This page was too slow: the station left out ${message.count} messages.`);
        break;
      case 'problem':
        this.note(`The station refused a message of this page: ${message.problem.detail}`);
        break;
      case 'experiment':
        this.experiments.take(message.experiment);
        break;
      case 'stamp':
      case 'echo':
        break;
    }
  }

  // A line of the page itself, for example about its connection.
  note(text: string): void {
    this.notes += 1;
    const at_ms = this.clocks.utc_ms();
    this.write({
      key: `note-${this.notes}`,
      at_ms,
      robot_id: '',
      event: null,
      command: null,
      note: text,
      position_sd_m: null,
    });
  }

  // To be had before runs are asked for, and given back with the answer: what was reported since is newer than the answer.
  mark(): number {
    return this.run_reports;
  }

  // All that are open, as the station has listed them.
  set_runs(open: RunRecord[], asked_at = this.mark()): void {
    const is_newer = ({ run_id }: RunRecord) => (this.runs_reported.get(run_id) ?? 0) > asked_at;
    this.are_runs_known.value = true;
    this.runs.value = [...open.filter((run) => !is_newer(run)), ...this.runs.peek().filter(is_newer)];
  }

  // Cut off: what is open is asked for anew.
  forget_runs(): void {
    this.are_runs_known.value = false;
    this.runs.value = [];
  }

  take_run_answer(run: RunRecord, asked_at: number): void {
    if ((this.runs_reported.get(run.run_id) ?? 0) <= asked_at) this.keep_run(run);
  }

  take_run(run: RunRecord): void {
    this.run_reports += 1;
    this.runs_reported.set(run.run_id, this.run_reports);
    this.keep_run(run);
  }

  private keep_run(run: RunRecord): void {
    const others = this.runs.peek().filter((other) => other.run_id !== run.run_id);
    this.runs.value = run.ended_at_us === null ? [...others, run] : others;
    this.take_interruption(run);
  }

  // A run that the station's end has cut off stays known until its robot has a newer one.
  private take_interruption(run: RunRecord): void {
    const known = this.interrupted.peek().find((other) => other.robot_id === run.robot_id);
    if (known && known.run_id >= run.run_id) return;
    const others = this.interrupted.peek().filter((other) => other !== known);
    if (run.state === 'interrupted') {
      this.interrupted.value = [...others, run];
      this.note(`The run “${run.name}” of ${run.robot_id} was interrupted: the station stopped while it was open.`);
    } else if (known) {
      this.interrupted.value = others;
    }
  }

  refresh(): void {
    batch(() => {
      const now_ms = this.clocks.page_ms();
      this.now_ms.value = now_ms;
      for (const robot of this.robots.peek()) robot.refresh(now_ms, this.is_current.peek());
      this.show_pending();
    });
  }

  private show_pending(): void {
    if (this.pending_log.length === 0) return;
    this.log.value = merge_log(this.pending_log, this.log.peek());
    this.pending_log = [];
  }

  // To be had before the past is asked for, and given back with the answer: lines that have changed since are newer.
  mark_log(): ReadonlySet<LogLine> {
    this.show_pending();
    return new Set(this.log.peek());
  }

  // What the station has listed of before this page was there, or of while it was cut off.
  take_past(events: EventRecord[], commands: CommandRecord[], asked_at: ReadonlySet<LogLine>): void {
    this.show_pending();
    for (const event of events) this.date_latch_of(event);
    const lines = new Map(this.log.peek().map((line) => [line.key, line]));
    for (const line of [...events.map((event) => this.line_of_event(event)), ...commands.map(line_of_command)]) {
      const shown = lines.get(line.key);
      // Of an event nothing changes, and the line that is shown may know its ±.
      const is_newer = shown === undefined || (line.command !== null && asked_at.has(shown));
      if (is_newer && !is_routine(line)) lines.set(line.key, line);
    }
    this.log.value = [...lines.values()].sort((a, b) => b.at_ms - a.at_ms).slice(0, kLogLines);
  }

  find(robot_id: string): Robot | undefined {
    return this.by_id.get(robot_id);
  }

  // is_news: the page was there before; a latch that it saw begin is one that the robot had not in the state before.
  private take_states(states: RobotState[], is_news = true): void {
    const now_ms = this.clocks.page_ms();
    for (const { robot_id, emergency_id } of states) {
      const before = this.by_id.get(robot_id)?.emergency_id.peek();
      const saw_begin = is_news && before !== undefined && before !== emergency_id;
      this.latches.note(emergency_id, this.clocks.utc_ms(), saw_begin);
    }
    const known_before = this.by_id.size;
    for (const state of states) {
      const known = this.by_id.get(state.robot_id);
      if (known) known.take(state, now_ms);
      else this.by_id.set(state.robot_id, new Robot(state, now_ms));
    }
    if (this.by_id.size > known_before) {
      const ordered = [...this.by_id].sort(([a], [b]) => natural_order(a, b));
      this.robots.value = ordered.map(([, robot]) => robot);
    }
    this.select_by_itself();
  }

  // Of a stop of one robot or of every robot that the station stops: a retired one that is away is left out there.
  stop_evidence(robot_id: string | null, since_ms: number): StopEvidence {
    const found: StopEvidence = { latched: 0, cleared: 0, kept: 0, open: 0 };
    for (const robot of this.robots.peek()) {
      if (robot_id === null ? robot.is_left_out.peek() : robot.robot_id !== robot_id) continue;
      found[robot.stop_evidence(since_ms)] += 1;
    }
    return found;
  }

  // Of whose samples are asked for.
  watch(robot_ids: string[]): void {
    for (const robot of this.robots.peek()) robot.watch(robot_ids.includes(robot.state.peek().robot_id));
  }

  select(robot_id: string): void {
    batch(() => {
      this.is_chosen.value = true;
      this.selected_id.value = robot_id;
    });
  }

  // A robot that may not be known yet. SAFETY: it is selected at once, or while nothing else is: when it appears later, the
  // stop button keeps the name that somebody may be about to press.
  want(robot_id: string): void {
    if (this.by_id.has(robot_id)) this.select(robot_id);
    else this.wanted_id = robot_id;
  }

  // A command to the robot that is selected is a choice of it.
  keep_selected(): void {
    if (this.selected_id.peek() !== null) this.is_chosen.value = true;
  }

  // Until a person chooses, the page shows a connected robot rather than one that was never there.
  // SAFETY: one that was connected stays selected when its link breaks: Escape is meant for it, not for another one.
  private select_by_itself(): void {
    if (this.is_chosen.peek()) return;
    if (this.by_id.has(this.wanted_id)) return this.select(this.wanted_id);
    const robots = this.robots.peek();
    const best = robots.find((robot) => !robot.is_away.peek()) ?? this.selected.peek() ?? robots[0];
    this.selected_id.value = best?.robot_id ?? null;
    this.is_chosen.value = best !== undefined && !best.is_away.peek();
  }

  private take_event(event: EventRecord): void {
    this.date_latch_of(event);
    this.write(this.line_of_event(event));
  }

  private date_latch_of({ kind, emergency_id, received_at_us }: EventRecord): void {
    if (kind === 'emergency') this.latches.note(emergency_id, received_at_us / 1000, true);
  }

  private take_command(command: CommandRecord): void {
    for (const listen of this.command_listeners) listen(command);
    this.write(line_of_command(command));
  }

  private line_of_event(event: EventRecord): LogLine {
    const key = `event-${event.robot_id}-${event.boot_id ?? ''}-${event.event_seq ?? ''}-${event.received_at_us}`;
    const { kind, boot_id, robot_time_us } = event;
    const heard_sd_m = this.find(event.robot_id)?.position_sd_m_at(boot_id, robot_time_us) ?? null;
    const position_sd_m = kind === 'position_zeroed' ? null : heard_sd_m; // that was of the place before
    return {
      key,
      at_ms: event.received_at_us / 1000,
      robot_id: event.robot_id,
      event,
      command: null,
      note: null,
      position_sd_m,
    };
  }

  private write(line: LogLine): void {
    if (is_routine(line)) return;
    this.pending_log = this.pending_log.filter((other) => other.key !== line.key);
    this.pending_log.push(line);
    if (this.pending_log.length > kLogLines) this.pending_log.shift();
  }
}

// A held duty renews its lease several times a second; of these commands only one that failed is worth a line.
const is_routine = ({ command }: LogLine) =>
  command?.kind === 'renew_lease' && !['rejected', 'expired', 'failed'].includes(command.state);

// Newest first; a command that went on replaces its own line in place; at most kLogLines.
function merge_log(pending: LogLine[], log: LogLine[]): LogLine[] {
  const changed = new Map(pending.map((line) => [line.key, line]));
  const kept = log.map((line) => {
    const newer = changed.get(line.key);
    changed.delete(line.key);
    return newer ?? line;
  });
  return [...[...changed.values()].reverse(), ...kept].slice(0, kLogLines);
}

function line_of_command(command: CommandRecord): LogLine {
  const at_ms = command.submitted_at_us / 1000;
  return {
    key: `command-${command.command_id}`,
    at_ms,
    robot_id: command.robot_id,
    event: null,
    command,
    note: null,
    position_sd_m: null,
  };
}
