// Who has access to the station, for admins: pages that are signed in, users, tokens and robots, each with a way out.
//
// It takes the place of the plots; the emergency stop stays where it is.

import { useSignal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import { useEffect } from 'preact/hooks';
import type { Enrolment, PageSession, Token, User } from '../api';
import { GuardedButton } from '../parts/hold_button';
import type { Session } from '../session';

interface Lists {
  sessions: PageSession[];
  users: User[];
  tokens: Token[];
  robots: Enrolment[];
}

export function Access({ session }: { session: Session }) {
  const { api } = session;
  const lists = useSignal<Lists | null>(null);
  const problem = useSignal('');

  const attempt = async (what: () => Promise<unknown>) => {
    problem.value = '';
    try {
      await what();
    } catch (failure) {
      problem.value = failure instanceof Error ? failure.message : String(failure);
    }
  };
  const load = () =>
    attempt(async () => {
      const [sessions, users, tokens, robots] = await Promise.all([
        api.sessions(),
        api.users(),
        api.tokens(),
        api.enrolments(),
      ]);
      lists.value = { sessions, users, tokens, robots };
    });
  const end = (what: () => Promise<unknown>) => void attempt(what).then(() => (problem.value ? undefined : load()));
  useEffect(() => void load(), []);

  const { sessions = [], users = [], tokens = [], robots = [] } = lists.value ?? {};
  const good_tokens = tokens.filter((token) => token.revoked_at_us === null);
  return (
    <div class="access" id="access">
      <p class="access-problem" role="alert">
        {problem.value}
      </p>
      <List title="Signed in" empty={lists.value && sessions.length === 0 ? 'Nobody.' : ''}>
        {sessions.map((each) => (
          <Row
            key={each.session}
            id={`session-${each.session}`}
            name={each.user || 'by link'}
            note={`session ${each.session} from ${each.peer || 'an older station'}, last used ${when(each.last_used_at_us)}${each.is_mine ? ', this page' : ''}`}
            title={each.agent}
            action="Hold to sign out"
            on_end={() => end(() => api.revoke_session(each.session))}
          />
        ))}
      </List>
      <List
        title="Users"
        empty={
          lists.value && users.length === 0
            ? 'None: people get in by one-time links. Add one with: rheonaut user add'
            : ''
        }
      >
        {users.map((each) => (
          <Row
            key={each.name}
            id={`user-${each.name}`}
            name={each.name}
            note={`${each.role}${each.disabled ? ', disabled' : ''}, made ${when(each.made_at_us)}`}
            action="Hold to remove"
            on_end={() => end(() => api.remove_user(each.name))}
          />
        ))}
      </List>
      <List
        title="API tokens"
        empty={lists.value && good_tokens.length === 0 ? 'None. Make one with: rheonaut token create' : ''}
      >
        {good_tokens.map((each) => (
          <Row
            key={each.name}
            id={`token-${each.name}`}
            name={each.name}
            note={`${each.scopes.replaceAll(',', ', ')}; ${each.last_used_at_us === null ? 'never used' : `used ${when(each.last_used_at_us)}`}${each.expires_at_us === null ? '' : `, until ${when(each.expires_at_us)}`}`}
            action="Hold to revoke"
            on_end={() => end(() => api.revoke_token(each.name))}
          />
        ))}
      </List>
      <List
        title="Robots"
        empty={lists.value && robots.length === 0 ? 'None. Enrol one with: rheonaut robot enroll' : ''}
      >
        {robots.map((each) => (
          <Row
            key={each.robot_id}
            id={`robot-${each.robot_id}`}
            name={each.robot_id}
            note={note_of(each)}
            action={each.revoked_at_us === null ? 'Hold to revoke' : ''}
            on_end={() => end(() => api.revoke_robot(each.robot_id))}
          >
            {each.retired_at_us !== undefined && (
              <GuardedButton
                id={`retire-${each.robot_id}`}
                on_held={() => end(() => api.retire_robot(each.robot_id, each.retired_at_us === null))}
              >
                {each.retired_at_us === null ? 'Hold to retire' : 'Hold to put back'}
              </GuardedButton>
            )}
          </Row>
        ))}
      </List>
    </div>
  );
}

// Retired: the stop of all leaves it out while it is not connected; its recording stays.
function note_of(robot: Enrolment): string {
  const retired = robot.retired_at_us ? `; retired ${when(robot.retired_at_us)} by ${robot.retired_by}` : '';
  if (robot.revoked_at_us !== null) return `revoked ${when(robot.revoked_at_us)} by ${robot.revoked_by}${retired}`;
  return `${robot.has_token ? 'with a token' : 'without a token, from this machine only'}, enrolled by ${robot.enrolled_by}${retired}`;
}

function List({
  title,
  empty,
  children,
}: {
  title: string;
  empty: string | false | null;
  children: ComponentChildren;
}) {
  return (
    <section aria-label={title}>
      <h2>{title}</h2>
      {empty ? <p class="quiet">{empty}</p> : <ul>{children}</ul>}
    </section>
  );
}

interface RowProps {
  id: string;
  name: string;
  note: string;
  title?: string;
  action: string; // "": there is none
  on_end(): void;
  children?: ComponentChildren;
}

function Row({ id, name, note, title, action, on_end, children }: RowProps) {
  return (
    <li id={id} title={title}>
      <b>{name}</b>
      <span class="quiet">{note}</span>
      <span class="ways">
        {children}
        {action && (
          <GuardedButton id={`end-${id}`} on_held={on_end}>
            {action}
          </GuardedButton>
        )}
      </span>
    </li>
  );
}

function when(at_us: number): string {
  return new Date(at_us / 1000).toLocaleString(undefined, { dateStyle: 'short', timeStyle: 'short' });
}
