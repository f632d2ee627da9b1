// Step 4: the controller goes to a robot. What will be sent stands beside what the robot reports, number by number.

import { useSignal } from '@preact/signals';
import { ApiError } from '../../api';
import { ControlLine } from '../../parts/control_line';
import { Choice } from '../../parts/choice';
import { clock_time } from '../../format';
import { may_command, useActs, useAsked } from '../experiments/acts';
import { change_design } from './address';
import { compared, sent_form, type Coefficient } from './control_law';
import { discretised_of, plant_doubts_of, type ControllerInForce } from './design_api';
import type { StepProps } from './parts';
import { SendModel } from './send_model';
import { Step } from './step';
import { kMinus, number_text, type StepState } from './words';
import { may_record } from './identify_step';

export function PushStep(props: StepProps) {
  const { session, work, design } = props;
  const { store } = session;
  const robot = store.selected.value;
  const robot_id = robot?.robot_id ?? '';
  const state = robot?.state.value;
  const controller = useAsked(
    session,
    async () =>
      design.controller === null ? null : { id: design.controller, found: await work.api.design(design.controller) },
    [design.controller],
  );
  const kept = controller.answer?.id === design.controller ? (controller.answer?.found ?? null) : null;
  const reported = props.in_force.found;
  const discretised = kept ? discretised_of(kept.document) : null;
  const rows = discretised ? compared(sent_form(discretised), reported?.controller ?? null) : [];
  const is_current = store.is_current.value && reported?.is_current === true && robot?.is_away.value === false;
  const runs_it = rows.length > 0 && rows.every(({ is_same }) => is_same);
  const acts = useActs();
  // What is asked of whom: an answer, or a confirmation, is to this and to nothing else.
  const question = `${robot_id} ${design.controller ?? ''} ${state?.controller_checksum ?? ''}`;
  const asked = useSignal(''); // the question that `acts` is about
  const problem = asked.value === question ? acts.problem.value : '';
  const is_done = runs_it && is_current;
  return (
    <Step
      work={work}
      number={4}
      name="push"
      title="Discretise and send"
      state={push_state({
        design,
        robot_id,
        runs_it,
        is_current,
        pending: acts.pending.value,
        problem,
      })}
    >
      <div class="design-columns">
        <div>
          <RobotList {...props} />
          {robot && may_command(session) && <ControlLine session={session} robot={robot} />}
          <KeepController {...props} />
          {kept && plant_doubts_of(kept.document) !== '' && (
            <p class="design-caution design-note" id="design-push-doubts">
              The model that it was tuned for: {plant_doubts_of(kept.document)}.
            </p>
          )}
          {/* SAFETY: what was confirmed for one robot and controller is not confirmed for another. */}
          <Send
            {...props}
            key={question}
            acts={acts}
            is_auto={state?.mode === 'auto'}
            on_ask={() => (asked.value = question)}
          />
          <SendModel key={`${robot_id} ${design.model ?? ''}`} session={session} work={work} model={props.model} />
          {is_done && (
            <p class="problem" role="alert">
              {problem}
            </p>
          )}
        </div>
        <div>
          {kept === null ? (
            <p class="quiet design-empty">
              {controller.problem !== ''
                ? controller.problem
                : design.controller !== null
                  ? 'The controller is being read…'
                  : 'What will be sent is shown here, beside what the robot runs, when a controller is kept.'}
            </p>
          ) : !discretised ? (
            <p class="quiet design-empty">
              {kept.name} was kept without coefficients: the station discretises it for the robot when it is sent.
            </p>
          ) : (
            <Coefficients
              rows={rows}
              robot_id={robot_id}
              reported={reported}
              is_current={is_current}
              name={`${kept.name} (controller ${kept.design_id})`}
              reason={discretised.reason ?? ''}
            />
          )}
        </div>
      </div>
    </Step>
  );
}

interface PushSituation {
  design: StepProps['design'];
  robot_id: string;
  runs_it: boolean;
  is_current: boolean;
  pending: string;
  problem: string;
}

