// A password that was made for somebody is shown until "Done" is pressed.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Accounts } from '../../src/views/station/accounts';
import type { Context } from '../../src/views/station/facts';
import type { UserChange } from '../../src/views/station/station_api';
import { fake_document, FakeNode } from '../fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('navigator', {});
  for (const name of ['addEventListener', 'removeEventListener']) vi.stubGlobal(name, () => undefined);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const settled = () => vi.advanceTimersByTimeAsync(100);
const with_label = (node: FakeNode, label: string): FakeNode | undefined =>
  node.attributes['aria-label'] === label
    ? node
    : node.childNodes.map((child) => with_label(child, label)).find((found) => found !== undefined);

test('a new password of a user stays to be copied after it was saved, until "Done"', async () => {
  const changes: UserChange[] = [];
  const anna = { name: 'anna', role: 'operator', disabled: false, made_at_us: 0, made_by: '' };
  const context = {
    session: { phase: signal('live'), me: signal({ user: 'ben' }), api: { users: () => Promise.resolve([anna]) } },
    api: { change_user: (_: string, change: UserChange) => Promise.resolve(void changes.push(change)) },
    is_current: true,
    is_admin: true,
    is_utc: true,
  } as unknown as Context;
  const page = new FakeNode(1, 'body');
  render(h(Accounts, { context }), page as unknown as Element);
  await settled();
  with_label(page, 'Change anna')!.fire('Click');
  await settled();
  page.find('station-edit-password')!.fire('Input', { currentTarget: { value: 'correct horse' } });
  await settled();
  page.find('station-save-user')!.parentNode!.fire('Submit');
  await settled();
  expect(changes).toEqual([{ password: 'correct horse' }]);
  expect(page.find('station-changed-password')?.text).toBe('correct horse');
  page.find('station-user-changed')!.childNodes.at(-1)!.fire('Click');
  await settled();
  expect(page.find('station-changed-password')).toBeNull();
  expect(page.find('station-edit-password')).toBeNull();
});
