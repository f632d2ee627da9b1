// What runs and waits, robot by robot, in the order in which it begins; below it what has ended.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { has_ended, is_in_hands_of, type ExperimentSummary } from '../../experiments_store';
import { Choice } from '../../parts/choice';
import { change_query, format } from '../../route';
import type { Session } from '../../session';
import type { ViewProps } from '../table';
import { may_command, refusal, useActs, type Acts } from './acts';
import { moment_text } from './slot_time';
import { end_text, how_long, kStates, progress_text, situation, who } from './words';

export function Queue({ session, route }: ViewProps) {
  const { store } = session;
  const only = route.query['robot'] ?? '';
  const open = [...store.experiments.known.value.values()].filter((each) => !has_ended(each));
  const robots = [...new Set(open.map((each) => each.robot_id))]
    .filter((robot_id) => only === '' || robot_id === only)
    .sort();
  const listed = [...new Set([...store.robots.value.map((each) => each.robot_id), only])].filter((id) => id !== '');
  const acts = useActs();
  return (
    <div class="queue-view">
      <div class="field-of queue-filter">
        <span class="label">Robot</span>
        <Choice
          id="queue-robot"
          label="Robot"
          options={[{ value: '', text: 'all robots' }, ...listed.map((id) => ({ value: id, text: id }))]}
          value={only}
          on_choose={(robot) => change_query({ robot })}
        />
      </div>
      <p class="problem" role="alert">
        {acts.problem.value}
      </p>
      {!store.is_current.value && (
        <p class="problem" role="status">
          Cut off from the station: this is what was known last.
        </p>
      )}
      <section aria-label="Running and waiting" id="queue">
        <h2>Running and waiting</h2>
        {robots.length === 0 && (
          <div class="empty">
            <p>Nothing runs, and nothing waits{only === '' ? '' : ` for ${only}`}.</p>
            <p>
              <a href={format({ view: 'experiments', parts: ['new'], query: { robot: only } })}>Begin an experiment</a>
            </p>
          </div>
        )}
        {robots.map((robot_id) => (
          <RobotQueue key={robot_id} session={session} robot_id={robot_id} acts={acts} />
        ))}
      </section>
      <History key={only} session={session} robot_id={only} />
    </div>
  );
}

const link_to = (experiment_id: number) => format({ view: 'experiments', parts: [`${experiment_id}`] });

function RobotQueue({ session, robot_id, acts }: { session: Session; robot_id: string; acts: Acts }) {
  const { store, experiments } = session;
  const at_work = store.experiments.at_work_on(robot_id);
  const queue = store.experiments.queue_of(robot_id);
  const commands = may_command(session);
  const is_current = store.is_current.value;
  const is_busy = acts.pending.value !== '';
  const me = store.actor.value;
  // Before the one at this place. Down: the one behind it comes before it, so that it is always one move.
  const move = (from: number, by: number) => {
    const [moved, other] = by < 0 ? [queue[from], queue[from - 1]] : [queue[from + 1], queue[from]];
    if (!moved || !other) return;
    void acts.act('move', async () => {
      const answer = await experiments.move_before(moved.experiment_id, other.experiment_id);
      store.experiments.note_move({ ...moved, ...answer }, other.experiment_id);
    });
  };
  const ask = (what: string, request: () => Promise<ExperimentSummary>) =>
    void acts.act(what, async () => {
      const asked_at = store.experiments.mark();
      store.experiments.take_answer([await request()], asked_at);
    });
  return (
    <section class="robot-queue" aria-label={`Queue of ${robot_id}`} id={`queue-${robot_id}`}>
      <h3>{robot_id}</h3>
      {at_work && (
        <a class="at-work" href={link_to(at_work.experiment_id)}>
          <span class={`state lamp-like ${is_current ? at_work.state : 'stale'}`}>
            {is_current ? kStates[at_work.state] : `Was: ${kStates[at_work.state]}`}
          </span>
          <b>{at_work.name}</b>
          {at_work.progress && (
            <progress max={at_work.progress.duration_s} value={at_work.progress.elapsed_s} aria-label="Of this run" />
          )}
          <span class="figure">{progress_text(at_work)}</span>
          <span class="quiet">{situation(at_work).what}</span>
        </a>
      )}
      {queue.length > 0 && (
        <ol class="queue-list">
          {queue.map((each, index) => {
            const { what, todo } = situation(each);
            return (
              <li key={each.experiment_id} data-experiment={each.experiment_id}>
                <span class="place">{index + 1}</span>
                <span class="queue-name">
                  <a href={link_to(each.experiment_id)}>{each.name}</a>
                  <span class="quiet">
                    {' '}
                    {each.experiment_id}, of {who(each.owner, me)}, priority {`${each.priority}`.replace('-', '−')},{' '}
                    {how_long(each.duration_s)}
                    {each.unattended ? ', unattended' : ''}
                  </span>
                </span>
                <span class="queue-what">
                  {what} {todo !== '' && <span class="quiet">{todo}</span>}
                </span>
                <span class="queue-acts">
                  {commands && each.held && each.acts_for === me && (
                    <button
                      type="button"
                      class="go"
                      disabled={!is_current || is_busy}
                      onClick={() => ask('resume', () => experiments.resume(each.experiment_id))}
                    >
                      Resume
                    </button>
                  )}
                  {commands && !is_in_hands_of(each, me, session.store.client.value) && (
                    <button
                      type="button"
                      disabled={!is_current || is_busy}
                      title="It acts in the name of this page then"
                      onClick={() => ask('take over', () => experiments.take_over(each.experiment_id))}
                    >
                      Take over
                    </button>
                  )}
                  {commands && (
                    <>
                      <button
                        type="button"
                        class="step-up"
                        aria-label={`Move ${each.name} (${each.experiment_id}) up`}
                        disabled={index === 0 || is_busy || !is_current}
                        onClick={() => move(index, -1)}
                      >
                        ↑
                      </button>
                      <button
                        type="button"
                        class="step-down"
                        aria-label={`Move ${each.name} (${each.experiment_id}) down`}
                        disabled={index === queue.length - 1 || is_busy || !is_current}
                        onClick={() => move(index, 1)}
                      >
                        ↓
                      </button>
                    </>
                  )}
                  <button
                    type="button"
                    class="ends"
                    aria-label={`Cancel ${each.name} (${each.experiment_id})`}
                    disabled={is_busy}
                    onClick={() => ask('cancel', () => experiments.abort(each.experiment_id))}
                  >
                    Cancel
                  </button>
                </span>
              </li>
            );
          })}
        </ol>
      )}
      {queue.length > 1 && queue.some((each) => each.place === undefined) && (
        <p class="quiet order-note">
          Of one priority the oldest begins first, unless it was moved. Moves are shown that were made on this page.
        </p>
      )}
    </section>
  );
}

