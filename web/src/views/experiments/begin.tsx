// To begin an experiment: choose or write a profile, see what it is predicted to do, look at what it waits for, start.

import { signal, useSignal } from '@preact/signals';
import { useEffect, useLayoutEffect, useMemo, useRef } from 'preact/hooks';
import { ApiError } from '../../api';
import { draft_of } from '../../drafts';
import type { ProfileEntry } from '../../experiments_api';
import { change_query, go_to } from '../../route';
import type { Robot } from '../../robot';
import type { ViewProps } from '../table';
import { may_command, refusal, useActs, useAsked } from './acts';
import { CheckList } from './check_list';
import { checks_of } from './checks';
import { Editor, type TextFault } from './editor';
import { plan_of } from './outlook';
import { Plan } from './plan';
import { kOptions, StartPanel } from './start_panel';
import { how_long, place_of_refusal } from './words';

// What is chosen and typed outlives the view: a person who looks at the robot meanwhile finds it again. What was changed in
// a profile is there again when it is chosen again (drafts.ts).
const draft = signal({ profile: '', original: '', text: '' });
const kOwn = 'own';
const kTyping_ms = 150;
const kLook_ms = 5000;
const kEmptyProfile = `name = "My experiment"
purpose = "What it is to show."

[limits]
position_min_m = -0.2
position_max_m = 0.3

[[step]]
kind = "setpoint"
setpoint_m = 0.05
for_s = 10
`;

export function Begin({ session, route }: ViewProps) {
  const { store } = session;
  const robot = store.selected.value;
  const asked_id = route.query['robot'];
  // SAFETY: the robot that is chosen here is the one that the stop button names. As an address of a robot, this one is
  // followed when it changes, and never because something else has.
  useLayoutEffect(() => {
    if (asked_id !== undefined) store.want(asked_id);
  }, [asked_id]);
  const profiles = useAsked(session, session.experiments.profiles, []);
  const asked_profile = route.query['profile'] ?? '';
  const text = draft.value.text;
  const station_fault = useSignal<TextFault | null>(null);
  const options = useSignal(kOptions);
  const { pending, problem, act } = useActs();

  const changed_in = (profile: string) => draft_of(session, profile, 'profile_text');
  const notes = draft_of(session, '', 'experiment_notes');
  // What was chosen last is shown, however late an earlier choice is answered.
  const chosen = useRef('');
  const choose = async (profile: string) => {
    chosen.current = profile;
    try {
      const document = profile === kOwn ? kEmptyProfile : await session.experiments.profile(profile);
      if (chosen.current !== profile) return;
      draft.value = { profile, original: document, text: changed_in(profile).peek() ?? document };
      station_fault.value = null;
      change_query({ profile });
    } catch (error) {
      if (chosen.current === profile) problem.value = refusal(error);
    }
  };
  useEffect(() => {
    if (asked_profile !== '') chosen.current = asked_profile;
    if (asked_profile !== '' && asked_profile !== draft.peek().profile) void choose(asked_profile);
    else if (asked_profile === '' && draft.peek().profile !== '') change_query({ profile: draft.peek().profile });
  }, [asked_profile]);

  const typed = useSettled(text, kTyping_ms);
  const around = useSurroundings(session, robot);
  const fluid = robot?.state.value.fluid ?? '';
  const plan = useMemo(() => plan_of(typed, { ...around, fluid }), [typed, around.fluids, around.controller, fluid]);
  const fault = station_fault.value ?? (plan.fault && typed === text ? { ...plan.fault, by: 'page' as const } : null);

  const queue = robot ? store.experiments.queue_of(robot.robot_id) : [];
  const at_work = robot ? store.experiments.at_work_on(robot.robot_id) : undefined;
  const checks = robot
    ? checks_of({
        robot: robot.state.value,
        profile: plan.profile,
        duration_s: plan.duration_s,
        me: store.actor.value,
        now_us: session.utc_us(),
        reservations: around.reservations?.filter((each) => each.robot_id === robot.robot_id) ?? null,
        at_work,
        queue,
        priority: options.value.priority,
        newest_run: around.newest_run,
      })
    : [];

  const start = () =>
    act('start', async () => {
      // SAFETY: nothing is begun by a page that does not see the present, or for a robot that Escape would not stop.
      if (!store.is_current.peek() || robot === null || store.selected_id.peek() !== robot.robot_id) return;
      store.keep_selected();
      const { profile, original } = draft.peek();
      const is_shipped = profile !== kOwn && original === text;
      const { priority, is_unattended } = options.peek();
      try {
        const asked_at = store.experiments.mark();
        const begun = await session.experiments.begin({
          robot_id: robot.robot_id,
          profile: is_shipped ? profile : `${text}\n`,
          priority,
          unattended: is_unattended && plan.profile?.is_unattended === true,
          notes: notes.peek() ?? '',
        });
        notes.value = null;
        store.experiments.take_answer([begun], asked_at);
        go_to({ view: 'experiments', parts: [String(begun.experiment_id)] });
      } catch (error) {
        if (!(error instanceof ApiError) || error.reason !== 'profile') throw error;
        station_fault.value = { ...place_of_refusal(error.detail || error.message), by: 'station' };
        throw new ApiError('The station refuses the profile: see its text.', error.status, error.reason);
      }
    });

  return (
    <div class="begin">
      <section class="begin-profile" aria-label="Profile">
        <h2>Profile</h2>
        <ProfileList
          entries={profiles.answer}
          problem={profiles.problem}
          chosen={draft.value.profile}
          on_choose={(profile) => void choose(profile)}
        />
        {text !== '' && (
          <>
            <p class="editor-head">
              <span class="quiet">
                {draft.value.profile !== kOwn && text === draft.value.original
                  ? 'As it comes with the program. It may be changed here.'
                  : 'Changed here; it is stored with the experiment as it is.'}
              </span>
              {text !== draft.value.original && (
                <button type="button" id="undo-text" onClick={() => set_text(draft.value.original)}>
                  Undo changes
                </button>
              )}
            </p>
            <Editor text={text} fault={fault} on_text={set_text} />
          </>
        )}
      </section>
      <section class="begin-plan" aria-label="Prediction">
        <h2>Prediction</h2>
        <Plan plan={plan} fluid={fluid} fluids={around.fluids} controller={around.controller} is_typed={text !== ''} />
      </section>
      <section class="begin-start" aria-label="Start">
        <h2>Robot and start</h2>
        <StartPanel
          session={session}
          robot={robot}
          asked_id={asked_id}
          plan={plan}
          options={options}
          notes={notes}
          waits={checks.some((check) => check.state === 'waits')}
          blocked={blocked_by(text, pending.value)}
          problem={problem.value}
          on_start={() => void start()}
        >
          <CheckList session={session} robot={robot} checks={checks} profile={plan.profile} />
        </StartPanel>
      </section>
    </div>
  );

  function set_text(next: string): void {
    const { profile, original } = draft.peek();
    draft.value = { profile, original, text: next };
    changed_in(profile).value = next === original ? null : next;
    station_fault.value = null;
  }

  function blocked_by(written: string, asked: string): string {
    if (!store.is_current.value) return 'Cut off from the station: nothing can be begun.';
    if (session.me.value === null) return 'Asking the station…';
    if (!may_command(session)) return 'Your role may look and stop. To begin needs the role operator.';
    if (robot === null) return 'Choose a robot.';
    if (written.trim() === '') return 'Choose a profile.';
    return asked === '' ? '' : 'Asking the station…';
  }
}

