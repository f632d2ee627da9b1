// Looks for runs, newest first, page after page, until there is a screen of them or no run is left.

import { batch, signal } from '@preact/signals';
import { looks_here, matches, type Filter } from './filter';
import type { AskedRuns, Run } from './runs_api';

const kPage = 100;
const kSearchedPage = 500; // where this page looks for itself
export const kScreen = 100; // rows that one call of more() adds at least, if there are that many

export class RunSearch {
  readonly found = signal<Run[]>([]);
  readonly looked_through = signal(0);
  readonly is_done = signal(false); // no run is left
  readonly is_busy = signal(false);
  readonly problem = signal('');
  private filter: Filter | null = null;
  private before: number | null = null;
  private turn = 0; // of the search; what an earlier one finds is dropped
  private cancel = new AbortController();

  constructor(private readonly read_page: (asked: AskedRuns, signal: AbortSignal) => Promise<Run[]>) {}

  // `keeps`: what is listed stays until the new list is there, which then is as long at least.
  async begin(filter: Filter, keeps = false): Promise<void> {
    const least = keeps ? Math.max(kScreen, this.found.peek().length) : kScreen;
    this.cancel.abort();
    this.cancel = new AbortController();
    this.filter = filter;
    this.before = null;
    this.turn += 1;
    if (!keeps) batch(() => ((this.found.value = []), (this.looked_through.value = 0), (this.is_done.value = false)));
    await this.look([], 0, least);
  }

  async more(): Promise<void> {
    if (this.is_busy.peek() || this.is_done.peek() || !this.filter) return;
    await this.look(this.found.peek(), this.looked_through.peek(), kScreen);
  }

  stop(): void {
    this.turn += 1;
    this.cancel.abort();
  }

  private async look(known: Run[], looked_through: number, least: number): Promise<void> {
    const { turn, filter, cancel } = this;
    if (!filter) return;
    const limit = looks_here(filter) ? kSearchedPage : kPage;
    const enough = known.length + least;
    let [found, is_done] = [known, false];
    batch(() => ((this.is_busy.value = true), (this.problem.value = '')));
    try {
      while (found.length < enough && !is_done) {
        const asked = { robot_id: filter.robot_id, state: filter.state, before: this.before, limit };
        const page = await this.read_page(asked, cancel.signal);
        if (turn !== this.turn) return;
        this.before = page.at(-1)?.run_id ?? this.before;
        is_done = page.length < limit;
        looked_through += page.length;
        found = [...found, ...page.filter((run) => matches(run, filter))];
        const [shown, through] = [found, looked_through];
        batch(() => ((this.found.value = shown), (this.looked_through.value = through)));
      }
      this.is_done.value = is_done;
    } catch (error) {
      if (turn === this.turn) this.problem.value = error instanceof Error ? error.message : String(error);
    } finally {
      if (turn === this.turn) this.is_busy.value = false;
    }
  }
}