export function push_state(situation: PushSituation): StepState {
  const { design, robot_id, runs_it, is_current, pending, problem } = situation;
  if (pending !== '' && pending !== 'keep') return { kind: 'running', text: `${pending}…` };
  if (design.controller === null) return { kind: 'needs', text: 'needs a controller that is kept' };
  if (robot_id === '') return { kind: 'needs', text: 'needs a robot' };
  if (runs_it && is_current) return { kind: 'done', text: `${robot_id} runs it, the same bit for bit` };
  if (problem !== '') return { kind: 'failed', text: `failed: ${problem}` };
  if (runs_it) return { kind: 'ready', text: `${robot_id} reported it last; what it runs now is not known` };
  return { kind: 'ready', text: `ready to be sent to ${robot_id}` };
}

// SAFETY: the robot that is chosen here is the one that the stop button names.
function RobotList({ session, design }: StepProps) {
  const { store } = session;
  const robots = store.robots.value;
  const is_unknown = design.robot !== '' && robots.length > 0 && !robots.some((each) => each.robot_id === design.robot);
  const choose = (robot_id: string) => {
    store.select(robot_id);
    change_design({ ...design, robot: robot_id });
  };
  return (
    <div class="design-plant">
      {is_unknown && (
        <p class="problem" role="status">
          The station knows no robot “{design.robot}”. The stop button still names{' '}
          {store.selected_id.value ?? 'all robots'}.
        </p>
      )}
      <span class="design-label">Robot</span>
      <Choice
        id="design-robot"
        label="Robot"
        options={robots.map((each) => ({
          value: each.robot_id,
          text: each.is_away.value ? `${each.robot_id} (away)` : each.robot_id,
        }))}
        value={store.selected_id.value ?? ''}
        disabled={robots.length === 0}
        on_choose={choose}
      />
    </div>
  );
}

function KeepController({ session, work, design, designs, model, tune }: StepProps) {
  const name = useSignal('');
  const { pending, problem, act } = useActs();
  const answer = work.tuning.answer_to(tune?.key);
  const is_ready = answer?.result?.feasible === true && work.dragged.value === null;
  const kept = designs.find(({ design_id }) => design_id === design.controller);
  if (design.controller !== null)
    return (
      <p class="design-note">
        Controller {design.controller}
        {kept && `, “${kept.name}”`}, is what is sent.
      </p>
    );
  const of_model = model && typeof model !== 'string' ? `, ${model.name}` : '';
  const usual = `${number_text(design.crossover_rad_s)} rad/s, ${number_text(design.margin_deg)}°${of_model}`;
  const keep = () =>
    act('keep', async () => {
      const made = await work.api.keep('controller', name.peek().trim() || usual, answer!.job_id!);
      work.kept.value += 1;
      change_design({ ...design, controller: made.design_id, robot: session.store.selected_id.peek() ?? design.robot });
    });
  return (
    <form
      class="design-keep"
      onSubmit={(event) => {
        event.preventDefault();
        if (is_ready) void keep();
      }}
    >
      <input
        id="design-controller-name"
        aria-label="Name of the controller"
        autoComplete="off"
        maxLength={200}
        placeholder={usual}
        value={name.value}
        onInput={(event) => (name.value = event.currentTarget.value)}
      />
      <button
        type="submit"
        id="design-keep-controller"
        disabled={!is_ready || pending.value !== '' || !may_record(session)}
      >
        Keep this controller
      </button>
      <p class="problem" role="alert">
        {problem.value}
      </p>
    </form>
  );
}

interface SendProps extends StepProps {
  acts: ReturnType<typeof useActs>;
  is_auto: boolean;
  on_ask(): void;
}

type Sending = 'sending' | 'restoring';

