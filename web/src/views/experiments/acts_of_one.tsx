// What may be done with one experiment: pause, resume, abort or cancel, take over. Each button says why it is not possible.

import type { Acts } from './acts';
import { may_command } from './acts';
import { counts_down, has_ended, is_in_hands_of, type ExperimentSummary } from '../../experiments_store';
import type { Session } from '../../session';
import { who } from './words';

interface ActsOfOneProps {
  session: Session;
  experiment: ExperimentSummary;
  acts: Acts;
}

export function ActsOfOne({ session, experiment, acts }: ActsOfOneProps) {
  const { store, experiments } = session;
  const { experiment_id, state, held, acts_for, robot_id } = experiment;
  if (has_ended(experiment)) return null;
  const me = store.actor.value;
  const is_current = store.is_current.value;
  const is_mine = is_in_hands_of(experiment, me, store.client.value);
  const commands = may_command(session);
  const is_busy = acts.pending.value !== '';
  const holder = store.find(robot_id)?.state.value.control?.holder ?? '';
  const ask = (what: string, request: (id: number) => Promise<ExperimentSummary>) =>
    void acts.act(what, async () => {
      const asked_at = store.experiments.mark();
      store.experiments.take_answer([await request(experiment_id)], asked_at);
    });
  // SAFETY: what lets a robot move needs a page that sees the present; what ends motion does not.
  const moves = (id: string, text: string, what: string, request: (id: number) => Promise<ExperimentSummary>) => (
    <button type="button" id={id} class="go" disabled={!is_current || is_busy} onClick={() => ask(what, request)}>
      {text}
    </button>
  );
  const may_resume = (state === 'paused' && !counts_down(experiment)) || (state === 'waiting' && held);
  return (
    <div class="acts">
      {(state === 'running' || counts_down(experiment)) && (
        <button type="button" id="pause-experiment" disabled={is_busy} onClick={() => ask('pause', experiments.pause)}>
          Pause
        </button>
      )}
      {commands && acts_for === me && may_resume && moves('resume-experiment', 'Resume', 'resume', experiments.resume)}
      {commands && !is_mine && state !== 'aborting' && holder !== '' && holder !== me && (
        <span class="quiet">
          To take it over, first take control of {robot_id} from {who(holder)}.
        </span>
      )}
      {commands && !is_mine && state !== 'aborting' && (holder === '' || holder === me) && (
        <>{moves('take-over', 'Take over', 'take over', experiments.take_over)}</>
      )}
      {state !== 'aborting' && (
        <button
          type="button"
          id="abort-experiment"
          class="ends"
          // SAFETY: not even another request that is on its way is in its way.
          onClick={() => {
            if (acts.pending.value !== '') acts.pending.value = '';
            ask('abort', experiments.abort);
          }}
        >
          {state === 'waiting' ? 'Cancel' : 'Abort'}
        </button>
      )}
    </div>
  );
}

// Who is responsible, and what that asks of the person who looks at this page.
export function Presence({ session, experiment }: Omit<ActsOfOneProps, 'acts'>) {
  const me = session.store.actor.value;
  if (has_ended(experiment)) return null;
  const { acts_for, unattended, state } = experiment;
  const is_mine = is_in_hands_of(experiment, me, session.store.client.value);
  if (unattended) {
    const begins = state === 'waiting' ? ' Somebody must be there when it begins.' : '';
    return (
      <p class="presence unattended" id="presence">
        Unattended: it goes on while nobody is there, until the time limit of the robot’s auto mode.{begins}
      </p>
    );
  }
  return (
    <p class="presence" id="presence">
      {is_mine
        ? 'It is in the hands of this page, which must stay open: closed or cut off, a duty ends within 0.9 s, and the experiment after 3 s.'
        : acts_for === me
          ? 'It is in the hands of another page or program of yours, and goes on only while that is there.'
          : `It acts in the name of ${who(acts_for)}, and goes on only while they are there.`}
    </p>
  );
}
