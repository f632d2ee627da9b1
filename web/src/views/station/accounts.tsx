// Accounts: who signs in with a password, in which role; one more, another role or password, out; and one-time links.

import { useSignal } from '@preact/signals';
import type { User } from '../../api';
import { Choice } from '../../parts/choice';
import { GuardedButton } from '../../parts/hold_button';
import { useActs, useAsked, type Acts } from '../experiments/acts';
import type { Context } from './facts';
import { Copyable, Field, ForAdmins, Nothing, Panel, Problem, When } from './parts';
import { QrCode } from './qr_code';
import { made_password, password_problem, user_body, type LoginLink, type UserChange } from './station_api';

type Role = User['role'];
const kRoles: readonly { value: Role; text: string }[] = [
  { value: 'viewer', text: 'viewer: sees everything, stops every robot' },
  { value: 'operator', text: 'operator: commands, makes runs and exports' },
  { value: 'admin', text: 'admin: manages the station as well' },
];
const kLook_ms = 10_000;
const suggest = () => made_password((into) => crypto.getRandomValues(into));

export function Accounts({ context }: { context: Context }) {
  return context.is_admin ? <AllAccounts context={context} /> : <ForAdmins context={context} what="Accounts" />;
}

function AllAccounts({ context }: { context: Context }) {
  const { session, is_current } = context;
  const asked = useAsked(session, session.api.users, [], kLook_ms);
  const acts = useActs();
  const edited = useSignal('');
  const users = asked.answer ?? [];
  const act = async (what: string, request: () => Promise<unknown>) => {
    const done = await acts.act(what, request);
    if (done) asked.ask_again();
    return done;
  };
  return (
    <div id="station-accounts" class={is_current ? '' : 'was'}>
      <Problem text={asked.problem} />
      <NewUser context={context} act={act} acts={acts} is_edited={edited.value !== ''} />
      <Panel id="station-users" title="Users">
        {users.length === 0 ? (
          <Nothing is_known={asked.answer !== null}>
            <p>No user yet: people get in by one-time links, each as admin.</p>
            <p class="quiet">Give each person an account, so that the audit says who did what.</p>
          </Nothing>
        ) : (
          <table class="station-table">
            <thead>
              <tr>
                <th scope="col">User</th>
                <th scope="col">Role</th>
                <th scope="col">State</th>
                <th scope="col">Added</th>
                <th scope="col">By</th>
                <th scope="col">
                  <span class="unseen">Change</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {users.map((user) => (
                <Row
                  key={user.name}
                  user={user}
                  context={context}
                  is_open={edited.value === user.name}
                  act={act}
                  acts={acts}
                  on_open={(is_open) => (edited.value = is_open ? user.name : '')}
                />
              ))}
            </tbody>
          </table>
        )}
      </Panel>
      <Links context={context} />
    </div>
  );
}

type Act = (what: string, request: () => Promise<unknown>) => Promise<boolean>;

interface NewUserProps {
  context: Context;
  act: Act;
  acts: Acts;
  is_edited: boolean; // what is refused concerns the one that is changed below
}

function NewUser({ context, act, acts, is_edited }: NewUserProps) {
  const { api, is_current } = context;
  const name = useSignal('');
  const role = useSignal<Role>('operator');
  const password = useSignal('');
  const wrong = useSignal('');
  const added = useSignal<{ name: string; password: string } | null>(null);
  const add = async () => {
    const body = user_body(name.value.trim(), role.value, password.value);
    wrong.value = typeof body === 'string' ? body : '';
    if (typeof body === 'string' || !(await act('add', () => api.add_user(body)))) return;
    added.value = { name: body.name, password: body.password };
    name.value = password.value = '';
  };
  const clear = () => (wrong.value = '');
  return (
    <>
      <form
        class="station-form"
        aria-label="Add a user"
        onSubmit={(event) => {
          event.preventDefault();
          void add();
        }}
      >
        <Field
          id="station-user-name"
          label="Name"
          value={name.value}
          hint="anna"
          max_length={31}
          on_input={(text) => ((name.value = text), clear())}
        />
        <div class="station-field wide">
          <span class="label">Role</span>
          <Choice
            id="station-user-role"
            label="Role"
            options={kRoles}
            value={role.value}
            on_choose={(chosen) => (role.value = chosen as Role)}
          />
        </div>
        <Field
          id="station-user-password"
          label="Password, 8 characters or more"
          value={password.value}
          on_input={(text) => ((password.value = text), clear())}
        />
        <button type="button" id="station-suggest" onClick={() => ((password.value = suggest()), clear())}>
          Suggest
        </button>
        <button type="submit" id="station-add-user" class="primary" disabled={acts.pending.value !== '' || !is_current}>
          Add the user
        </button>
      </form>
      <Problem id="station-user-problem" text={wrong.value || (is_edited ? '' : acts.problem.value)} />
      {added.value && (
        <Password
          id="station-user-added"
          code_id="station-new-password"
          title={`${added.value.name} may sign in`}
          text={added.value.password}
          on_done={() => (added.value = null)}
        />
      )}
    </>
  );
}

function Password(props: { id: string; code_id: string; title: string; text: string; on_done(): void }) {
  return (
    <div class="station-secret" id={props.id} role="status">
      <h2>{props.title}</h2>
      <p>Tell them the password. It is shown only now.</p>
      <Copyable id={props.code_id} label="the password" text={props.text} is_secret />
      <button type="button" onClick={props.on_done}>
        Done
      </button>
    </div>
  );
}

interface RowProps {
  user: User;
  context: Context;
  is_open: boolean;
  act: Act;
  acts: Acts;
  on_open(is_open: boolean): void;
}