function Send({ session, work, design, acts, is_auto, on_ask }: SendProps) {
  const { store } = session;
  const robot = store.selected.value;
  const to_confirm = useSignal<Sending | null>(null); // that was refused without a confirmation
  const is_confirmed = useSignal(false);
  const robot_id = robot?.robot_id ?? '';
  const clear = () => {
    to_confirm.value = null;
    is_confirmed.value = false;
  };
  const send = (what: Sending, request: (id: string, is_confirmed: boolean) => Promise<void>) =>
    acts.act(what, async () => {
      // SAFETY: nothing is sent by a page that does not see the present, or to a robot that Escape would not stop.
      if (!store.is_current.peek() || robot_id === '' || store.selected_id.peek() !== robot_id) return;
      on_ask();
      // SAFETY: a tick confirms what it was asked for: sending this one, or restoring the one before.
      const is_this_confirmed = to_confirm.peek() === what && is_confirmed.peek();
      if (!is_this_confirmed) clear();
      try {
        await request(robot_id, is_this_confirmed);
        clear();
      } catch (error) {
        if (error instanceof ApiError && error.reason === 'confirm_required') to_confirm.value = what;
        throw error;
      }
    });
  const push = () =>
    send('sending', async (id, is_confirmed) => {
      const pushed = await work.api.push(id, design.controller!, is_confirmed);
      work.pushed.value = { ...pushed, robot_id: id };
      if (!pushed.verified) throw new Error(`${id} has accepted it and not reported it yet. Look at what it reports.`);
    });
  const restore = () =>
    send('restoring', async (id, is_confirmed) => {
      await work.api.restore(id, is_confirmed);
      work.pushed.value = null;
    });
  const blocked = !store.is_current.value
    ? 'Cut off from the station: nothing can be sent.'
    : !may_command(session)
      ? 'Your role may look and stop. To send needs the role operator.'
      : robot === null
        ? 'Choose a robot.'
        : robot.is_away.value
          ? `${robot_id} is not connected.`
          : acts.pending.value !== ''
            ? 'The robot is asked…'
            : '';
  return (
    <div class="design-send">
      {to_confirm.value && (
        <label class="tick">
          <input
            type="checkbox"
            autoComplete="off"
            id="design-confirm"
            checked={is_confirmed.value}
            onChange={(event) => (is_confirmed.value = event.currentTarget.checked)}
          />
          <span>
            {to_confirm.value === 'sending' ? 'It' : 'The one before'} may use more duty than the controller in force. I
            confirm that.
          </span>
        </label>
      )}
      <button
        type="button"
        class="primary"
        id="design-push"
        disabled={blocked !== '' || design.controller === null}
        aria-describedby="design-push-note"
        onClick={() => void push()}
      >
        Send to {robot_id === '' ? 'the robot' : robot_id}
      </button>
      <button type="button" id="design-restore" disabled={blocked !== ''} onClick={() => void restore()}>
        Bring back the one before
      </button>
      <p class={`design-note ${is_auto ? 'design-caution' : 'quiet'}`} id="design-push-note">
        {blocked ||
          (is_auto
            ? `${robot_id} is in auto: what is sent moves it 1 s later.`
            : `${robot_id} keeps it until it is switched off, and moves only on a command.`)}
      </p>
    </div>
  );
}

interface CoefficientsProps {
  rows: Coefficient[];
  robot_id: string;
  reported: ControllerInForce | null;
  is_current: boolean;
  name: string;
  reason: string;
}

function Coefficients({ rows, robot_id, reported, is_current, name, reason }: CoefficientsProps) {
  const same = rows.filter(({ is_same }) => is_same).length;
  const told = reported?.told_at_us ?? null;
  return (
    <>
      <div class="design-scroll">
        <table class={`design-table ${is_current ? '' : 'stale'}`} id="design-coefficients">
          <caption>{name}</caption>
          <thead>
            <tr>
              <th scope="col">Coefficient</th>
              <th scope="col" class="number">
                To be sent
              </th>
              <th scope="col" class="number">
                {robot_id || 'The robot'} reports
              </th>
              <th scope="col">Bits</th>
            </tr>
          </thead>
          <tbody>
            {rows.map((row) => (
              <tr key={row.name}>
                <th scope="row">{row.name.replaceAll('_', ' ')}</th>
                <td class="number commanded">{float_text(row.sent)}</td>
                <td class="number value">{float_text(row.reported)}</td>
                <td class={row.is_same ? 'quiet' : 'design-caution'}>{row.is_same ? 'same' : 'differ'}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <p class="quiet design-note" id="design-read-back">
        {same} of {rows.length} coefficients are the same bit for bit
        {told !== null && `, as ${robot_id} reported at ${clock_time(told / 1000).slice(0, 8)}`}
        {!is_current && '; what it runs now is not known'}.{reason !== '' && ` ${reason}`}
      </p>
    </>
  );
}

// As few digits as tell one float32 from the next.
export function float_text(value: number | null): string {
  if (value === null) return '–';
  const digits = [6, 7, 8].find((count) => Math.fround(Number(value.toPrecision(count))) === Math.fround(value)) ?? 9;
  return String(Number(value.toPrecision(digits))).replaceAll('-', kMinus);
}
