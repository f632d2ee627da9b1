// A run: the name and fluid that a stretch of the recording is known by. Recording itself never stops.

import { useSignal, type Signal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { RunRecord } from '../api';
import { why_no_command } from '../command_reason';
import { clock_time, duration, fluid_text } from '../format';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { draft_of } from '../drafts';
import { Choice } from './choice';
import { ModelLine } from './model_line';
import { OutcomeLine, useAsking } from './request';

export function RunControl({ session, robot }: { session: Session; robot: Robot }) {
  const { store } = session;
  const { robot_id, link } = robot.state.value;
  const asking = useAsking();
  const name = draft_of(session, robot_id, 'run');
  const run = store.runs.value.find((other) => other.robot_id === robot_id);
  const is_current = store.is_current.value;

  const start = (wanted: string, fluid: string) =>
    asking.ask('Run', async () => {
      store.take_run(await session.api.start_run(robot_id, wanted, fluid));
      name.value = null;
    });
  const set_fluid = (fluid: string) =>
    asking.ask('Fluid of the robot', () => session.api.set_fluid(robot_id, fluid === '' ? null : fluid));
  const end = (run_id: number) =>
    asking.ask('End of run', async () => store.take_run(await session.api.end_run(run_id)));

  return (
    <fieldset class={`control run ${run && is_current ? 'engaged' : ''}`}>
      <legend>Run</legend>
      <Interrupted session={session} robot_id={robot_id} />
      {!is_current ? (
        <p class="quiet" id="run-unknown">
          Cut off from the station: whether a run is open is not known.
        </p>
      ) : !run && !store.are_runs_known.value ? (
        <p class="quiet" id="run-unknown">
          Asking the station whether a run is open…
        </p>
      ) : run ? (
        <div class="pair">
          <p class="run-name">
            “{run.name}” <RunTime session={session} started_at_us={run.started_at_us} />
            {run.fluid && <span class="quiet"> in {fluid_text(run.fluid)}</span>}
          </p>
          <button type="button" id="end-run" disabled={asking.pending} onClick={() => void end(run.run_id)}>
            End run
          </button>
        </div>
      ) : (
        <RunForm
          session={session}
          robot={robot}
          name={name}
          disabled={link !== 'connected' || asking.pending}
          on_start={(wanted, fluid) =>
            wanted === '' ? asking.fail('Give the run a name.') : void start(wanted, fluid)
          }
          on_fluid={set_fluid}
        />
      )}
      {is_current && (
        <ModelLine
          session={session}
          robot={robot}
          pending={asking.pending}
          on_send={(fluid) => void set_fluid(fluid)}
        />
      )}
      <OutcomeLine asking={asking} />
    </fieldset>
  );
}

interface RunFormProps {
  session: Session;
  robot: Robot;
  name: Signal<string | null>;
  disabled: boolean;
  on_start(name: string, fluid: string): void;
  on_fluid(fluid: string): Promise<boolean>; // it belongs to the robot
}

function RunForm({ session, robot, name, disabled, on_start, on_fluid }: RunFormProps) {
  const picked = useSignal<string | null>(null); // null: what the robot is in
  const listed = session.fluids.value;
  const known = robot.state.value.fluid ?? '';
  const fluid = picked.value ?? known;
  const reason = listed ? why_no_command(session, robot) : ''; // without a list it is of the run alone
  const names = [...new Set([...(listed?.map((each) => each.fluid) ?? kBuiltInFluids), known])].filter(
    (name) => name !== '',
  );
  const options = [
    ...names.map((name) => ({ value: name, text: fluid_text(name) })),
    { value: '', text: 'fluid not known' },
  ];
  const pick = (next: string) => {
    picked.value = next;
    if (listed) void on_fluid(next).then((taken) => taken || (picked.value = null));
  };
  // Another fluid may have been named since: the robot is in that.
  useEffect(() => void (picked.value = null), [known]);
  return (
    <form
      class="run-form"
      onSubmit={(event) => {
        event.preventDefault();
        on_start((name.value ?? '').trim(), fluid);
      }}
    >
      {/* A browser offers earlier entries in a native list, which would keep the first Escape for itself. */}
      <input
        aria-label="Name of the run"
        id="run-name"
        placeholder="Name"
        autoComplete="off"
        maxLength={200}
        value={name.value ?? ''}
        onInput={(event) => (name.value = event.currentTarget.value)}
      />
      <Choice
        id="run-fluid"
        label="Fluid"
        options={options}
        value={fluid}
        disabled={reason !== ''}
        title={reason}
        on_choose={pick}
      />
      <button type="submit" id="start-run" disabled={disabled}>
        Start run
      </button>
    </form>
  );
}

// The robot's newest run, when the station stopped in it: until it is dismissed, or a new one begins.
function Interrupted({ session, robot_id }: { session: Session; robot_id: string }) {
  const run = session.store.interrupted.value.find((other) => other.robot_id === robot_id);
  if (!run || session.settings.dismissed.names.value.has(session.notice_of(run))) return null;
  return (
    <div class="interrupted-run" id="interrupted-run" role="status">
      <p>
        Run “{run.name}” was interrupted at {clock_time((run.ended_at_us ?? run.started_at_us) / 1000).slice(0, 8)}: the
        station stopped while it was open. {lost(run)}
      </p>
      <button
        type="button"
        id="dismiss-interrupted"
        onClick={() => session.settings.dismissed.add(session.notice_of(run))}
      >
        Dismiss
      </button>
    </div>
  );
}

const lost = (run: RunRecord) =>
  run.samples_lost > 0 ? `${run.samples_lost} of its samples are lost.` : 'Its samples until then are kept.';

const kBuiltInFluids = ['non_newtonian', 'water'];

function RunTime({ session, started_at_us }: { session: Session; started_at_us: number }) {
  void session.store.now_ms.value; // ten times a second
  return <time>{duration((session.utc_us() - started_at_us) / 1000)}</time>;
}
