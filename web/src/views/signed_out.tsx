// The one calm screen for a page that the station does not know: a one-time link, or user and password.

import { useSignal } from '@preact/signals';
import type { Session } from '../session';

const MakeLink = () => (
  <p>
    <code>rheonaut login-link --data FOLDER</code>
  </p>
);

// The code of the one-time link at which the page was opened.
export const link_code = () =>
  location.pathname === '/login' ? new URLSearchParams(location.search).get('code') : null;

// Only a press redeems the link; opening it does not.
function UseLink({ session, code }: { session: Session; code: string }) {
  const pending = useSignal(false);
  const error = useSignal('');
  const redeem = async () => {
    pending.value = true;
    try {
      await session.api.redeem_link(code);
      location.replace('/');
    } catch (failure) {
      error.value = failure instanceof Error ? failure.message : String(failure);
      pending.value = false;
    }
  };
  return (
    <>
      <h1>Sign this browser in</h1>
      <p>The link works once, within 10 minutes, and signs in as admin.</p>
      <button id="use-link" class="primary" disabled={pending.value} onClick={() => void redeem()}>
        Sign in with this link
      </button>
      <p id="link-error" class="sign-in-error" role="alert">
        {error.value}
      </p>
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
  const code = link_code();

  const sign_in = async () => {
    pending.value = true;
    error.value = '';
    try {
      await session.log_in(user.value.trim(), password.value);
      if (code !== null) location.replace('/'); // a reload does not ask for the link
    } catch (failure) {
      error.value = failure instanceof Error ? failure.message : String(failure);
      password.value = '';
    }
    pending.value = false;
  };

  return (
    <main class="signed-out">
      {code === null ? <NoLink /> : <UseLink session={session} code={code} />}
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
