// Robots that may connect: enrol one, put one out of use, refuse one.

import { useSignal } from '@preact/signals';
import type { Enrolment } from '../../api';
import { count } from '../../format';
import { natural_order } from '../../fleet';
import { GuardedButton } from '../../parts/hold_button';
import type { Robot } from '../../robot';
import { format } from '../../route';
import { useActs, useAsked } from '../experiments/acts';
import { Enrolled } from './enrolled';
import type { Context } from './facts';
import { Field, ForAdmins, Nothing, Panel, Problem, When } from './parts';
import { robot_problem, type NewEnrolment } from './station_api';

const kLook_ms = 5000;
const kMostRows = 100;

export function Robots({ context }: { context: Context }) {
  return context.is_admin ? (
    <AllRobots context={context} />
  ) : (
    <ForAdmins context={context} what="Enrolments of robots" />
  );
}

function AllRobots({ context }: { context: Context }) {
  const { session, is_current } = context;
  const asked = useAsked(session, session.api.enrolments, [], kLook_ms);
  const acts = useActs();
  const search = useSignal('');
  const all_shown = useSignal(false);
  const enrolled = useSignal<NewEnrolment | null>(null);
  const robots = [...(asked.answer ?? [])].sort((a, b) => natural_order(a.robot_id, b.robot_id));
  const sought = search.value.trim().toLowerCase();
  const found = robots.filter(({ robot_id }) => robot_id.includes(sought));
  const shown = all_shown.value ? found : found.slice(0, kMostRows);
  const act = (what: string, request: () => Promise<unknown>) =>
    void acts.act(what, request).then(() => asked.ask_again());
  const enrol = async (robot_id: string) => {
    const done = await acts.act('enrol', async () => (enrolled.value = await context.api.enrol(robot_id)));
    asked.ask_again();
    return done;
  };
  return (
    <div id="station-robots" class={is_current ? '' : 'was'}>
      <Problem text={asked.problem} />
      {enrolled.value ? (
        <Enrolled context={context} enrolment={enrolled.value} on_done={() => (enrolled.value = null)} />
      ) : (
        <EnrolForm context={context} is_busy={acts.pending.value !== ''} on_enrol={enrol} />
      )}
      <Problem id="station-robot-problem" text={acts.problem.value} />
      <Panel
        id="station-robot-list"
        title="Robots that may connect"
        tools={
          robots.length > 8 && (
            <input
              id="station-robot-search"
              type="text"
              aria-label="Find a robot"
              placeholder="Find a robot"
              autoComplete="off"
              value={search.value}
              onInput={(event) => (search.value = event.currentTarget.value)}
            />
          )
        }
      >
        {shown.length === 0 ? (
          <Nothing is_known={asked.answer !== null}>
            <p>{robots.length > 0 ? 'No robot is called like that.' : 'No robot yet.'}</p>
            {robots.length === 0 && (
              <p class="quiet">
                A simulated one on the station’s machine needs no enrolment:{' '}
                <code>rheonaut-sim --station {session.station.value?.robots_address ?? 'ADDRESS'} --id sim-1</code>
              </p>
            )}
          </Nothing>
        ) : (
          <table class="station-table">
            <thead>
              <tr>
                <th scope="col">Robot</th>
                <th scope="col">Link</th>
                <th scope="col">Connects by</th>
                <th scope="col">Enrolled</th>
                <th scope="col">By</th>
                <th scope="col">State</th>
                <th scope="col">
                  <span class="unseen">Change</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {shown.map((robot) => (
                <Row
                  key={robot.robot_id}
                  robot={robot}
                  context={context}
                  is_off={acts.pending.value !== '' || !is_current}
                  act={act}
                  on_enrol={(robot_id) => void enrol(robot_id)}
                />
              ))}
            </tbody>
          </table>
        )}
        {shown.length < found.length && (
          <button type="button" onClick={() => (all_shown.value = true)}>
            Show all {count(found.length)}
          </button>
        )}
        <p class="station-note">
          <b>Retired</b>: the stop of all robots leaves it out while it is not connected; its recording stays, and it
          may connect. <b>Revoked</b>: the station refuses it, its connection ends at once, and what it has not sent of
          its samples is given up for good.
        </p>
      </Panel>
    </div>
  );
}

interface FormProps {
  context: Context;
  is_busy: boolean;
  on_enrol(robot_id: string): Promise<boolean>;
}

