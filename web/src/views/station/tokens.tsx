// API tokens of scripts: which there are, what each may, a new one, and out.

import { useSignal } from '@preact/signals';
import type { Token } from '../../api';
import { GuardedButton } from '../../parts/hold_button';
import { useActs, useAsked } from '../experiments/acts';
import type { Context } from './facts';
import { Copyable, Field, ForAdmins, Nothing, Panel, Problem, When } from './parts';
import { token_body, type NewToken } from './station_api';

const kLook_ms = 10_000;
const kScopes = [
  { scope: 'read', text: 'see everything' },
  { scope: 'stop', text: 'stop robots' },
  { scope: 'record', text: 'runs, markers, exports; brings read' },
  { scope: 'command', text: 'command robots; brings read and stop' },
  { scope: 'admin', text: 'everything' },
] as const;

export function Tokens({ context }: { context: Context }) {
  return context.is_admin ? <AllTokens context={context} /> : <ForAdmins context={context} what="Tokens" />;
}

function AllTokens({ context }: { context: Context }) {
  const { session, is_current } = context;
  const asked = useAsked(session, session.api.tokens, [], kLook_ms);
  const acts = useActs();
  const tokens = asked.answer ?? [];
  const good = tokens.filter((token) => token.revoked_at_us === null);
  const revoked = tokens.filter((token) => token.revoked_at_us !== null);
  const revoke = (name: string) =>
    void acts.act('revoke', () => session.api.revoke_token(name)).then(() => asked.ask_again());
  const revive = (name: string) =>
    void acts.act('revive', () => session.api.revive_token(name)).then(() => asked.ask_again());
  return (
    <div id="station-tokens" class={is_current ? '' : 'was'}>
      <Problem text={asked.problem} />
      <NewTokenForm context={context} on_made={asked.ask_again} />
      <Problem text={acts.problem.value} />
      <Panel id="station-token-list" title="In force">
        {good.length === 0 ? (
          <Nothing is_known={asked.answer !== null}>
            <p>No token.</p>
            <p class="quiet">
              Scripts on the station’s machine use the file <code>rheonaut.token</code> in its data folder, which has
              every right. Give other scripts a token that may only do what they need.
            </p>
          </Nothing>
        ) : (
          <TokenTable
            tokens={good}
            context={context}
            is_off={acts.pending.value !== '' || !is_current}
            on_revoke={revoke}
            on_revive={revive}
          />
        )}
      </Panel>
      {revoked.length > 0 && (
        <Panel id="station-token-revoked" title="Revoked">
          <TokenTable tokens={revoked} context={context} />
          <p class="station-note">A name is never given twice, since the record of commands names it.</p>
        </Panel>
      )}
    </div>
  );
}

interface TableProps {
  tokens: Token[];
  context: Context;
  is_off?: boolean;
  on_revoke?: (name: string) => void;
  on_revive?: (name: string) => void;
}

