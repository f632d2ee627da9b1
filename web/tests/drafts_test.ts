// What was typed and not sent.
import { expect, test } from 'vitest';
import { draft_of } from '../src/drafts';
import type { Session } from '../src/session';

test('a draft belongs to its robot, its field and its page', () => {
  const session = {} as Session;
  draft_of(session, 'a', 'setpoint').value = '12';
  expect(draft_of(session, 'a', 'setpoint').value).toBe('12');
  for (const other of [
    draft_of(session, 'b', 'setpoint'),
    draft_of(session, 'a', 'duty'),
    draft_of({} as Session, 'a', 'setpoint'),
  ])
    expect(other.value).toBeNull();
});
