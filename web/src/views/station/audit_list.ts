// The audit as it is read: newest first, older pages on demand, and what is new on top.

import { signal } from '@preact/signals';
import type { AuditEntry, AuditFilter, AuditPage } from './station_api';
import { refusal } from '../experiments/acts';
import { moment_text } from './moments';

type AskPage = (filter: AuditFilter, before: number | null) => Promise<AuditPage>;

const kMostPages = 20; // that one press looks through: a page with filters may be empty and yet have a next one

export class AuditList {
  readonly entries = signal<AuditEntry[]>([]);
  readonly head = signal<string | null>(null);
  readonly is_busy = signal(false);
  readonly is_known = signal(false); // something was answered
  readonly next = signal<number | null>(null); // null: there is nothing older
  readonly problem = signal('');
  private filter: AuditFilter = { actor: '', action: '', robot_id: '' };
  private turn = 0;

  constructor(private readonly ask: AskPage) {}

  async begin(filter: AuditFilter): Promise<void> {
    this.filter = filter;
    this.entries.value = [];
    this.next.value = null;
    this.is_known.value = false;
    await this.look(null);
  }

  older = async (): Promise<void> => {
    if (this.next.peek() !== null && !this.is_busy.peek()) await this.look(this.next.peek());
  };

  // What has come since. Where more came than a page holds, the list begins anew.
  async refresh(): Promise<void> {
    if (this.is_busy.peek() || !this.is_known.peek()) return;
    const turn = this.turn;
    try {
      const page = await this.ask(this.filter, null);
      if (turn !== this.turn) return;
      this.problem.value = '';
      this.head.value = page.head;
      const newest = this.entries.peek()[0]?.entry ?? 0;
      const fresh = page.entries.filter(({ entry }) => entry > newest);
      if (fresh.length === 0) return;
      const has_gap = fresh.length === page.entries.length && page.next !== null && newest > 0;
      this.entries.value = has_gap ? fresh : [...fresh, ...this.entries.peek()];
      if (has_gap || newest === 0) this.next.value = page.next;
    } catch (error) {
      if (turn === this.turn) this.problem.value = refusal(error);
    }
  }

  stop(): void {
    ++this.turn;
  }

  private async look(before: number | null): Promise<void> {
    const turn = ++this.turn;
    this.is_busy.value = true;
    try {
      for (let pages = 0, found = 0; pages < kMostPages && found === 0; ++pages) {
        const page = await this.ask(this.filter, before);
        if (turn !== this.turn) return;
        this.entries.value = [...this.entries.peek(), ...page.entries];
        if (before === null) this.head.value = page.head;
        this.next.value = before = page.next;
        this.is_known.value = true;
        this.problem.value = '';
        found = page.entries.length;
        if (before === null) break;
      }
    } catch (error) {
      if (turn === this.turn) this.problem.value = refusal(error);
    } finally {
      if (turn === this.turn) this.is_busy.value = false;
    }
  }
}

// The kinds of action, which the station takes as a filter (docs/database.md).
export const kKinds = [
  'command',
  'control',
  'account',
  'robot',
  'run',
  'experiment',
  'reservation',
  'design',
  'fluid',
  'request',
  'station',
  'store',
  'audit',
] as const;

// "command.verified" as "command verified"; what was refused or failed is set off.
export const action_text = (action: string) => action.replace('.', ' ').replaceAll('_', ' ');
export const kind_of = (action: string) => action.split('.')[0] ?? '';
export const act_of = (action: string) => action.slice(kind_of(action).length + 1).replaceAll('_', ' ');
export const is_refusal = (action: string) =>
  /\.(refused|rejected|failed|unknown|expired|sign_in_refused|forced|loss_noticed|left_out)$/.test(action);

// What else there is to say, in one line: "role viewer, expires at 2026-12-26 05:50".
export function detail_text(detail: unknown, is_utc: boolean): string {
  if (detail === null || typeof detail !== 'object') return '';
  return Object.entries(detail as Record<string, unknown>)
    .filter(([, value]) => value !== null && value !== '')
    .map(([name, value]) => member_text(name, value, is_utc))
    .filter((text) => text !== '')
    .join(', ');
}

const kFirstDay_us = 1e15; // 2001: what is less is a length of time

function member_text(name: string, value: unknown, is_utc: boolean): string {
  if (name.endsWith('_us') && typeof value === 'number' && value > kFirstDay_us)
    return `${name.slice(0, -3).replaceAll('_', ' ')} ${moment_text(value, is_utc)}`;
  // A member that has nothing in it says nothing.
  const text = typeof value === 'object' ? detail_text(value, is_utc) : String(value as string | number | boolean);
  return text === '' ? '' : `${name.replaceAll('_', ' ')} ${text}`;
}
