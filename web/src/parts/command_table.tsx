// The commands of a robot, newest first, each with the time that it took to every stage.

import { useSignal } from '@preact/signals';
import { useEffect, useMemo } from 'preact/hooks';
import type { CommandRecord } from '../api';
import { clock_time, milliseconds_of_us, words } from '../format';
import { sentence } from '../reasons';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { arguments_text, renewals_text } from './log_strip';
import { NewestCommands } from './newest_commands';

export function CommandTable({ session, robot }: { session: Session; robot: Robot }) {
  const { robot_id } = robot;
  const known = useMemo(() => new NewestCommands(robot_id), [robot_id]);
  const problem = useSignal('');
  const tries = useSignal(0);
  const phase = session.phase.value;
  useEffect(() => {
    const { command_listeners } = session.store;
    command_listeners.add(known.report);
    return () => void command_listeners.delete(known.report);
  }, [known]);
  // Again with each connection: what happened before it was reported to nobody here.
  useEffect(() => {
    if (phase !== 'live') return;
    let is_over = false;
    problem.value = '';
    known.ask();
    session.api.robot_commands(robot_id).then(
      (commands) => is_over || known.take_answer(commands),
      (error: Error) => is_over || (problem.value = error.message),
    );
    return () => void (is_over = true);
  }, [known, phase, tries.value]);
  return (
    <>
      {problem.value && (
        <p class="failed" role="alert">
          {problem.value}{' '}
          <button type="button" onClick={() => (tries.value += 1)}>
            Try again
          </button>
        </p>
      )}
      <Commands robot_id={robot_id} commands={known.list.value} is_failed={problem.value !== ''} />
    </>
  );
}

interface CommandsProps {
  robot_id: string;
  commands: readonly CommandRecord[] | null;
  is_failed: boolean;
}

function Commands({ robot_id, commands, is_failed }: CommandsProps) {
  if (commands === null) return is_failed ? null : <p class="quiet">Loading the commands …</p>;
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
      <td>{`${words(command.kind)}${arguments_text(command.arguments)}${renewals_text(command)}`}</td>
      <td>{command.actor}</td>
      <td>{command.reason ? `${command.state}: ${sentence(command.reason)}` : command.state}</td>
      <td class="number">{milliseconds_of_us(command.sent_after_us)}</td>
      <td class="number">{milliseconds_of_us(command.acknowledged_after_us)}</td>
      <td class="number">{milliseconds_of_us(command.verified_after_us)}</td>
    </tr>
  );
}