// Newest first, page by page; what ends meanwhile comes by /live.
function History({ session, robot_id }: { session: Session; robot_id: string }) {
  const pages = useSignal<ExperimentSummary[]>([]);
  const is_last = useSignal(false);
  const problem = useSignal('');
  const is_asking = useSignal(false);
  const is_live = session.phase.value === 'live';
  const load = async (before: number | null) => {
    is_asking.value = true;
    try {
      const page = await session.experiments.page(robot_id, before);
      pages.value = before === null ? page.experiments : [...pages.peek(), ...page.experiments];
      is_last.value = page.is_last;
      problem.value = '';
    } catch (error) {
      problem.value = refusal(error);
    }
    is_asking.value = false;
  };
  useEffect(() => {
    if (is_live) void load(null);
  }, [is_live]);

  const me = session.store.actor.value;
  const known = session.store.experiments.known.value;
  const oldest = pages.value.at(-1)?.experiment_id ?? Infinity;
  const found = new Map(pages.value.map((each) => [each.experiment_id, known.get(each.experiment_id) ?? each]));
  for (const each of known.values()) {
    const is_newer = each.experiment_id > oldest || is_last.value;
    if (is_newer && (robot_id === '' || each.robot_id === robot_id)) found.set(each.experiment_id, each);
  }
  const ended = [...found.values()].filter(has_ended).sort((a, b) => b.experiment_id - a.experiment_id);
  return (
    <section aria-label="Ended" id="history">
      <h2>Ended</h2>
      {problem.value !== '' && <p class="problem">{problem.value}</p>}
      {ended.length === 0 && <p class="quiet empty">{is_asking.value ? 'Asking the station…' : 'None yet.'}</p>}
      {ended.length > 0 && (
        <div class="table-box">
          <table class="figures history">
            <thead>
              <tr>
                <th scope="col">No.</th>
                <th scope="col">Experiment</th>
                <th scope="col">Robot</th>
                <th scope="col">Ended</th>
                <th scope="col">State</th>
                <th scope="col">Runs</th>
                <th scope="col">Why</th>
                <th scope="col">By</th>
              </tr>
            </thead>
            <tbody>
              {ended.map((each) => (
                <tr key={each.experiment_id}>
                  <th scope="row">{each.experiment_id}</th>
                  <td>
                    <a href={link_to(each.experiment_id)}>{each.name}</a>
                  </td>
                  <td>{each.robot_id}</td>
                  <td class="moment">{each.ended_at_us === null ? '–' : moment_text(each.ended_at_us)}</td>
                  <td>
                    <span class={`state ${each.state}`}>{kStates[each.state]}</span>
                  </td>
                  <td>
                    {each.run_counts['done'] ?? 0} of {each.runs_planned}
                  </td>
                  <td class="why" title={each.detail ?? ''}>
                    {end_text(each.reason)}
                  </td>
                  <td>{who(each.owner, me)}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {!is_last.value && pages.value.length > 0 && (
        <button
          type="button"
          id="older"
          disabled={is_asking.value || !is_live}
          onClick={() => void load(pages.value.at(-1)?.experiment_id ?? null)}
        >
          Older
        </button>
      )}
    </section>
  );
}
