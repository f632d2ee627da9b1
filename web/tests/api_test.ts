// Requests to the station, and its refusals as sentences.
import { expect, test, vi } from 'vitest';
import { Api, ApiError } from '../src/api';

function api_that_answers(status: number, body: unknown) {
  const asked: { path: string; options: RequestInit }[] = [];
  const api = new Api((path, options) => {
    asked.push({ path, options });
    return Promise.resolve(new Response(body === null ? 'not JSON' : JSON.stringify(body), { status }));
  });
  return { api, asked };
}

const failure = (promise: Promise<unknown>) =>
  promise.then(
    () => expect.unreachable(),
    (error: unknown) => error as ApiError,
  );

test('a command is a POST of JSON with SI units', async () => {
  const { api, asked } = api_that_answers(200, { state: 'acknowledged' });
  await api.set_auto('rheo-1', 0.1);
  expect(asked[0]?.path).toBe('/api/v1/robots/rheo-1/commands');
  expect(asked[0]?.options.method).toBe('POST');
  expect(JSON.parse(String(asked[0]?.options.body))).toEqual({ kind: 'set_mode', mode: 'auto', setpoint_m: 0.1 });
});

test('the commands of a robot are asked for without single renewals, which would fill the list', async () => {
  const { api, asked } = api_that_answers(200, { commands: [] });
  await api.robot_commands('rheo-1');
  expect(asked[0]?.path).toBe('/api/v1/robots/rheo-1/commands?limit=1000&renewals=counted');
});

test('a known refusal is said in the words of the operator', async () => {
  const { api } = api_that_answers(409, { title: 'Conflict', status: 409, detail: 'latch 5', reason: 'latched' });
  const error = await failure(api.set_duty('rheo-1', 0.3));
  expect(error.message).toBe('The emergency stop is latched. Clear it first.');
  expect(error).toMatchObject({ status: 409, reason: 'latched', detail: 'latch 5' });
});

test('an unknown refusal is said in the words of the station', async () => {
  const { api } = api_that_answers(422, { title: 'Unprocessable', detail: 'the tide is out', reason: 'new_one' });
  expect((await failure(api.set_setpoint('rheo-1', 4))).message).toBe('the tide is out');
});

test('only a sign-in that has to wait says that there were too many attempts', async () => {
  const throttled = api_that_answers(429, { detail: 'wait', reason: 'throttled' }).api;
  expect((await failure(throttled.log_in('a', 'b'))).message).toMatch(/^Too many attempts/);
  const busy = api_that_answers(429, { detail: 'your address has as many connections', reason: 'too_many_pages' }).api;
  expect((await failure(busy.set_manual('rheo-1'))).message).toBe('your address has as many connections');
});

test('what moves a robot is waited for 6 s, and a change that moves nothing for 30 s', async () => {
  const patience = vi.spyOn(AbortSignal, 'timeout');
  const { api } = api_that_answers(200, {});
  await api.set_manual('rheo-1');
  await api.emergency_stop('rheo-1', 'a key').catch(() => undefined);
  await api.log_in('a', 'b');
  await api.change('/users', { name: 'a' });
  expect(patience.mock.calls).toEqual([[6000], [6000], [30_000], [30_000]]);
  patience.mockRestore();
});

test('an answer that is no JSON is an error with its status', async () => {
  const { api } = api_that_answers(502, null);
  expect((await failure(api.set_manual('rheo-1'))).message).toContain('502');
});

test('no answer at all is said', async () => {
  const api = new Api(() => Promise.reject(new TypeError('fetch failed')));
  expect((await failure(api.set_manual('rheo-1'))).message).toBe('The station did not answer.');
});

test('only 401 means signed out', async () => {
  expect(await api_that_answers(401, {}).api.is_signed_out()).toBe(true);
  expect(await api_that_answers(500, {}).api.is_signed_out()).toBe(false);
});

test('ids of 64 bits pass through unrounded', async () => {
  const { api, asked } = api_that_answers(200, { state: 'acknowledged' });
  await api.clear_emergency('rheo-1', '18446744073709551615');
  expect(String(asked[0]?.options.body)).toContain('"18446744073709551615"');
});

test('a refused setpoint names the range that is allowed, in millimetres', async () => {
  const detail = 'setpoint_m = 99.999 is outside -1 to 1';
  const { api } = api_that_answers(422, { title: 'Unprocessable', detail, reason: 'out_of_range' });
  expect((await failure(api.set_setpoint('rheo-1', 99.999))).message).toBe('Allowed is \u22121000 to 1000 mm.');
});

test('a command says the latest stamp that its operator has seen, and is not sent without one', async () => {
  const sent: [string, unknown][] = [];
  let stamp_us: number | null = 5484590256;
  const api = new Api(
    (path, options) => {
      sent.push([path, options.body ? JSON.parse(String(options.body)) : null]);
      return Promise.resolve(new Response('{"state":"acknowledged"}'));
    },
    () => stamp_us,
  );
  await api.set_duty('rheo-1', 0.5);
  expect(sent).toEqual([['/api/v1/robots/rheo-1/commands', { kind: 'set_duty', duty: 0.5, stamp_us: 5484590256 }]]);
  await api.change_control('rheo-1', { action: 'take' });
  await api.change_control('rheo-1', { action: 'release' });
  expect(sent.splice(1).map(([, body]) => body)).toEqual([{ action: 'take', stamp_us }, { action: 'release' }]);
  stamp_us = null; // the live link is down
  expect((await failure(api.set_setpoint('rheo-1', 0.1))).message).toContain('was not sent');
  expect((await failure(api.change_control('rheo-1', { action: 'take' }))).message).toContain('was not taken');
  expect(sent).toHaveLength(1);
  await api.emergency_stop('rheo-1', 'press-1');
  expect(sent[1]?.[0]).toBe('/api/v1/robots/rheo-1/emergency-stop');
});