function TokenTable({ tokens, context, is_off, on_revoke, on_revive }: TableProps) {
  const { is_utc } = context;
  const now_us = context.session.utc_us();
  return (
    <table class="station-table">
      <thead>
        <tr>
          <th scope="col">Token</th>
          <th scope="col">May</th>
          <th scope="col">Of</th>
          <th scope="col">Made</th>
          <th scope="col">Last used</th>
          <th scope="col">{on_revoke ? 'Runs out' : 'Revoked'}</th>
          {on_revoke && (
            <th scope="col">
              <span class="unseen">Revoke</span>
            </th>
          )}
        </tr>
      </thead>
      <tbody>
        {tokens.map((token) => (
          <tr key={token.name} data-token={token.name}>
            <th scope="row">{token.name}</th>
            <td data-label="May">{token.scopes.replaceAll(',', ', ')}</td>
            <td data-label="Of">{token.owner || 'the station'}</td>
            <td data-label="Made">
              <When at_us={token.made_at_us} is_utc={is_utc} />
            </td>
            <td data-label="Last used">
              {token.last_used_at_us === null ? 'never' : <When at_us={token.last_used_at_us} is_utc={is_utc} />}
            </td>
            <td data-label={on_revoke ? 'Runs out' : 'Revoked'}>
              {!on_revoke ? (
                <When at_us={token.revoked_at_us} is_utc={is_utc} />
              ) : token.expires_at_us === null ? (
                'never'
              ) : token.expires_at_us < now_us ? (
                <span class="caution">has run out</span>
              ) : token.expired_at_us !== null ? (
                <>
                  <span class="caution">
                    refused: at <When at_us={token.expired_at_us} is_utc={is_utc} /> the clock was past its end
                  </span>{' '}
                  <button
                    type="button"
                    id={`station-revive-${token.name}`}
                    disabled={is_off ?? false}
                    onClick={() => on_revive?.(token.name)}
                  >
                    Revive<span class="unseen"> {token.name}</span>
                  </button>
                </>
              ) : (
                <When at_us={token.expires_at_us} is_utc={is_utc} />
              )}
            </td>
            {on_revoke && (
              <td class="station-acts">
                <GuardedButton
                  id={`station-revoke-${token.name}`}
                  disabled={is_off ?? false}
                  on_held={() => on_revoke(token.name)}
                >
                  Hold to revoke<span class="unseen"> {token.name}</span>
                </GuardedButton>
              </td>
            )}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function NewTokenForm({ context, on_made }: { context: Context; on_made(): void }) {
  const { api, is_current } = context;
  const acts = useActs();
  const name = useSignal('');
  const scopes = useSignal<string[]>(['read']);
  const days = useSignal('90');
  const wrong = useSignal('');
  const made = useSignal<NewToken | null>(null);
  const make = () => {
    const body = token_body(name.value.trim(), scopes.value, days.value);
    wrong.value = typeof body === 'string' ? body : '';
    if (typeof body === 'string') return;
    void acts
      .act('make', async () => (made.value = await api.add_token(body)))
      .then((done) => {
        if (!done) return;
        name.value = '';
        on_made();
      });
  };
  const toggle = (scope: string, is_on: boolean) => {
    const chosen = is_on ? [...scopes.value, scope] : scopes.value.filter((other) => other !== scope);
    scopes.value = kScopes.map((each) => each.scope).filter((each) => chosen.includes(each));
    wrong.value = '';
  };
  if (made.value) {
    const { secret } = made.value;
    return (
      <div class="station-secret" id="station-token-made" role="status">
        <h2>Token {made.value.name}</h2>
        <p>This is its secret. It is shown only now, and nobody can read it again.</p>
        <Copyable id="station-token-secret" label="the secret" text={secret} is_secret />
        <p>How a script uses it:</p>
        <Copyable
          id="station-token-use"
          label="the command"
          text={`curl -H 'Authorization: Bearer ${secret}' ${location.origin}/api/v1/station`}
          is_secret
        />
        <button type="button" id="station-token-done" onClick={() => (made.value = null)}>
          Done
        </button>
      </div>
    );
  }
  return (
    <>
      <form
        class="station-form"
        aria-label="Make a token"
        onSubmit={(event) => {
          event.preventDefault();
          make();
        }}
      >
        <Field
          id="station-token-name"
          label="Name"
          hint="logger"
          max_length={31}
          value={name.value}
          on_input={(text) => ((name.value = text), (wrong.value = ''))}
        />
        <fieldset class="station-scopes">
          <legend>It may</legend>
          {kScopes.map(({ scope, text }) => (
            <label key={scope} title={text}>
              <input
                type="checkbox"
                autoComplete="off"
                id={`station-scope-${scope}`}
                checked={scopes.value.includes(scope)}
                onChange={(event) => toggle(scope, event.currentTarget.checked)}
              />
              <span>
                {scope} <small>{text}</small>
              </span>
            </label>
          ))}
        </fieldset>
        <Field
          id="station-token-days"
          label="Days until it runs out"
          hint="never"
          max_length={4}
          value={days.value}
          on_input={(text) => ((days.value = text), (wrong.value = ''))}
        />
        <button
          type="submit"
          id="station-make-token"
          class="primary"
          disabled={acts.pending.value !== '' || !is_current}
        >
          Make the token
        </button>
      </form>
      <Problem id="station-token-problem" text={wrong.value || acts.problem.value} />
    </>
  );
}
