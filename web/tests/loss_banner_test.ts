// What the top bar says of recordings that the database has lost, and who may acknowledge it.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Station } from '../src/api';
import { Notices } from '../src/parts/top_bar';
import type { Session } from '../src/session';
import { Store } from '../src/store';
import { fake_document, FakeNode } from './fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
  vi.stubGlobal('window', { addEventListener: () => undefined });
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const kProblem = 'the database has lost commits: run 4 ends at sample 1200';
const station_with = (problems: string[]) =>
  ({
    version: '1',
    security: { exposed: false, certificate: null },
    losses: problems.map((problem) => ({ noticed_at_us: 0, problem })),
  }) as unknown as Station;

function drawn_for(role: string, problems: string[]) {
  const station = signal(station_with(problems));
  const session = {
    store: new Store({ page_ms: () => 0, utc_ms: () => 0 }),
    station,
    phase: signal('live'),
    me: signal({ role, user: 'anna', actor: 'user:anna/session:1' }),
    link: { attempt: 0, lost_at_ms: null },
    api: { acknowledge_losses: () => Promise.resolve({}), station: () => Promise.resolve(station_with([])) },
  } as unknown as Session;
  const page = new FakeNode(1, 'body');
  render(h(Notices, { session }), page as unknown as Element);
  return page;
}

test('the top bar says that recordings are lost, which ones, and where it is read what to do', () => {
  const banner = drawn_for('viewer', [kProblem]).find('losses')!;
  expect(banner.attributes['role']).toBe('alert');
  expect(banner.text).toContain('The database has lost recordings: docs/operations.md');
  expect(banner.firstChild!.attributes['title']).toBe(kProblem);
});

test('without a loss it says nothing', () => {
  expect(drawn_for('admin', []).find('losses')).toBeNull();
});

test('an admin acknowledges it, then it is gone; nobody else can', async () => {
  expect(drawn_for('operator', [kProblem]).find('acknowledge-losses')).toBeNull();
  const page = drawn_for('admin', [kProblem]);
  page.find('acknowledge-losses')!.fire('Click');
  await vi.advanceTimersByTimeAsync(100);
  expect(page.find('losses')).toBeNull();
});
