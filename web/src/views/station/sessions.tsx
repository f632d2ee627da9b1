// Sessions: the pages that are signed in, from where and until when, each with a way out.

import { GuardedButton } from '../../parts/hold_button';
import { useActs, useAsked } from '../experiments/acts';
import { browser_text } from './browser_text';
import type { Context } from './facts';
import { ForAdmins, Nothing, Panel, Problem, When } from './parts';

const kLook_ms = 5000;

export function Sessions({ context }: { context: Context }) {
  return context.is_admin ? <AllSessions context={context} /> : <ForAdmins context={context} what="Sessions" />;
}

function AllSessions({ context }: { context: Context }) {
  const { session, is_current, is_utc } = context;
  const asked = useAsked(session, session.api.sessions, [], kLook_ms);
  const acts = useActs();
  const sessions = asked.answer ?? [];
  const revoke = (number: number) =>
    void acts.act('revoke', () => session.api.revoke_session(number)).then(() => asked.ask_again());
  return (
    <div id="station-sessions" class={is_current ? '' : 'was'}>
      <Problem text={asked.problem || acts.problem.value} />
      <Panel id="station-session-list" title="Pages that are signed in">
        {sessions.length === 0 ? (
          <Nothing is_known={asked.answer !== null}>
            <p>Nobody is signed in.</p>
          </Nothing>
        ) : (
          <table class="station-table">
            <thead>
              <tr>
                <th scope="col" class="number">
                  Session
                </th>
                <th scope="col">Who</th>
                <th scope="col">From</th>
                <th scope="col">Browser</th>
                <th scope="col">Signed in</th>
                <th scope="col">Last used</th>
                <th scope="col">Ends, unless used</th>
                <th scope="col">
                  <span class="unseen">Sign out</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {sessions.map((each) => (
                <tr key={each.session} data-session={each.session}>
                  <th scope="row" class="number" data-label="Session">
                    {each.session}
                  </th>
                  <td data-label="Who">
                    {each.user || 'by link'} {each.is_mine && <small class="quiet">this page</small>}
                  </td>
                  <td data-label="From">{each.peer || 'not known'}</td>
                  <td data-label="Browser" title={each.agent}>
                    {browser_text(each.agent)}
                  </td>
                  <td data-label="Signed in">
                    <When at_us={each.made_at_us} is_utc={is_utc} />
                  </td>
                  <td data-label="Last used">
                    <When at_us={each.last_used_at_us} is_utc={is_utc} />
                  </td>
                  <td data-label="Ends">
                    <When at_us={each.ends_at_us} is_utc={is_utc} />
                  </td>
                  <td class="station-acts">
                    <GuardedButton
                      id={`station-sign-out-${each.session}`}
                      disabled={acts.pending.value !== '' || !is_current}
                      on_held={() => revoke(each.session)}
                    >
                      Hold to sign out<span class="unseen"> session {each.session}</span>
                    </GuardedButton>
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        )}
        <p class="station-note">
          A session ends 12 hours after its last use; an open page counts as use. Signing out is in force at once, also
          when the disk cannot be written.
        </p>
      </Panel>
    </div>
  );
}
