// What is typed for a new experiment is there again: its notes after another view, a changed profile after another profile.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { route } from '../../src/route';
import type { Session } from '../../src/session';
import { Begin } from '../../src/views/experiments/begin';
import { fake_document, FakeNode } from '../fake_dom';
import { robot, store_with } from '../fakes';

vi.mock('../../src/views/experiments/plan', () => ({ Plan: () => null }));

const settle = () => vi.advanceTimersByTimeAsync(400);
const pages: FakeNode[] = [];

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', { ...fake_document, addEventListener() {}, removeEventListener() {} });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('location', { hash: '' });
  vi.stubGlobal('history', { pushState() {}, replaceState() {} });
  for (const name of ['addEventListener', 'removeEventListener']) vi.stubGlobal(name, () => undefined);
});
afterEach(async () => {
  for (const page of pages.splice(0)) render(null, page as unknown as Element);
  await settle();
  vi.unstubAllGlobals();
  vi.useRealTimers();
  route.value = { view: 'robot', parts: [], query: {} };
});

async function begin() {
  const { store } = store_with(robot('a'));
  const none = () => Promise.resolve(null);
  const profiles = ['step', 'scan'].map((profile) => ({ profile, name: profile, purpose: '', runs: 1, duration_s: 1 }));
  const begun: { notes: string; profile: string }[] = [];
  const session = {
    store,
    phase: signal('live'),
    me: signal({ role: 'operator', scopes: 'command' }),
    utc_us: () => 0,
    experiments: {
      profiles: () => Promise.resolve(profiles),
      profile: (name: string) => Promise.resolve(`name = "${name}"\n`),
      fluids: none,
      controller: none,
      newest_run: none,
      reservations: () => Promise.resolve([]),
      begin: (body: { notes: string; profile: string }) => {
        begun.push(body);
        return Promise.resolve({ experiment_id: 1, robot_id: 'a', state: 'waiting' });
      },
    },
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  pages.push(page);
  const show = async () => {
    render(null, page as unknown as Element);
    await settle();
    route.value = { view: 'experiments', parts: ['new'], query: {} };
    const View = () => h(Begin, { session, route: route.value });
    render(h(View, {}), page as unknown as Element);
    await settle();
  };
  const type = async (id: string, value: string) => {
    page.find(id)!.fire('Input', { currentTarget: { value } });
    await settle();
  };
  const press = async (id: string) => {
    page.find(id)!.fire('Click');
    await settle();
  };
  const value = (id: string) => page.find(id)!.attributes['value'] ?? '';
  await show();
  return { page, begun, show, type, press, value };
}

test('notes of its runs are there again after another view, and gone once it has begun', async () => {
  const { begun, show, type, press, value } = await begin();
  await press('profile-step');
  await type('experiment-notes', 'pump warm');
  await show();
  expect(value('experiment-notes')).toBe('pump warm');
  await press('start-experiment');
  expect(begun.map(({ notes }) => notes)).toEqual(['pump warm']);
  await show();
  expect(value('experiment-notes')).toBe('');
});

test('a profile that was changed is there again after another one was pressed, until it is undone', async () => {
  const { page, press, type, value } = await begin();
  await press('profile-step');
  await type('profile-text', 'name = "mine"');
  await press('profile-scan');
  expect(value('profile-text')).toBe('name = "scan"\n');
  await press('profile-step');
  expect(value('profile-text')).toBe('name = "mine"');
  await press('undo-text');
  await press('profile-scan');
  await press('profile-step');
  expect(value('profile-text')).toBe('name = "step"\n');
  expect(page.find('undo-text')).toBeNull();
});