function ProfileList({
  entries,
  problem,
  chosen,
  on_choose,
}: {
  entries: ProfileEntry[] | null;
  problem: string;
  chosen: string;
  on_choose(profile: string): void;
}) {
  const entry = (key: string, name: string, title: string, note: string) => (
    <li key={key}>
      <button
        type="button"
        id={`profile-${key}`}
        aria-pressed={chosen === key}
        title={title}
        onClick={() => on_choose(key)}
      >
        <span class="name">{name}</span>
        <span class="figure">{note}</span>
      </button>
    </li>
  );
  const purpose = entries?.find((each) => each.profile === chosen)?.purpose;
  return (
    <>
      {problem !== '' && <p class="problem">{problem}</p>}
      {entries === null && problem === '' && <p class="quiet">Asking the station for its profiles…</p>}
      <ul class="profile-list">
        {(entries ?? []).map(({ profile, name, purpose, runs, duration_s }) =>
          entry(profile, name, purpose, `${runs > 1 ? `${runs} × ` : ''}${how_long(duration_s)}`),
        )}
        {entry(kOwn, 'Own profile', 'Write or paste the text of a profile', 'write or paste')}
      </ul>
      {purpose && <p class="purpose">{purpose}</p>}
    </>
  );
}

// The text when nobody has typed for a moment.
function useSettled(text: string, after_ms: number): string {
  const settled = useSignal(text);
  useEffect(() => {
    const timer = setTimeout(() => (settled.value = text), after_ms);
    return () => clearTimeout(timer);
  }, [text]);
  return settled.value;
}

// What a prediction and the check list rest on.
function useSurroundings(session: ViewProps['session'], robot: Robot | null) {
  const { experiments } = session;
  const id = robot?.robot_id ?? '';
  const state = robot?.state.value;
  // What was asked of another robot is not taken for this one's.
  const of_robot = async <Answer,>(ask: (robot_id: string) => Promise<Answer | null>) => ({
    id,
    answer: id === '' ? null : await ask(id),
  });
  const controller = useAsked(session, () => of_robot(experiments.controller), [id, state?.controller_checksum]);
  const fluids = useAsked(session, experiments.fluids, []);
  const newest_run = useAsked(session, () => of_robot(experiments.newest_run), [id], kLook_ms);
  const reservations = useAsked(session, experiments.reservations, [], kLook_ms);
  return {
    controller: controller.answer?.id === id ? controller.answer.answer : null,
    fluids: fluids.answer,
    // What could not be asked again is not known.
    newest_run: newest_run.answer?.id === id && newest_run.problem === '' ? newest_run.answer.answer : undefined,
    reservations: reservations.problem === '' ? reservations.answer : null,
  };
}
