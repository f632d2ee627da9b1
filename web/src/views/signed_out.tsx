// The one calm screen for a page that the station does not know.

export function SignedOut() {
  return (
    <main class="signed-out">
      <h1>Open the link that the station printed</h1>
      <p>
        This browser is not signed in. The station printed a one-time link when it started; it looks like{' '}
        <code>{location.origin}/login?code=…</code>
      </p>
      <p class="quiet">Nothing can be seen or commanded from here until then.</p>
    </main>
  );
}
