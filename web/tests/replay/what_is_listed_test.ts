// What the station lists of a run that is replayed: what cannot be read is said, and asked for again.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Session } from '../../src/session';
import { unread_text, useRead } from '../../src/views/runs/replay/use_what_is_listed';
import { RunPage } from '../../src/views/runs/run_page';
import type { Marker, RunsApi } from '../../src/views/runs/runs_api';
import { fake_document, FakeNode } from '../fake_dom';
import { made_run } from '../runs/made';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

test('a request that failed is said, and made again until it is answered', async () => {
  let fails = true;
  const ask = vi.fn(() => (fails ? Promise.reject(new Error('The station did not answer.')) : Promise.resolve('read')));
  const session = { phase: signal('live') } as unknown as Session;
  const Reader = () => {
    const { answer, problem } = useRead(session, ask, []);
    return h('p', null, `${answer} ${problem}`);
  };
  const page = new FakeNode(1, 'body');
  render(h(Reader, null), page as unknown as Element);
  await vi.advanceTimersByTimeAsync(200);
  expect(page.text).toBe('null The station did not answer.');
  fails = false;
  await vi.advanceTimersByTimeAsync(5200);
  expect(page.text).toBe('read ');
  await vi.advanceTimersByTimeAsync(20_000);
  expect(ask).toHaveBeenCalledTimes(2);
});

test('one line names all that could not be read', () => {
  expect(unread_text({ commands: '', predictions: '' })).toBe('');
  expect(unread_text({ 'events and markers': 'No answer.', commands: 'No answer.', predictions: '' })).toBe(
    'Could not be read: events and markers, commands. No answer. It is tried again every 5 s.',
  );
});

test('events that do not come leave the markers, and the run says so until they have come', async () => {
  let fails = true;
  const api = {
    markers: () => Promise.resolve([{ marker_id: 1 } as Marker]),
    events: () => (fails ? Promise.reject(new Error('The station did not answer.')) : Promise.resolve([])),
  } as unknown as RunsApi;
  const page = new RunPage(api, 1);
  page.run.value = made_run();
  await page.load_what_happened();
  expect(page.markers.value).toHaveLength(1);
  expect(page.unread.value).toBe('The station did not answer.');
  fails = false;
  await page.load_what_happened();
  expect(page.unread.value).toBe('');
});
