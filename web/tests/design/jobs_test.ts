// A question that the station answers by a job: progress, the end, a newer question, a cancel, and a lost connection.
import { expect, test } from 'vitest';
import { ApiError } from '../../src/api';
import { Question, type Job, type JobBody, type JobsApi } from '../../src/views/design/jobs';
import { settle } from '../fakes';

const kBody: JobBody = { kind: 'tune', crossover_rad_s: 3, phase_margin_deg: 90 };
const job = (job_id: number, change: Partial<Job> = {}): Job => ({
  job_id,
  kind: 'tune',
  state: 'running',
  owner: '',
  request: {} as never,
  created_at_us: 0,
  started_at_us: 1e6,
  ended_at_us: null,
  error: null,
  cancelling: false,
  progress: null,
  ...change,
});

// A station that answers when it is told to.
class FakeStation implements JobsApi {
  begun: JobBody[] = [];
  looked: number[] = [];
  cancelled: number[] = [];
  private answers: ((said: Job | Error) => void)[] = [];
  private ask = () =>
    new Promise<Job>((resolve, reject) => {
      this.answers.push((said) => (said instanceof Error ? reject(said) : resolve(said)));
    });
  begin = (body: JobBody) => {
    this.begun.push(body);
    return this.ask();
  };
  look = (job_id: number) => {
    this.looked.push(job_id);
    return this.ask();
  };
  cancel = (job_id: number) => {
    this.cancelled.push(job_id);
    return Promise.resolve();
  };
  wait = () => Promise.resolve();
  async say(said: Job | Error) {
    this.answers.shift()!(said);
    await settle();
  }
}

function asked() {
  const station = new FakeStation();
  const question = new Question<{ kp: number }>(station);
  question.ask('a', kBody);
  return { station, question, now: () => question.answer.value };
}
const done = { state: 'done', ended_at_us: 3.1e6, result: { kp: 30 } } as const;

test('progress is shown, then the result and how long it took', async () => {
  const { station, now } = asked();
  expect(now()).toMatchObject({ phase: 'asking', key: 'a', result: null });
  await station.say(job(1, { state: 'waiting' }));
  expect(now().phase).toBe('waiting');
  await station.say(job(1, { progress: { share: 0.4, stage: 'fractional: start 2 of 5' } }));
  expect(now()).toMatchObject({ phase: 'running', share: 0.4, stage: 'fractional: start 2 of 5' });
  await station.say(job(1, done));
  expect(now()).toMatchObject({ phase: 'done', job_id: 1, result: { kp: 30 }, took_s: 2.1 });
  expect(station.looked).toEqual([1, 1]);
});

test('the same question is asked once; another one cancels it and takes its place', async () => {
  const { station, question, now } = asked();
  await station.say(job(1));
  question.ask('a', kBody);
  expect(station.begun).toHaveLength(1);
  question.ask('b', kBody);
  expect(station.cancelled).toEqual([1]);
  await station.say(job(1, done)); // the late answer to the first one
  expect(now()).toMatchObject({ key: 'b', phase: 'asking', result: null });
  await station.say(job(2, done));
  expect(now()).toMatchObject({ key: 'b', job_id: 2, phase: 'done' });
});

test('a job that begins after a newer question was asked is cancelled', async () => {
  const { station, question } = asked();
  question.ask('b', kBody);
  await station.say(job(1, { state: 'waiting' }));
  expect(station.cancelled).toEqual([1]);
});

test('a person cancels it, also before it has begun, and may ask again', async () => {
  const { station, question, now } = asked();
  question.cancel();
  expect(now().phase).toBe('cancelled');
  await station.say(job(1));
  expect(station.cancelled).toEqual([1]);
  question.ask('a', kBody);
  await station.say(job(2));
  question.cancel();
  expect(station.cancelled).toEqual([1, 2]);
  await station.say(job(2, { state: 'cancelled' }));
  expect(now().phase).toBe('cancelled');
});

test('a lost connection ends nothing: it is looked for again', async () => {
  const { station, now } = asked();
  await station.say(job(1));
  await station.say(new ApiError('The station did not answer.', 0));
  expect(now().phase).toBe('running');
  await station.say(job(1, done));
  expect(now().phase).toBe('done');
});

test('refusals and failures are in the station’s words', async () => {
  const refused = asked();
  await refused.station.say(new ApiError('refused', 503, 'too_many_jobs', '20 jobs wait'));
  expect(refused.now()).toMatchObject({ phase: 'failed', error: '20 jobs wait' });
  const failed = asked();
  await failed.station.say(job(1));
  await failed.station.say(job(1, { state: 'failed', error: 'run 3 has gaps', ended_at_us: 2e6 }));
  expect(failed.now()).toMatchObject({ phase: 'failed', error: 'run 3 has gaps', result: null });
  const stopped = asked();
  await stopped.station.say(job(1, { state: 'interrupted' }));
  expect(stopped.now().error).toMatch(/Ask again/);
});

test('a link opens a job that exists', async () => {
  const station = new FakeStation();
  const question = new Question(station);
  question.open('job 7', 7);
  question.open('job 7', 7);
  expect(station.looked).toEqual([7]);
  await station.say(job(7, done));
  expect(question.answer.value).toMatchObject({ phase: 'done', job_id: 7 });
  question.forget();
  expect(question.answer.value).toMatchObject({ phase: 'idle', result: null, job_id: null });
});

test('an answer is one to its own question alone', async () => {
  const { station, question } = asked();
  await station.say(job(1, done));
  expect(question.answer_to('a')?.result).toEqual({ kp: 30 });
  expect(question.answer_to('b')).toBeNull();
  expect(question.answer_to(undefined)).toBeNull();
});
