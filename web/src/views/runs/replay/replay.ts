// One run as it is replayed: its clock, its samples around the moment, what the numerals show and what has happened so far.

import { batch, computed, signal } from '@preact/signals';
import type { CommandRecord, EventRecord } from '../../../api';
import { kNothingRead } from '../../../robot';
import type { LogLine } from '../../../store';
import type { Moment } from '../moments';
import type { Hole } from './losses';
import { Pages, type PageWays } from './pages';
import { readout_at } from './past_readout';
import { Player } from './player';
import { Reel, type Row, type Situation } from './reel';
import { Spreads } from './spreads';

const kReadout_ms = 100; // between two readings while it plays
const kShownLines = 60;
const kJustBefore_s = 0.3; // while it plays, "the one before" is not the one that has just passed

export interface Extent {
  first_us: number; // of the first sample
  last_us: number;
  period_us: number;
}

export interface Mark {
  at_s: number;
  tone: 'marker' | 'command' | 'event' | 'alarm' | 'gap';
  text: string;
}

export class Replay {
  readonly player: Player;
  readonly reel: Reel;
  readonly pages: Pages;
  readonly readout = signal(kNothingRead);
  readonly situation = signal<Situation | null>(null);
  readonly missing = signal<Hole | null>(null); // the moment lies in a gap
  readonly is_unknown = signal(true); // the samples of the moment have not come yet
  readonly lines = signal<readonly LogLine[]>([]); // that have happened, the newest first
  readonly marks = signal<readonly Mark[]>([]);
  readonly length_s = signal(0);
  shown_s = 60; // how much the plots show
  on_change: () => void = () => undefined; // the moment, or what is known of it, is another one
  private readonly spreads: Spreads;
  private all_lines: readonly LogLine[] = []; // the oldest first
  private read_at_ms = -Infinity;
  private pending_step: 1 | -1 | null = null;

  constructor(
    private extent: Extent,
    ways: PageWays,
    private readonly now_ms: () => number,
  ) {
    this.reel = new Reel(extent.first_us, extent.period_us);
    this.pages = new Pages(this.reel, ways, () => this.on_page());
    this.spreads = new Spreads(this.reel, ways, () => this.tell_lines());
    this.player = new Player((at_s) => this.seconds_of(this.pages.ready_to_us(this.utc_of(at_s))));
    this.extend(extent);
  }

  readonly at_us = computed(() => this.utc_of(this.player.at_s.value));

  utc_of(at_s: number): number {
    return Math.round(this.extent.first_us + at_s * 1e6);
  }
  seconds_of(utc_us: number): number {
    return (utc_us - this.extent.first_us) / 1e6;
  }

  // A run that is still being recorded becomes longer.
  extend(extent: Extent): void {
    this.extent = { ...extent, first_us: this.reel.origin_us };
    this.player.length_s = this.length_s.value = this.seconds_of(extent.last_us);
    this.look();
  }

  take_marks(marks: readonly Mark[]): void {
    this.marks.value = [...marks].sort((a, b) => a.at_s - b.at_s);
  }
  take_lines(lines: readonly LogLine[]): void {
    this.all_lines = [...lines].sort((a, b) => a.at_ms - b.at_ms);
    this.tell_lines();
  }

  tick(now_ms: number): void {
    const before_s = this.player.at_s.peek();
    this.player.tick(now_ms);
    if (this.player.at_s.peek() === before_s) return;
    this.look();
    this.on_change();
    if (now_ms - this.read_at_ms >= kReadout_ms || !this.player.is_playing.peek()) this.read();
  }

  seek(at_s: number): void {
    this.pending_step = null;
    this.player.seek(at_s);
    this.look();
    this.read();
    this.on_change();
  }

  toggle(): void {
    this.pending_step = null;
    this.player.toggle();
    this.read();
    this.on_change();
  }

  // To the sample after or before; over a gap to the next one that was recorded.
  step(by: 1 | -1): void {
    this.player.pause();
    const found = this.reel.next_to(this.at_us.peek(), by, this.extent.last_us + 1);
    this.pending_step = typeof found === 'number' ? by : null;
    if (typeof found === 'number') return this.pages.need(found);
    if (!found || found.utc_us > this.extent.last_us) return this.seek(by > 0 ? this.player.length_s : 0);
    this.seek(this.seconds_of(found.utc_us));
  }

  // To the mark after or before.
  jump(by: 1 | -1): void {
    const now_s = this.player.at_s.peek();
    const slack_s = this.player.is_playing.peek() ? kJustBefore_s * Math.max(1, this.player.speed.peek()) : 0;
    const marks = this.marks.peek();
    const next =
      by > 0
        ? marks.find(({ at_s }) => at_s > now_s + 1e-6)
        : [...marks].reverse().find(({ at_s }) => at_s < now_s - slack_s - 1e-6);
    this.seek(next?.at_s ?? (by > 0 ? this.player.length_s : 0));
  }

  close(): void {
    this.pages.close();
    this.spreads.close();
    this.player.pause();
  }

  look(): void {
    const { speed, is_playing } = this.player;
    const known_to_us = this.extent.last_us + this.extent.period_us;
    this.pages.look(this.at_us.peek(), is_playing.peek() ? speed.peek() : 1, this.shown_s, known_to_us);
    this.reel.show_until(this.at_us.peek());
  }

  private on_page(): void {
    if (this.pending_step !== null) this.step(this.pending_step);
    this.reel.show_until(this.at_us.peek());
    this.read();
    this.on_change();
  }

