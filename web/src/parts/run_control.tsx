// A run: the name and fluid that a stretch of the recording is known by. Recording itself never stops.

import { useSignal } from '@preact/signals';
import { duration } from '../format';
import type { Session } from '../session';
import type { Robot } from '../store';
import { OutcomeLine, useAsking } from './request';

export function RunControl({ session, robot }: { session: Session; robot: Robot }) {
  const { robot_id, link } = robot.state.value;
  const name = useSignal('');
  const fluid = useSignal('non_newtonian');
  const asking = useAsking();
  const run = session.store.runs.value.find((other) => other.robot_id === robot_id);

  const start = () =>
    asking.ask('Run', async () => session.store.take_run(await session.api.start_run(robot_id, name.value.trim(), fluid.value)));
  const end = (run_id: number) => asking.ask('End of run', async () => session.store.take_run(await session.api.end_run(run_id)));

  return (
    <fieldset class={`control run ${run ? 'engaged' : ''}`}>
      <legend>Run</legend>
      {run ? (
        <div class="pair">
          <p class="run-name">
            “{run.name}” <RunTime session={session} started_at_us={run.started_at_us} />
          </p>
          <button type="button" id="end-run" disabled={asking.pending} onClick={() => void end(run.run_id)}>
            End run
          </button>
        </div>
      ) : (
        <form
          class="run-form"
          onSubmit={(event) => {
            event.preventDefault();
            if (name.value.trim() === '') return asking.fail('Give the run a name.');
            void start();
          }}
        >
          <input aria-label="Name of the run" id="run-name" placeholder="Name" maxLength={200} value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
          <select aria-label="Fluid" id="run-fluid" value={fluid.value} onChange={(event) => (fluid.value = event.currentTarget.value)}>
            <option value="non_newtonian">non-Newtonian</option>
            <option value="water">water</option>
            <option value="other">other</option>
          </select>
          <button type="submit" id="start-run" disabled={link !== 'connected' || asking.pending}>
            Start run
          </button>
        </form>
      )}
      <OutcomeLine asking={asking} />
    </fieldset>
  );
}

function RunTime({ session, started_at_us }: { session: Session; started_at_us: number }) {
  void session.store.now_ms.value; // ten times a second
  return <time>{duration(Date.now() - started_at_us / 1000)}</time>;
}
