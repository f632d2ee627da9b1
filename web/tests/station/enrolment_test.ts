// What a robot needs to connect, as texts; forms that are checked before they are sent; copying without a clipboard.

import { expect, test } from 'vitest';
import { encode } from 'uqr';
import { copy_text } from '../../src/views/station/copying';
import {
  address_note,
  enrolment_text,
  firmware_lines,
  module_path,
  parts_of,
  reached_address,
  simulator_line,
} from '../../src/views/station/enrolment';
import { browser_text } from '../../src/views/station/browser_text';
import { made_password, robot_problem, token_body, user_body, StationApi } from '../../src/views/station/station_api';

const kRobot = { robot_id: 'rheo-1', token: 'wbCU54_-', station: '192.168.1.20:7070', pin: '9f86d0' };

test('the text of the QR code, as docs/cockpit.md has it', () => {
  expect(enrolment_text(kRobot)).toBe('rheonaut-robot:1?id=rheo-1&token=wbCU54_-&station=192.168.1.20:7070&pin=9f86d0');
  expect(enrolment_text({ ...kRobot, station: '[fe80::1]:7070', pin: '' })).toBe(
    'rheonaut-robot:1?id=rheo-1&token=wbCU54_-&station=[fe80::1]:7070',
  );
  const { searchParams } = new URL(enrolment_text({ ...kRobot, token: 'a+b&c=d e' }));
  expect(searchParams.get('token')).toBe('a+b&c=d e');
});

test('the lines for the simulator and the firmware', () => {
  expect(simulator_line(kRobot)).toBe(
    'rheonaut-sim --station 192.168.1.20:7070 --tls-pin 9f86d0 --id rheo-1 --token wbCU54_-',
  );
  expect(simulator_line({ ...kRobot, pin: '' })).not.toContain('--tls-pin');
  expect(firmware_lines(kRobot).split('\n')).toEqual([
    '"rheo-1",',
    '"wbCU54_-",',
    '"WIFI-NAME", "WIFI-PASSWORD",',
    '"192.168.1.20",',
    '7070,',
  ]);
});

test('an address is taken apart, and a wrong one is said', () => {
  expect(parts_of('[fe80::1]:7070')).toEqual({ host: 'fe80::1', port: '7070' });
  expect(parts_of('lab-pc.local:7070')).toEqual({ host: 'lab-pc.local', port: '7070' });
  for (const wrong of ['', 'lab-pc', ':7070', 'a b:1', 'lab:99999', 'lab:x']) {
    expect(parts_of(wrong)).toBeNull();
    expect(address_note(wrong).problem).toContain(`“${wrong}”`);
  }
  expect(address_note('127.0.0.1:7070').note).toMatch(/own machine only/);
  expect(address_note('192.168.1.20:7070')).toEqual({ problem: '', note: '' });
});

test('a station that listens on every address is reached by the name that the page has', () => {
  expect(reached_address('0.0.0.0:7070', 'lab-pc.local')).toBe('lab-pc.local:7070');
  expect(reached_address('[::]:7070', '[fe80::1]')).toBe('[fe80::1]:7070');
  expect(reached_address('192.168.1.20:7070', 'lab-pc.local')).toBe('192.168.1.20:7070');
});

test('every dark module of the QR code is in its path, and no light one', () => {
  const { data } = encode(enrolment_text(kRobot), { ecc: 'M', border: 0 });
  const drawn = data.map((row) => row.map(() => false));
  for (const [, x, y, length] of module_path(data).matchAll(/M(\d+) (\d+)h(\d+)v1h-\d+z/g))
    for (let step = 0; step < Number(length); ++step) (drawn[Number(y)] as boolean[])[Number(x) + step] = true;
  expect(drawn).toEqual(data);
});

