// Reservations of robots: the next days as bars, the list, and the form that makes one.

import { useSignal } from '@preact/signals';
import { account_of, type Reservation } from '../../experiments_api';
import { Choice } from '../../parts/choice';
import type { ViewProps } from '../table';
import { may_command, useActs, useAsked } from './acts';
import { DayBars } from './day_bars';
import { day_text, moment_text, parse_slot, type SlotText } from './slot_time';
import { who } from './words';

const kLook_ms = 5000;

export function Reservations({ session }: ViewProps) {
  const { store, experiments } = session;
  const asked = useAsked(session, experiments.reservations, [], kLook_ms);
  const acts = useActs();
  const me = store.actor.value;
  const account = account_of(me);
  const is_admin = session.me.value?.role === 'admin';
  const commands = may_command(session);
  const reservations = asked.answer ?? [];
  const cancel = (reservation: Reservation) =>
    void acts
      .act('cancel', () => experiments.cancel_reservation(reservation.reservation_id))
      .then((done) => done && asked.ask_again());
  return (
    <div class="reservations">
      {asked.problem !== '' && (
        <p class="problem" role="alert">
          {asked.problem}
        </p>
      )}
      {!store.is_current.value && (
        <p class="problem" role="status">
          Cut off from the station: this is what was known last.
        </p>
      )}
      {commands ? (
        <ReserveForm session={session} is_admin={is_admin} on_made={asked.ask_again} />
      ) : (
        <p class="quiet">To reserve a robot needs the role operator.</p>
      )}
      <section aria-label="The next seven days">
        <h2>The next seven days</h2>
        <DayBars
          reservations={reservations}
          robots={store.robots.value.map((each) => each.robot_id)}
          account={account}
          now_ms={session.utc_us() / 1000}
        />
      </section>
      <section aria-label="Reservations" id="reservations">
        <h2>Reservations</h2>
        <p class="problem" role="alert" id="reservation-problem">
          {acts.problem.value}
        </p>
        {reservations.length === 0 && (
          <p class="quiet empty">{asked.answer === null ? 'Asking the station…' : 'No robot is reserved.'}</p>
        )}
        <ul class="reservation-list">
          {reservations.map((each) => (
            <li key={each.reservation_id} data-reservation={each.reservation_id}>
              <b>{each.robot_id}</b>
              <span class="moment">
                {moment_text(each.from_us)} to {moment_text(each.until_us)}
              </span>
              <span>
                for {each.holder === account ? 'you' : who(each.holder)}
                {each.purpose !== '' && <span class="quiet">: {each.purpose}</span>}
              </span>
              {commands && (is_admin || each.holder === account) ? (
                <button
                  type="button"
                  aria-label={`Cancel the reservation of ${each.robot_id} from ${moment_text(each.from_us)}`}
                  disabled={acts.pending.value !== ''}
                  onClick={() => cancel(each)}
                >
                  Cancel
                </button>
              ) : (
                <span class="quiet">theirs, or an admin’s, to cancel</span>
              )}
            </li>
          ))}
        </ul>
        <p class="quiet">
          While a reservation runs nobody else commands the robot; everybody may stop it. Experiments of others wait,
          and end before it begins.
        </p>
      </section>
    </div>
  );
}

interface ReserveFormProps {
  session: ViewProps['session'];
  is_admin: boolean;
  on_made(): void;
}

const kNoSlot: SlotText = { from_day: '', from_clock: '', until_day: '', until_clock: '' };

function ReserveForm({ session, is_admin, on_made }: ReserveFormProps) {
  const { store, experiments } = session;
  const acts = useActs();
  const robots = store.robots.value;
  const robot = useSignal('');
  const slot = useSignal(kNoSlot);
  const purpose = useSignal('');
  const holder = useSignal('');
  const wrong = useSignal('');
  const robot_id = robot.value || (store.selected_id.value ?? '');
  const change = (next: Partial<SlotText>) => {
    slot.value = { ...slot.value, ...next };
    wrong.value = '';
  };
  const reserve = () => {
    const found = parse_slot(slot.value, session.utc_us() / 1000);
    if ('problem' in found) {
      wrong.value = found.problem;
      return;
    }
    const { from_ms, until_ms } = found;
    const body = {
      ...(from_ms === null ? {} : { from_us: from_ms * 1000 }),
      until_us: until_ms * 1000,
      purpose: purpose.value.trim(),
      ...(holder.value.trim() === '' ? {} : { holder: account_named(holder.value.trim()) }),
    };
    void acts
      .act('reserve', () => experiments.reserve(robot_id, body))
      .then((done) => {
        if (!done) return;
        slot.value = kNoSlot;
        purpose.value = holder.value = '';
        on_made();
      });
  };
  const field = (id: string, label: string, value: string, hint: string, on_input: (text: string) => void) => (
    <div class="field-of" key={id}>
      <label for={id}>{label}</label>
      <input
        id={id}
        autoComplete="off"
        spellcheck={false}
        placeholder={hint}
        maxLength={200}
        value={value}
        onInput={(event) => on_input(event.currentTarget.value)}
      />
    </div>
  );
  const today = day_text(Date.now());
  return (
    <form
      class="reserve"
      aria-label="Reserve a robot"
      onSubmit={(event) => {
        event.preventDefault();
        reserve();
      }}
    >
      <div class="field-of">
        <span class="label">Robot</span>
        <Choice
          id="reserve-robot"
          label="Robot"
          options={robots.map((each) => ({ value: each.robot_id, text: each.robot_id }))}
          value={robot_id}
          disabled={robots.length === 0}
          on_choose={(value) => (robot.value = value)}
        />
      </div>
      {field('from-day', 'From, day', slot.value.from_day, today, (text) => change({ from_day: text }))}
      {field('from-clock', 'Time', slot.value.from_clock, 'now', (text) => change({ from_clock: text }))}
      {field('until-day', 'Until, day', slot.value.until_day, slot.value.from_day || today, (text) =>
        change({ until_day: text }),
      )}
      {field('until-clock', 'Time', slot.value.until_clock, '14:30', (text) => change({ until_clock: text }))}
      {field('purpose', 'Purpose', purpose.value, '', (text) => (purpose.value = text))}
      {is_admin && field('holder', 'For, if not you', holder.value, 'user name', (text) => (holder.value = text))}
      <button
        type="submit"
        id="reserve"
        disabled={acts.pending.value !== '' || robot_id === '' || !store.is_current.value}
      >
        Reserve
      </button>
      <p class="problem" role="alert" id="reserve-problem">
        {wrong.value || acts.problem.value}
      </p>
    </form>
  );
}

// "anna" is the user anna; accounts of other kinds are written as the station names them.
const account_named = (name: string) => (name.includes(':') ? name : `user:${name}`);
