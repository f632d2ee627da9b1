// Health: each thing that can go wrong in a line, with one word and what to do.

import { GuardedButton } from '../../parts/hold_button';
import { useActs } from '../experiments/acts';
import { useHealth, type Context } from './facts';
import { lead_of } from './health';
import { exact_text, moment_text } from './moments';
import { Panel, Problem, WordMark } from './parts';

const kGroups = ['Recording', 'Robots and stop', 'Station'] as const;

export function HealthView({ context }: { context: Context }) {
  const lines = useHealth(context);
  const { facts, is_current, is_utc } = context;
  const as_of = facts ? moment_text(facts.asked_at_ms * 1000, is_utc, true).slice(11) : '';
  return (
    <div id="station-health" class={is_current ? '' : 'was'}>
      <p class="station-lead" role="status">
        {!facts
          ? 'Asking the station…'
          : !is_current
            ? `What was so at ${as_of}. Nothing is known of now.`
            : lead_of(lines)}
      </p>
      <Losses context={context} />
      <div class="station-health">
        {kGroups.map((group) => (
          <Panel key={group} id={`station-health-${group.split(' ')[0]?.toLowerCase()}`} title={group}>
            <table class="station-table station-health-table">
              <thead class="unseen">
                <tr>
                  <th scope="col">What</th>
                  <th scope="col">Is it well?</th>
                  <th scope="col">Now</th>
                  <th scope="col">What it means, or what to do</th>
                </tr>
              </thead>
              <tbody>
                {lines
                  .filter((line) => line.group === group)
                  .map((line) => (
                    <tr key={line.name} id={`station-line-${line.name}`} data-word={line.word} class={line.word}>
                      <th scope="row">{line.title}</th>
                      <td class="word">
                        <WordMark word={line.word} />
                      </td>
                      <td class="value">{line.value}</td>
                      <td class="note">{line.note}</td>
                    </tr>
                  ))}
              </tbody>
            </table>
          </Panel>
        ))}
      </div>
    </div>
  );
}

// What the database has lost stands here until an admin has seen to it.
function Losses({ context }: { context: Context }) {
  const acts = useActs();
  const { session, facts, is_admin } = context;
  const losses = session.station.value?.losses ?? [];
  if (!facts || losses.length === 0) return null;
  const acknowledge = () =>
    void acts.act('acknowledge', async () => {
      await session.api.acknowledge_losses();
      session.station.value = await session.api.station();
    });
  return (
    <div class="station-warning" id="station-losses">
      <h2>The database has lost recordings</h2>
      <ul>
        {losses.map((loss) => (
          <li key={loss.noticed_at_us}>
            <time>{exact_text(loss.noticed_at_us)}</time> {loss.problem}
          </li>
        ))}
      </ul>
      <p>docs/operations.md, “The database has lost commits”, says what to do. Acknowledge it when that is done.</p>
      {is_admin ? (
        <GuardedButton id="station-acknowledge" disabled={acts.pending.value !== ''} on_held={acknowledge}>
          Hold to acknowledge
        </GuardedButton>
      ) : (
        <p class="quiet">An admin acknowledges it.</p>
      )}
      <Problem text={acts.problem.value} />
    </div>
  );
}
