// The events of a run, page by page.
import { expect, test } from 'vitest';
import { RunsApi, type Run } from '../../src/views/runs/runs_api';

const run = { robot_id: 'a', started_at_us: 1, ended_at_us: 2 } as Run;

function api_with(pages: number) {
  const asked: string[] = [];
  const read = (path: string) => {
    asked.push(path);
    const next = asked.length < pages ? `c${asked.length}` : null;
    return Promise.resolve({ events: [{ kind: `event ${asked.length}` }], next });
  };
  return { asked, api: new RunsApi({ read, change: read } as never) };
}

test('all pages are read', async () => {
  const { asked, api } = api_with(3);
  const { events, is_whole } = await api.events(run);
  expect(events.map(({ kind }) => kind)).toEqual(['event 1', 'event 2', 'event 3']);
  expect(is_whole).toBe(true);
  expect(asked[1]).toMatch(/before=c1/);
});

test('of very many the newest are read, and it is said that they are not all', async () => {
  const { asked, api } = api_with(1000);
  expect((await api.events(run)).is_whole).toBe(false);
  expect(asked).toHaveLength(10);
});
