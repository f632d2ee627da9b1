// What the page knows, as signals. Samples go into rings at full rate; numerals follow at 10 Hz; nothing else is kept.
//
// One flow: /live message → Store.hear → rings and pending values → Store.refresh (10 Hz) → signals → views.

import { batch, computed, signal, type Signal } from '@preact/signals';
import type { CommandRecord, EventRecord, LiveMessage, RobotState, RunRecord, SamplesMessage } from './api';
import { SampleRing } from './samples';

export const kRefresh_ms = 100;
export const kStale_ms = 500; // no sample for so long: every numeral is marked
export const kLogLines = 50;

// What the numerals show; null: never heard.
export interface Readout {
  position_m: number | null;
  position_sd_m: number | null;
  setpoint_m: number | null;
  reference_m: number | null;
  duty: number | null;
  velocity_m_s: number | null;
  impedance_mv: number | null;
  disturbance_m: number;
  mode: string;
  sub_state: string;
  emergency_id: string | null;
  sample_age_ms: number;
  stale: boolean;
  received: number;
  missing: number; // samples that this page has not got, since it first heard this boot
}

export interface LogLine {
  key: string;
  at_ms: number;
  robot_id: string;
  event: EventRecord | null;
  command: CommandRecord | null;
  note: string | null; // of the page itself
}

const kEmptyReadout: Readout = {
  position_m: null,
  position_sd_m: null,
  setpoint_m: null,
  reference_m: null,
  duty: null,
  velocity_m_s: null,
  impedance_mv: null,
  disturbance_m: 0,
  mode: '',
  sub_state: '',
  emergency_id: null,
  sample_age_ms: Infinity,
  stale: true,
  received: 0,
  missing: 0,
};

// One robot: its state as the station told it last, and what its samples say.
export class Robot {
  readonly ring = new SampleRing();
  readonly state: Signal<RobotState>;
  readonly readout = signal<Readout>(kEmptyReadout);
  private latest: SamplesMessage | null = null;
  private sampled_at_ms = -Infinity;
  private watched = true; // its samples are asked for
  private boot_id: string | null = null;
  private first_seq = 0;
  private next_seq = 0;
  private received = 0;

  constructor(state: RobotState) {
    this.state = signal(state);
  }

  // What was not asked for is not missing afterwards.
  watch(watched: boolean): void {
    if (watched && !this.watched) this.boot_id = null;
    this.watched = watched;
  }

  hear(message: SamplesMessage, now_ms: number): void {
    const size = message.position_m.length;
    if (message.boot_id !== this.boot_id) {
      this.boot_id = message.boot_id;
      this.first_seq = this.next_seq = message.first_seq;
      this.received = 0;
    }
    const before = this.ring.received;
    this.ring.append(message, now_ms / 1000);
    if (message.first_seq >= this.first_seq) this.received += this.ring.received - before;
    if (message.first_seq + size <= this.next_seq) return; // sent again: history, not news
    this.next_seq = message.first_seq + size;
    this.latest = message;
    this.sampled_at_ms = now_ms;
  }

  refresh(now_ms: number): void {
    if (!this.watched) return this.refresh_from_state();
    const sample_age_ms = now_ms - this.sampled_at_ms;
    const stale = sample_age_ms > kStale_ms;
    const { latest } = this;
    const state = this.state.peek();
    const last = <T>(values: T[]): T | null => values[values.length - 1] ?? null;
    this.readout.value = {
      position_m: latest && last(latest.position_m),
      position_sd_m: latest && latest.position_sd_m,
      setpoint_m: latest ? latest.setpoint_m : null,
      reference_m: latest && last(latest.reference_m),
      duty: latest && last(latest.duty),
      velocity_m_s: latest && last(latest.velocity_m_s),
      impedance_mv: latest && last(latest.impedance_mv),
      disturbance_m: latest?.disturbance_m ?? 0,
      // What the station says of a robot that is silent is newer than its last sample.
      mode: latest && !stale ? latest.mode : state.mode,
      sub_state: latest && !stale ? latest.sub_state : state.sub_state,
      emergency_id: latest && !stale ? latest.emergency_id : state.emergency_id,
      sample_age_ms,
      stale,
      received: this.received,
      missing: this.next_seq - this.first_seq - this.received,
    };
  }

  // The station tells of its link, mode and emergency at once; numbers would be old.
  private refresh_from_state(): void {
    const { mode, sub_state, emergency_id, link } = this.state.peek();
    this.readout.value = { ...kEmptyReadout, mode, sub_state, emergency_id, stale: link !== 'connected' };
  }
}

