// The list of the audit: pages, what is new on top, filters, and how an entry reads.

import { expect, test } from 'vitest';
import { AuditList, act_of, detail_text, is_refusal, kind_of } from '../../src/views/station/audit_list';
import type { AuditEntry, AuditFilter, AuditPage } from '../../src/views/station/station_api';

const entry = (number: number, action = 'account.signed_in') =>
  ({
    entry: number,
    at_us: number,
    actor: '',
    peer: '',
    robot_id: '',
    action,
    subject: '',
    detail: {},
    hash: '',
  }) as AuditEntry;

// A station with `size` entries that answers `page` of them at a time.
class Records {
  size = 0;
  asked: { filter: AuditFilter; before: number | null }[] = [];
  empty_pages = 0;
  fails = false;

  constructor(private readonly page: number) {}

  ask = (filter: AuditFilter, before: number | null): Promise<AuditPage> => {
    this.asked.push({ filter, before });
    if (this.fails) return Promise.reject(new Error('The station did not answer.'));
    const newest = Math.min(this.size, before === null ? this.size : before - 1);
    const oldest = Math.max(1, newest - this.page + 1);
    const entries: AuditEntry[] = [];
    for (let number = newest; number >= oldest; --number) entries.push(entry(number));
    const is_empty = this.empty_pages-- > 0;
    return Promise.resolve({
      entries: is_empty ? [] : entries,
      next: oldest > 1 ? oldest : null,
      head: `${this.size}:ab`,
    });
  };
}

const kAll: AuditFilter = { actor: '', action: '', robot_id: '' };
const numbers = (list: AuditList) => list.entries.value.map((each) => each.entry);
const listed = (size: number, page: number) => {
  const records = new Records(page);
  records.size = size;
  return { records, list: new AuditList(records.ask) };
};

test('newest first, and older pages until there are none', async () => {
  const { list } = listed(5, 2);
  await list.begin(kAll);
  expect(numbers(list)).toEqual([5, 4]);
  expect(list.head.value).toBe('5:ab');
  await list.older();
  await list.older();
  expect(numbers(list)).toEqual([5, 4, 3, 2, 1]);
  expect(list.next.value).toBeNull();
  await list.older();
  expect(numbers(list)).toEqual([5, 4, 3, 2, 1]);
});

test('what is new comes on top, once', async () => {
  const { records, list } = listed(3, 3);
  await list.begin(kAll);
  records.size = 5;
  await list.refresh();
  await list.refresh();
  expect(numbers(list)).toEqual([5, 4, 3, 2, 1]);
  expect(list.head.value).toBe('5:ab');
});

test('where more is new than a page holds, the list begins anew and has no hole', async () => {
  const { records, list } = listed(3, 3);
  await list.begin(kAll);
  records.size = 20;
  await list.refresh();
  expect(numbers(list)).toEqual([20, 19, 18]);
  await list.older();
  expect(numbers(list)).toEqual([20, 19, 18, 17, 16, 15]);
});

test('an empty page that has a next one is gone through', async () => {
  const { records, list } = listed(6, 2);
  records.empty_pages = 2;
  await list.begin({ ...kAll, action: 'run' });
  expect(numbers(list)).toEqual([2, 1]);
  expect(records.asked.map(({ before }) => before)).toEqual([null, 5, 3]);
});

test('the answer to a filter that was given up is thrown away', async () => {
  const { records, list } = listed(2, 2);
  const first = list.begin({ ...kAll, actor: 'user:anna' });
  records.size = 1;
  await list.begin(kAll);
  await first;
  expect(numbers(list)).toEqual([1]);
  expect(list.is_busy.value).toBe(false);
});

test('a failure is said, and what is known stays', async () => {
  const { records, list } = listed(2, 1);
  await list.begin(kAll);
  records.fails = true;
  await list.older();
  expect(list.problem.value).toBe('The station did not answer.');
  expect(numbers(list)).toEqual([2]);
  records.fails = false;
  await list.older();
  expect(list.problem.value).toBe('');
  expect(numbers(list)).toEqual([2, 1]);
});

test('how an entry reads', () => {
  expect([kind_of('account.token_made'), act_of('account.token_made')]).toEqual(['account', 'token made']);
  expect(is_refusal('command.refused') && is_refusal('account.sign_in_refused')).toBe(true);
  expect(is_refusal('command.verified') || is_refusal('robot.enrolled')).toBe(false);
  const at_us = Date.UTC(2026, 11, 26, 5, 50) * 1000;
  expect(detail_text({ role: 'viewer', expires_at_us: at_us, sent_after_us: 355, reason: '', old: null }, true)).toBe(
    'role viewer, expires at 2026-12-26 05:50, sent after us 355',
  );
  expect(detail_text({ arguments: { mode: 'auto', setpoint_m: 0.1 } }, true)).toBe(
    'arguments mode auto, setpoint m 0.1',
  );
  expect(detail_text({ arguments: {}, kind: 'renew_lease' }, true)).toBe('kind renew_lease');
  expect(detail_text(undefined, true)).toBe('');
});
