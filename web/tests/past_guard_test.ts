// While a replay is shown nothing commands a robot: the second lock, beside the view that has no controls.
import { afterEach, expect, test, vi } from 'vitest';
import { is_refused_in_past, shows_past } from '../src/past_guard';
import { parse, route } from '../src/route';
import { Session } from '../src/session';
import { FakeSurroundings } from './fakes';

const replay = parse('#/runs/12/replay?at=12.5');
afterEach(() => {
  route.value = parse('');
  vi.unstubAllGlobals();
});

test('a replay is the past; a run, the list and a robot are not', () => {
  expect(shows_past(replay)).toBe(true);
  for (const hash of ['#/runs/12', '#/runs', '#/robot/rheo-1', '#/experiments/replay', ''])
    expect(shows_past(parse(hash))).toBe(false);
});

test('only reading, stops and the page’s own session get through, and what ends a duty', () => {
  const refused = (method: string, path: string, body?: object) =>
    is_refused_in_past(replay, method, `/api/v1${path}`, body && JSON.stringify(body));
  for (const path of ['/robots/a/commands', '/robots/a/control', '/robots/a/controller', '/runs', '/experiments'])
    expect(refused('POST', path, { kind: 'set_duty', duty: 0.2 })).toBe(true);
  expect(refused('POST', '/robots/a/emergency-stop')).toBe(false);
  expect(refused('POST', '/emergency-stop')).toBe(false);
  expect(refused('POST', '/logout')).toBe(false);
  expect(refused('POST', '/experiments/7/pause')).toBe(false);
  expect(refused('POST', '/experiments/7/abort')).toBe(false);
  expect(refused('POST', '/experiments/7/resume')).toBe(true);
  expect(refused('GET', '/robots/a/commands')).toBe(false);
  expect(refused('POST', '/robots/a/commands', { kind: 'set_duty', duty: 0 })).toBe(false);
  expect(refused('POST', '/robots/a/commands', { kind: 'set_setpoint', setpoint_m: 0 })).toBe(true);
  expect(is_refused_in_past(parse('#/robot/a'), 'POST', '/api/v1/robots/a/commands', '{}')).toBe(false);
});

test('the session refuses a command by itself, and sends a stop', async () => {
  const sent: string[] = [];
  vi.stubGlobal('fetch', (path: string) => {
    sent.push(path);
    return Promise.resolve({ ok: true, status: 200, json: () => Promise.resolve({ command_id: '1' }) });
  });
  const session = new Session(new FakeSurroundings());
  session.link.stamp_us = 1;
  route.value = replay;
  await expect(session.api.set_duty('rheo-1', 0.3)).rejects.toThrow('A replay is shown');
  await expect(session.api.set_manual('rheo-1')).rejects.toThrow('A replay is shown');
  expect(sent).toEqual([]);
  await session.api.emergency_stop('rheo-1', 'key');
  expect(sent).toEqual(['/api/v1/robots/rheo-1/emergency-stop']);
  route.value = parse('#/robot/rheo-1');
  await session.api.set_duty('rheo-1', 0.3);
  expect(sent).toHaveLength(2);
});