test('a form that cannot be right is not sent, and says which value and why', () => {
  expect(user_body('Anna', 'viewer', 'long enough')).toMatch(/“Anna” is not 1 to 31 characters/);
  expect(user_body('anna', 'viewer', 'short')).toMatch(/5 characters are too few/);
  expect(user_body('anna', 'viewer', 'long enough')).toEqual({ name: 'anna', role: 'viewer', password: 'long enough' });
  expect(token_body('ci', [], '')).toMatch(/at least one/);
  expect(token_body('ci', ['read'], '0')).toMatch(/“0” is not a whole number from 1 to 3650/);
  expect(token_body('ci', ['read', 'stop'], ' 30 ')).toEqual({ name: 'ci', scopes: 'read,stop', days: 30 });
  expect(token_body('ci', ['read'], '')).toEqual({ name: 'ci', scopes: 'read' });
  expect(robot_problem('Rheo 1')).toMatch(/“Rheo 1”/);
  expect(robot_problem('rheo-1')).toBe('');
});

test('a password that was made is long, and has no letters that are mistaken', () => {
  const password = made_password((into) => into.map((_, at) => at * 17));
  expect(password).toMatch(/^([a-km-np-z2-9]{4}-){3}[a-km-np-z2-9]{4}$/);
  expect(password).not.toBe(made_password((into) => into.map((_, at) => at * 31)));
});

test('a text is copied, or selected where there is no clipboard or it refuses', async () => {
  const said: string[] = [];
  const select = () => void said.push('selected');
  const writes = { writeText: (text: string) => Promise.resolve(void said.push(text)) };
  const refuses = { writeText: () => Promise.reject(new Error('not allowed')) };
  expect(await copy_text('secret', { clipboard: writes, select })).toBe('copied');
  expect(said).toEqual(['secret']);
  expect(await copy_text('secret', { clipboard: refuses, select })).toBe('selected');
  expect(await copy_text('secret', { clipboard: undefined, select })).toBe('selected');
  const cannot = () => {
    throw new Error('gone');
  };
  expect(await copy_text('secret', { clipboard: undefined, select: cannot })).toBe('failed');
});

test('a browser in two words', () => {
  const chrome =
    'Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/140.0.0.0 Safari/537.36';
  expect(browser_text(chrome)).toBe('Chrome 140, Linux');
  expect(browser_text(`${chrome} Edg/140.0`)).toBe('Edge 140, Linux');
  expect(browser_text('Mozilla/5.0 (Windows NT 10.0; rv:128.0) Gecko/20100101 Firefox/128.0')).toBe(
    'Firefox 128, Windows',
  );
  expect(
    browser_text(
      'Mozilla/5.0 (iPhone; CPU iPhone OS 17_0 like Mac OS X) AppleWebKit/605 Version/17.0 Mobile Safari/604',
    ),
  ).toBe('Safari 17, iPhone');
  expect(browser_text('curl/8.5.0')).toBe('curl/8.5.0');
  expect(browser_text('')).toBe('not said');
});

test('what is asked: paths, empty filters left out, and figures as text', async () => {
  const asked: string[] = [];
  const api = {
    read: (path: string) => Promise.resolve(void asked.push(path)),
    change: (path: string, body: object) => Promise.resolve(void asked.push(`${path} ${JSON.stringify(body)}`)),
  };
  const answer = { ok: true, status: 200, text: () => Promise.resolve('rheonaut_free_bytes 5') };
  const station = new StationApi(api as never, () => Promise.resolve(answer as Response));
  await station.audit({ actor: 'user:anna/session:4', action: '', robot_id: '' }, 12);
  await station.change_user('a/b', { role: 'viewer' });
  await station.enrol('rheo-1');
  expect(asked).toEqual([
    '/audit?actor=user%3Aanna%2Fsession%3A4&before=12&limit=100',
    '/users/a%2Fb/change {"role":"viewer"}',
    '/enrolments {"robot_id":"rheo-1"}',
  ]);
  expect((await station.metrics()).value('rheonaut_free_bytes')).toBe(5);
  const refused = new StationApi(api as never, () => Promise.resolve({ ok: false, status: 403 } as Response));
  await expect(refused.metrics()).rejects.toThrow('The station answered 403 to /metrics.');
});
