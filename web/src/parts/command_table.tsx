// The commands of a robot, newest first, each with the time that it took to every stage.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { CommandRecord } from '../api';
import { clock_time, milliseconds_of_us, words } from '../format';
import { sentence } from '../reasons';
import type { Robot } from '../robot';
import type { Session } from '../session';
import type { LogLine } from '../store';
import { arguments_text } from './log_strip';

export function CommandTable({ session, robot }: { session: Session; robot: Robot }) {
  const loaded = useSignal<CommandRecord[] | null>(null);
  const problem = useSignal('');
  const { robot_id } = robot;
  const load = () => {
    problem.value = '';
    session.api.robot_commands(robot_id).then(
      (commands) => (loaded.value = commands),
      (error: Error) => (problem.value = error.message),
    );
  };
  useEffect(load, []);
  if (problem.value) {
    return (
      <p class="failed" role="alert">
        {problem.value}{' '}
        <button type="button" onClick={load}>
          Try again
        </button>
      </p>
    );
  }
  if (loaded.value === null) return <p class="quiet">Loading the commands …</p>;
  const commands = newest_of(loaded.value, session.store.log.value, robot_id);
  if (commands.length === 0) return <p class="quiet">Nobody has commanded {robot_id} yet.</p>;
  return (
    <div class="command-table" tabIndex={0} role="region" aria-label={`Commands of ${robot_id}, newest first`}>
      <table>
        <thead>
          <tr>
            <th scope="col">Time</th>
            <th scope="col">Command</th>
            <th scope="col">By</th>
            <th scope="col">State</th>
            <th scope="col" class="number" title="From the request until the frame was written to the robot">
              sent, ms
            </th>
            <th scope="col" class="number" title="From the request until the robot's answer">
              acknowledged
            </th>
            <th scope="col" class="number" title="From the request until telemetry showed the effect">
              seen
            </th>
          </tr>
        </thead>
        <tbody>
          {commands.map((command) => (
            <Row key={command.command_id} command={command} />
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Row({ command }: { command: CommandRecord }) {
  const is_bad = ['rejected', 'expired', 'failed', 'unknown'].includes(command.state);
  const tone = command.kind === 'emergency_stop' ? 'alarm' : is_bad ? 'caution' : '';
  return (
    <tr class={tone}>
      <td>
        <time>{clock_time(command.submitted_at_us / 1000)}</time>
      </td>
      <td>{`${words(command.kind)}${arguments_text(command.arguments)}`}</td>
      <td>{command.actor}</td>
      <td>{command.reason ? `${command.state}: ${sentence(command.reason)}` : command.state}</td>
      <td class="number">{milliseconds_of_us(command.sent_after_us)}</td>
      <td class="number">{milliseconds_of_us(command.acknowledged_after_us)}</td>
      <td class="number">{milliseconds_of_us(command.verified_after_us)}</td>
    </tr>
  );
}

// What was loaded, and what /live has said since; of each command what was said last. Renewals of a lease are left out:
// there are ten a second while a motor runs.
export function newest_of(loaded: CommandRecord[], log: LogLine[], robot_id: string): CommandRecord[] {
  const by_id = new Map<string, CommandRecord>();
  const take = (command: CommandRecord) => {
    if (command.kind !== 'renew_lease' && command.robot_id === robot_id) by_id.set(command.command_id, command);
  };
  loaded.forEach(take);
  for (const { command } of [...log].reverse()) if (command) take(command);
  return [...by_id.values()].sort((one, other) => other.submitted_at_us - one.submitted_at_us);
}