export class Store {
  readonly robots = signal<Robot[]>([]);
  readonly actor = signal(''); // this page, as the station calls it
  readonly selected_id = signal<string | null>(null);
  readonly selected = computed(() => this.robots.value.find((r) => r.state.value.robot_id === this.selected_id.value) ?? null);
  readonly log = signal<LogLine[]>([]);
  readonly runs = signal<RunRecord[]>([]); // that are open, at most one for each robot
  readonly now_ms = signal(0); // page time, for ages
  private pending_log: LogLine[] = [];
  private notes = 0;
  private chosen = false; // a person selected a robot

  constructor(private readonly clocks: { page_ms(): number; utc_ms(): number }) {}

  hear(message: LiveMessage): void {
    switch (message.type) {
      case 'welcome':
        batch(() => {
          this.actor.value = message.actor;
          message.robots.forEach((state) => this.take_state(state));
        });
        break;
      case 'robot':
        this.take_state(message.robot);
        break;
      case 'samples':
        this.find(message.robot_id)?.hear(message, this.clocks.page_ms());
        break;
      case 'event':
        this.write(line_of_event(message.event));
        break;
      case 'command':
        this.write(line_of_command(message.command));
        break;
      case 'log':
        message.events.forEach((event) => this.write(line_of_event(event)));
        message.commands.forEach((command) => this.write(line_of_command(command)));
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
      case 'stamp':
        break;
    }
  }

  // A line of the page itself, for example about its connection.
  note(text: string): void {
    this.notes += 1;
    const at_ms = this.clocks.utc_ms();
    this.write({ key: `note-${this.notes}`, at_ms, robot_id: '', event: null, command: null, note: text });
  }

  set_runs(open: RunRecord[]): void {
    this.runs.value = open;
  }

  take_run(run: RunRecord): void {
    const others = this.runs.peek().filter((other) => other.run_id !== run.run_id);
    this.runs.value = run.ended_at_us === null ? [...others, run] : others;
  }

  refresh(): void {
    batch(() => {
      const now_ms = this.clocks.page_ms();
      this.now_ms.value = now_ms;
      for (const robot of this.robots.peek()) robot.refresh(now_ms);
      if (this.pending_log.length > 0) {
        this.log.value = merge_log(this.pending_log, this.log.peek());
        this.pending_log = [];
      }
    });
  }

  find(robot_id: string): Robot | undefined {
    return this.robots.peek().find((robot) => robot.state.peek().robot_id === robot_id);
  }

  private take_state(state: RobotState): void {
    const known = this.find(state.robot_id);
    if (known) {
      known.state.value = state;
      this.select_by_itself();
      return;
    }
    const robots = [...this.robots.peek(), new Robot(state)];
    this.robots.value = robots.sort((a, b) => a.state.peek().robot_id.localeCompare(b.state.peek().robot_id));
    this.select_by_itself();
  }

  // Of whose samples are asked for.
  watch(robot_ids: string[]): void {
    for (const robot of this.robots.peek()) robot.watch(robot_ids.includes(robot.state.peek().robot_id));
  }

  select(robot_id: string): void {
    this.chosen = true;
    this.selected_id.value = robot_id;
  }

  // Until a person chooses, the page shows a connected robot rather than one that is away.
  private select_by_itself(): void {
    const selected = this.selected.peek();
    if (this.chosen || selected?.state.peek().link === 'connected') return;
    const robots = this.robots.peek();
    const best = robots.find((robot) => robot.state.peek().link === 'connected') ?? selected ?? robots[0];
    this.selected_id.value = best?.state.peek().robot_id ?? null;
  }

  private write(line: LogLine): void {
    this.pending_log = this.pending_log.filter((other) => other.key !== line.key);
    this.pending_log.push(line);
    if (this.pending_log.length > kLogLines) this.pending_log.shift();
  }
}

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

function line_of_event(event: EventRecord): LogLine {
  const key = `event-${event.robot_id}-${event.boot_id ?? ''}-${event.event_seq ?? ''}-${event.received_at_us}`;
  return { key, at_ms: event.received_at_us / 1000, robot_id: event.robot_id, event, command: null, note: null };
}

function line_of_command(command: CommandRecord): LogLine {
  const at_ms = command.submitted_at_us / 1000;
  return { key: `command-${command.command_id}`, at_ms, robot_id: command.robot_id, event: null, command, note: null };
}