  private read(): void {
    this.read_at_ms = this.now_ms();
    batch(() => {
      const utc_us = this.at_us.peek();
      const row = this.reel.at(utc_us);
      const is_known = this.reel.page(this.reel.number_of(utc_us)) !== null;
      this.is_unknown.value = !is_known;
      this.readout.value = is_known ? readout_at(row, utc_us, this.reel.gap_s) : kNothingRead;
      this.situation.value = is_known ? (row?.situation ?? null) : null;
      const is_missing = is_known && this.readout.peek().stale;
      this.tell_hole(row, utc_us, is_missing);
      this.tell_lines();
    });
  }

  private tell_hole(before: Row | null, utc_us: number, is_missing: boolean): void {
    if (!is_missing) return void (this.missing.value = null);
    const after = this.reel.next_to(utc_us, 1, this.extent.last_us + 1);
    const hole = {
      since_s: before ? this.seconds_of(before.utc_us) : 0,
      until_s: after !== null && typeof after !== 'number' ? this.seconds_of(after.utc_us) : null,
      boot_id: before?.situation.boot_id ?? '',
      seq: before?.seq ?? -1,
    };
    const known = this.missing.peek();
    if (known?.since_s !== hole.since_s || known.until_s !== hole.until_s) this.missing.value = hole;
  }

  private tell_lines(): void {
    const now_ms = this.at_us.peek() / 1000;
    let end = this.all_lines.length;
    while (end > 0 && (this.all_lines[end - 1] as LogLine).at_ms > now_ms) --end;
    const had_happened = this.all_lines.slice(Math.max(0, end - kShownLines), end).reverse();
    const shown = this.spreads.of(had_happened).map((line) => line_at(line, this.at_us.peek()));
    const before = this.lines.peek();
    if (shown.length !== before.length || !shown.every((line, at) => is_same(line, before[at])))
      this.lines.value = shown;
  }
}

const is_same = (a: LogLine, b: LogLine | undefined) =>
  a.key === b?.key &&
  a.at_ms === b.at_ms &&
  a.command?.state === b.command?.state &&
  a.command?.further_renewals === b.command?.further_renewals &&
  a.position_sd_m === b.position_sd_m;

// A command as it stood at a moment: what became of it later is not known then.
export function line_at(line: LogLine, utc_us: number): LogLine {
  const { command } = line;
  if (!command) return line;
  const { submitted_at_us, ended_at_us, sent_after_us, acknowledged_after_us, verified_after_us } = command;
  const is_later = (after_us: number | null) => after_us !== null && submitted_at_us + after_us > utc_us;
  const stages = { sent_after_us, acknowledged_after_us, verified_after_us };
  const goes_on = (command.last_renewed_at_us ?? 0) > utc_us; // renewals that are counted from here
  if (!Object.values(stages).some(is_later) && (ended_at_us ?? 0) <= utc_us)
    return goes_on ? { ...line, command: { ...command, further_renewals: null, last_renewed_at_us: null } } : line;
  const reached = (after_us: number | null) => (is_later(after_us) ? null : after_us);
  const then = {
    sent_after_us: reached(sent_after_us),
    acknowledged_after_us: reached(acknowledged_after_us),
    verified_after_us: reached(verified_after_us),
  };
  const state =
    then.verified_after_us !== null
      ? 'verified'
      : then.acknowledged_after_us !== null
        ? 'acknowledged'
        : then.sent_after_us !== null
          ? 'sent'
          : 'queued';
  const uncounted = goes_on ? { further_renewals: 0, last_renewed_at_us: null } : {};
  return { ...line, command: { ...command, ...then, ...uncounted, state, reason: '' } };
}

// Events at their time on the robot's clock where it is known, commands when they were submitted.
export function lines_of(
  events: readonly EventRecord[],
  commands: readonly CommandRecord[],
  moments: readonly Moment[],
  { first_us, last_us }: Extent,
): LogLine[] {
  const known_us = new Map(moments.map(({ key, utc_us }) => [key, utc_us]));
  const line = (key: string, robot_id: string, utc_us: number, what: Partial<LogLine>): LogLine => ({
    key,
    at_ms: utc_us / 1000,
    robot_id,
    event: null,
    command: null,
    note: null,
    position_sd_m: undefined,
    ...what,
  });
  const of_events = events.map((event) => {
    const utc_us = known_us.get(`e${event.boot_id}-${event.event_seq}`) ?? event.received_at_us;
    const key = `event-${event.boot_id}-${event.event_seq}-${event.received_at_us}`;
    return line(key, event.robot_id, utc_us, { event });
  });
  const of_commands = commands.map((command) =>
    line(`command-${command.command_id}`, command.robot_id, command.submitted_at_us, { command }),
  );
  return [...of_events, ...of_commands].filter(({ at_ms }) => at_ms * 1000 >= first_us && at_ms * 1000 <= last_us);
}

export function marks_of(moments: readonly Moment[], gaps_s: readonly [number, number][], extent: Extent): Mark[] {
  const at_s = (utc_us: number) => (utc_us - extent.first_us) / 1e6;
  const length_s = at_s(extent.last_us);
  const of_moments = moments.map(({ utc_us, kind, text }): Mark => ({ at_s: at_s(utc_us), tone: kind, text }));
  const of_gaps = gaps_s.map(([from_s, to_s]): Mark => ({
    at_s: from_s,
    tone: 'gap',
    text: `${(to_s - from_s).toFixed(2)} s without samples`,
  }));
  return [...of_moments, ...of_gaps].filter((mark) => mark.at_s >= 0 && mark.at_s <= length_s);
}
