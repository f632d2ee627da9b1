// The commands of one robot, of each its newest record: what the station has listed, and what /live has reported since.

import { signal } from '@preact/signals';
import type { CommandRecord } from '../api';

const kMost = 1000; // of older ones the list is not kept

export class NewestCommands {
  readonly list = signal<readonly CommandRecord[] | null>(null); // newest first; null: not read yet
  private known = new Map<string, CommandRecord>();
  private readonly reported = new Set<string>(); // since the list was asked for

  constructor(private readonly robot_id: string) {}

  // Before each request.
  ask(): void {
    this.reported.clear();
  }

  // What has been reported since the request is newer than the answer.
  take_answer(commands: readonly CommandRecord[]): void {
    for (const command of commands)
      if (!this.reported.has(command.command_id)) this.known.set(command.command_id, command);
    this.show();
  }

  // Of any robot. Renewals of a lease are left out: there are ten a second while a motor runs. The station lists them as
  // one once they have ended.
  report = (command: CommandRecord): void => {
    if (command.robot_id !== this.robot_id || command.kind === 'renew_lease') return;
    this.reported.add(command.command_id);
    this.known.set(command.command_id, command);
    if (this.list.peek() !== null) this.show();
  };

  private show(): void {
    const newest = [...this.known.values()].sort((a, b) => b.submitted_at_us - a.submitted_at_us).slice(0, kMost);
    this.known = new Map(newest.map((command) => [command.command_id, command]));
    this.list.value = newest;
  }
}
