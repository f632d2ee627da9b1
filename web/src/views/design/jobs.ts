// One question that the station answers by a job: its progress, its end, and that a newer question replaces it.

import { signal } from '@preact/signals';
import { ApiError } from '../../api';
import type { components } from '../../api_types';

export type Job = components['schemas']['Job'] & { result?: unknown }; // once it is done
export type JobBody = components['schemas']['JobBody'];

export type Phase = 'idle' | 'asking' | 'waiting' | 'running' | 'done' | 'failed' | 'cancelled';

export interface Answer<Result> {
  phase: Phase;
  key: string; // of the question
  job_id: number | null;
  share: number; // of the work that is done
  stage: string;
  took_s: number | null;
  result: Result | null; // of this question
  error: string;
}

export interface JobsApi {
  begin(body: JobBody): Promise<Job>;
  look(job_id: number, wait_ms: number): Promise<Job>;
  cancel(job_id: number): Promise<unknown>;
  wait(time_ms: number): Promise<void>;
}

const kLook_ms = 400; // how long the station may keep an answer back
const kAgain_ms = 1000; // after a look that failed
const kIdle = { phase: 'idle', key: '', job_id: null, share: 0, stage: '', took_s: null, error: '' } as const;

export class Question<Result> {
  readonly answer = signal<Answer<Result>>({ ...kIdle, result: null });
  private number = 0; // of the newest question

  constructor(private readonly api: JobsApi) {}

  // What was answered to this question; null: another one was asked last.
  answer_to(key: string | undefined): Answer<Result> | null {
    const answer = this.answer.value;
    return key !== undefined && answer.key === key ? answer : null;
  }

  // Nothing is asked twice: the same question keeps its answer, unless it failed.
  ask(key: string, body: JobBody): void {
    const { key: asked, phase } = this.answer.peek();
    if (key === asked && phase !== 'failed' && phase !== 'cancelled') return;
    void this.follow(key, () => this.api.begin(body));
  }

  // A job that exists, from a link.
  open(key: string, job_id: number): void {
    if (key === this.answer.peek().key) return;
    void this.follow(key, () => this.api.look(job_id, 0));
  }

  // A person does not want it any more; what is not begun yet is cancelled when it is.
  cancel(): void {
    this.end_old();
    this.number += 1;
    const now = this.answer.peek();
    if (is_at_work(now.phase)) this.answer.value = { ...now, phase: 'cancelled', error: '' };
  }

  forget(): void {
    this.cancel();
    this.answer.value = { ...kIdle, result: null };
  }

  private end_old(): void {
    const { phase, job_id } = this.answer.peek();
    if (job_id !== null && is_at_work(phase)) void this.api.cancel(job_id).catch(() => undefined);
  }

  private async follow(key: string, begin: () => Promise<Job>): Promise<void> {
    this.end_old();
    const number = ++this.number;
    this.answer.value = { ...kIdle, phase: 'asking', key, result: null };
    let job: Job;
    try {
      job = await begin();
    } catch (error) {
      if (number === this.number) this.fail(error);
      return;
    }
    if (number !== this.number) {
      if (is_at_work(job.state as Phase)) void this.api.cancel(job.job_id).catch(() => undefined);
      return;
    }
    while (this.take(key, job)) {
      const next = await this.api.look(job.job_id, kLook_ms).catch((error: unknown) => error);
      if (number !== this.number) return;
      // Without an answer the job goes on at the station; it is looked for again.
      if (next instanceof ApiError && next.status === 0) await this.api.wait(kAgain_ms);
      else if (next instanceof Error) return this.fail(next);
      else job = next as Job;
      if (number !== this.number) return;
    }
  }

  // False when it has ended.
  private take(key: string, job: Job): boolean {
    const { state, progress, job_id, result, error, started_at_us, ended_at_us } = job;
    const phase: Phase = state === 'interrupted' ? 'failed' : state;
    this.answer.value = {
      phase,
      key,
      job_id,
      share: progress?.share ?? (phase === 'done' ? 1 : 0),
      stage: progress?.stage ?? '',
      took_s: started_at_us !== null && ended_at_us !== null ? (ended_at_us - started_at_us) / 1e6 : null,
      result: phase === 'done' ? ((result ?? null) as Result | null) : null,
      error: state === 'interrupted' ? 'The station stopped before it had ended. Ask again.' : (error ?? ''),
    };
    return is_at_work(phase);
  }

  private fail(error: unknown): void {
    const said = error instanceof ApiError ? error.detail || error.message : String(error);
    this.answer.value = { ...this.answer.peek(), phase: 'failed', error: said };
  }
}

export const is_at_work = (phase: Phase) => phase === 'asking' || phase === 'waiting' || phase === 'running';