function Row({ user, context, is_open, act, acts, on_open }: RowProps) {
  const { is_utc, session } = context;
  const is_me = session.me.value?.user === user.name;
  return (
    <>
      <tr data-user={user.name} class={user.disabled ? 'off' : ''}>
        <th scope="row">
          {user.name} {is_me && <small class="quiet">you</small>}
        </th>
        <td data-label="Role" class="role">
          {user.role}
        </td>
        <td data-label="State">{user.disabled ? <span class="caution">may not sign in</span> : 'may sign in'}</td>
        <td data-label="Added">
          <When at_us={user.made_at_us} is_utc={is_utc} />
        </td>
        <td data-label="By">{user.made_by}</td>
        <td class="station-acts">
          <button
            type="button"
            aria-expanded={is_open}
            aria-label={`${is_open ? 'Close' : 'Change'} ${user.name}`}
            onClick={() => on_open(!is_open)}
          >
            {is_open ? 'Close' : 'Change…'}
          </button>
        </td>
      </tr>
      {is_open && (
        <tr class="station-edit">
          <td colSpan={6}>
            <Edit key={user.name} user={user} context={context} act={act} acts={acts} on_done={() => on_open(false)} />
          </td>
        </tr>
      )}
    </>
  );
}

interface EditProps {
  user: User;
  context: Context;
  act: Act;
  acts: Acts;
  on_done(): void;
}

function Edit({ user, context, act, acts, on_done }: EditProps) {
  const { api, session, is_current } = context;
  const { name } = user;
  const role = useSignal<Role>(user.role);
  const password = useSignal('');
  const wrong = useSignal('');
  const is_new_role = role.value !== user.role;
  const is_off = acts.pending.value !== '' || !is_current;
  const saved = useSignal(''); // the new password, shown until "Done"
  const change = async (what: UserChange) => {
    if (!(await act('change', () => api.change_user(name, what)))) return;
    if (what.password === undefined) on_done();
    else saved.value = what.password;
  };
  if (saved.value !== '')
    return (
      <Password
        id="station-user-changed"
        code_id="station-changed-password"
        title={`${name} has a new password`}
        text={saved.value}
        on_done={on_done}
      />
    );
  const save = () => {
    wrong.value = password.value === '' ? '' : password_problem(password.value);
    if (wrong.value) return;
    void change({
      ...(is_new_role ? { role: role.value } : {}),
      ...(password.value === '' ? {} : { password: password.value }),
    });
  };
  return (
    <form
      class="station-form"
      aria-label={`Change ${name}`}
      onSubmit={(event) => {
        event.preventDefault();
        save();
      }}
    >
      <div class="station-field wide">
        <span class="label">Role</span>
        <Choice
          id="station-edit-role"
          label={`Role of ${name}`}
          options={kRoles}
          value={role.value}
          on_choose={(chosen) => (role.value = chosen as Role)}
        />
      </div>
      <Field
        id="station-edit-password"
        label="New password"
        hint="as it is"
        value={password.value}
        on_input={(text) => ((password.value = text), (wrong.value = ''))}
      />
      <button type="button" onClick={() => (password.value = suggest())}>
        Suggest
      </button>
      <button
        type="submit"
        id="station-save-user"
        class="primary"
        disabled={is_off || (!is_new_role && password.value === '')}
      >
        Save
      </button>
      <p class="station-note">
        {password.value !== ''
          ? session.me.value?.user === name
            ? 'A new password signs you out everywhere, on this page too. Keep it before you save: it is not shown again.'
            : `A new password signs ${name} out everywhere. It is shown once more when it is saved.`
          : is_new_role
            ? `Open pages of ${name} come back with the new role.`
            : 'Choose another role, or write a new password.'}
      </p>
      <div class="station-acts">
        <GuardedButton id="station-disable" disabled={is_off} on_held={() => void change({ disabled: !user.disabled })}>
          {user.disabled ? 'Hold to let in again' : 'Hold to keep out'}
        </GuardedButton>
        <GuardedButton
          id="station-remove"
          disabled={is_off}
          on_held={() => void act('remove', () => session.api.remove_user(name)).then((done) => done && on_done())}
        >
          Hold to remove
        </GuardedButton>
      </div>
      <p class="station-note">
        Keeping out ends their sessions. Removing also revokes their tokens and cannot be undone; what they did stays in
        the audit.
      </p>
      <Problem id="station-edit-problem" text={wrong.value || acts.problem.value} />
    </form>
  );
}

// One more page in, as admin, without an account.
function Links({ context }: { context: Context }) {
  const { api, is_utc, is_current } = context;
  const acts = useActs();
  const link = useSignal<LoginLink | null>(null);
  const make = () => void acts.act('link', async () => (link.value = await api.make_login_link()));
  return (
    <Panel id="station-links" title="One-time link">
      <p class="station-note">
        Lets one page in, <b>as admin</b>, within ten minutes and once: for a second screen, or when a password was
        forgotten.
      </p>
      {link.value ? (
        <div class="station-secret" id="station-link" role="status">
          <h2>
            Works once, until <When at_us={link.value.expires_at_us} is_utc={is_utc} />
          </h2>
          <Copyable id="station-link-url" label="the link" text={link.value.url} is_secret />
          <QrCode id="station-link-code" text={link.value.url} label="QR code of the one-time link" />
          <button type="button" onClick={() => (link.value = null)}>
            Done
          </button>
        </div>
      ) : (
        <GuardedButton id="station-make-link" disabled={acts.pending.value !== '' || !is_current} on_held={make}>
          Hold to make a link
        </GuardedButton>
      )}
      <Problem text={acts.problem.value} />
    </Panel>
  );
}