function EnrolForm({ context, is_busy, on_enrol }: FormProps) {
  const name = useSignal('');
  const wrong = useSignal('');
  const robot = context.session.store.find(name.value.trim());
  const is_here = robot !== undefined && robot !== null && !robot.is_away.value;
  const enrol = async () => {
    const robot_id = name.value.trim();
    wrong.value = robot_problem(robot_id);
    if (wrong.value === '' && (await on_enrol(robot_id))) name.value = '';
  };
  return (
    <>
      <form
        class="station-form"
        aria-label="Enrol a robot"
        onSubmit={(event) => {
          event.preventDefault();
          void enrol();
        }}
      >
        <Field
          id="station-robot-name"
          label="Name of the robot"
          hint="rheo-1"
          max_length={31}
          value={name.value}
          is_wrong={wrong.value !== ''}
          on_input={(text) => {
            name.value = text;
            wrong.value = '';
          }}
        />
        <button type="submit" id="station-enrol" class="primary" disabled={is_busy || !context.is_current}>
          Enrol the robot
        </button>
        <p class="station-note">
          {is_here ? (
            <span class="caution">
              {name.value.trim()} is connected without a token. Once it is enrolled the station refuses it until its
              firmware has the token.
            </span>
          ) : (
            'Makes its token, which is shown once: for a robot beyond the station’s own machine.'
          )}
        </p>
      </form>
      <Problem id="station-enrol-problem" text={wrong.value} />
    </>
  );
}

interface RowProps {
  robot: Enrolment;
  context: Context;
  is_off: boolean;
  act(what: string, request: () => Promise<unknown>): void;
  on_enrol(robot_id: string): void;
}

// SAFETY: that a robot is connected is only said while the page is connected.
export function link_word(known: Robot | undefined, is_current: boolean): string {
  if (!known) return 'never seen';
  if (known.is_away.value) return 'away';
  return is_current ? 'connected' : 'was connected';
}

function Row({ robot, context, is_off, act, on_enrol }: RowProps) {
  const { session, is_utc, is_current } = context;
  const { robot_id, revoked_at_us, retired_at_us } = robot;
  const is_revoked = revoked_at_us !== null;
  const is_retired = (retired_at_us ?? null) !== null;
  const known = session.store.find(robot_id);
  const link = link_word(known, is_current);
  return (
    <tr data-robot={robot_id} class={is_revoked || is_retired ? 'off' : ''}>
      <th scope="row">{known ? <a href={format({ view: 'robot', parts: [robot_id] })}>{robot_id}</a> : robot_id}</th>
      <td data-label="Link" class={link === 'connected' ? 'good' : 'quiet'}>
        {link}
      </td>
      <td data-label="Connects by">{robot.has_token ? 'its token' : 'its name, from this machine only'}</td>
      <td data-label="Enrolled">
        <When at_us={robot.enrolled_at_us} is_utc={is_utc} />
      </td>
      <td data-label="By">{robot.enrolled_by === 'loopback' ? 'itself' : robot.enrolled_by}</td>
      <td data-label="State" class="state">
        {is_revoked && (
          <span class="bad">
            revoked <When at_us={revoked_at_us} is_utc={is_utc} /> by {robot.revoked_by}
          </span>
        )}
        {is_retired && (
          <span class="caution">
            retired <When at_us={retired_at_us ?? null} is_utc={is_utc} /> by {robot.retired_by}
          </span>
        )}
        {!is_revoked && !is_retired && 'in use'}
      </td>
      <td class="station-acts">
        <GuardedButton
          id={`station-retire-${robot_id}`}
          disabled={is_off}
          on_held={() => act('retire', () => session.api.retire_robot(robot_id, !is_retired))}
        >
          {is_retired ? 'Hold to put back' : 'Hold to retire'}
          <span class="unseen"> {robot_id}</span>
        </GuardedButton>
        {is_revoked ? (
          <GuardedButton id={`station-again-${robot_id}`} disabled={is_off} on_held={() => on_enrol(robot_id)}>
            Hold for a new token<span class="unseen"> of {robot_id}</span>
          </GuardedButton>
        ) : (
          <GuardedButton
            id={`station-revoke-${robot_id}`}
            disabled={is_off}
            on_held={() => act('revoke', () => session.api.revoke_robot(robot_id))}
          >
            Hold to revoke<span class="unseen"> {robot_id}</span>
          </GuardedButton>
        )}
      </td>
    </tr>
  );
}
