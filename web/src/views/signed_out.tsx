// The one calm screen for a page that the station does not know: a one-time link, or user and password.

import { useSignal } from '@preact/signals';
import type { Session } from '../session';

const MakeLink = () => (
  <p>
    <code>rheonaut login-link --data FOLDER</code>
  </p>
);

// The station answers a link that is no longer valid with this page, at the link's own address.
function OldLink() {
  return (
    <>
      <h1>This link is no longer valid</h1>
      <p>
        A link signs one browser in, once, and only within 10 minutes. On the station’s machine this makes a new one:
      </p>
      <MakeLink />
    </>
  );
}

function NoLink() {
  return (
    <>
      <h1>Open the link that the station printed</h1>
      <p>
        This browser is not signed in. The station printed a one-time link when it started; it looks like{' '}
        <code>{location.origin}/login?code=…</code>. On the station’s machine this makes another:
      </p>
      <MakeLink />
    </>
  );
}

export function SignedOut({ session }: { session: Session }) {
  const user = useSignal('');
  const password = useSignal('');
  const pending = useSignal(false);
  const error = useSignal('');

  const sign_in = async () => {
    pending.value = true;
    error.value = '';
    try {
      await session.log_in(user.value.trim(), password.value);
      if (location.pathname === '/login') history.replaceState(null, '', '/'); // a reload does not ask for the old link
    } catch (failure) {
      error.value = failure instanceof Error ? failure.message : String(failure);
      password.value = '';
    }
    pending.value = false;
  };

  return (
    <main class="signed-out">
      {location.pathname === '/login' ? <OldLink /> : <NoLink />}
      <form
        aria-label="Sign in"
        onSubmit={(event) => {
          event.preventDefault();
          void sign_in();
        }}
      >
        <h2>Or sign in</h2>
        <label for="user">User</label>
        <input
          id="user"
          name="username"
          autocomplete="username"
          autocapitalize="none"
          spellcheck={false}
          required
          maxLength={31}
          value={user.value}
          onInput={(event) => (user.value = event.currentTarget.value)}
        />
        <label for="password">Password</label>
        <input
          id="password"
          name="password"
          type="password"
          autocomplete="current-password"
          required
          maxLength={200}
          value={password.value}
          onInput={(event) => (password.value = event.currentTarget.value)}
        />
        <button type="submit" id="sign-in" class="primary" disabled={pending.value}>
          {pending.value ? 'Signing in…' : 'Sign in'}
        </button>
        <p id="sign-in-error" class="sign-in-error" role="alert">
          {error.value}
        </p>
      </form>
      <p class="quiet">Nothing can be seen or commanded from here until then.</p>
    </main>
  );
}
