// The audit: who did what, when, from where, and what came of it; newest first. What is looked for stands in the address.

import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { count } from '../../format';
import { Choice } from '../../parts/choice';
import { change_query } from '../../route';
import { act_of, action_text, AuditList, detail_text, is_refusal, kind_of, kKinds } from './audit_list';
import type { Context } from './facts';
import { exact_text } from './moments';
import { Copyable, ForAdmins, Nothing, Panel, Problem, When } from './parts';
import type { AuditEntry } from './station_api';

const kLook_ms = 5000;
const kTyping_ms = 300;
const kActions = [{ value: '', text: 'any action' }, ...kKinds.map((kind) => ({ value: kind, text: kind }))];

export function Audit({ context }: { context: Context }) {
  return context.is_admin ? <Entries context={context} /> : <ForAdmins context={context} what="The audit’s entries" />;
}

function Entries({ context }: { context: Context }) {
  const { session, api, query, is_current } = context;
  const list = useMemo(() => new AuditList(api.audit), []);
  const is_live = session.phase.value === 'live';
  const { actor = '', action = '', robot = '' } = query;
  useEffect(() => {
    if (!is_live) return;
    void list.begin({ actor, action, robot_id: robot });
    const timer = setInterval(() => void list.refresh(), kLook_ms);
    return () => {
      clearInterval(timer);
      list.stop();
    };
  }, [is_live, actor, action, robot]);
  const entries = list.entries.value;
  const is_filtered = actor !== '' || action !== '' || robot !== '';
  return (
    <div id="station-audit" class={is_current ? '' : 'was'}>
      <search class="station-form station-filters">
        <div class="station-field">
          <span class="label">Action</span>
          <Choice
            id="station-audit-action"
            label="Action"
            options={
              kActions.some(({ value }) => value === action)
                ? kActions
                : [...kActions, { value: action, text: action_text(action) }]
            }
            value={action}
            on_choose={(chosen) => change_query({ action: chosen })}
          />
        </div>
        <Filter name="actor" label="Who, in full" hint="user:anna/session:4" value={actor} />
        <Filter name="robot" label="Robot" hint="any" value={robot} />
        {is_filtered && (
          <button
            type="button"
            id="station-audit-all"
            onClick={() => change_query({ actor: '', action: '', robot: '' })}
          >
            Show all
          </button>
        )}
      </search>
      <Problem id="station-audit-problem" text={list.problem.value} />
      {entries.length === 0 ? (
        <Nothing is_known={list.is_known.value && !list.is_busy.value}>
          <p>{is_filtered ? 'No entry is like that.' : 'No entry yet.'}</p>
          {is_filtered && <p class="quiet">Write in full who it was: a press on a name in the list fills it in.</p>}
        </Nothing>
      ) : (
        <Table entries={entries} context={context} />
      )}
      <p class="station-more">
        {list.next.value !== null && (
          <button
            type="button"
            id="station-audit-older"
            disabled={list.is_busy.value}
            onClick={() => void list.older()}
          >
            {list.is_busy.value ? 'Asking…' : 'Older entries'}
          </button>
        )}
        <span class="quiet" role="status">
          {entries.length > 0 && `${count(entries.length)} shown${list.next.value === null ? ', which is all' : ''}`}
        </span>
      </p>
      {list.head.value && (
        <Panel id="station-audit-head" title="Head of the chain">
          <p class="station-note">
            Each entry has a hash over all before it. Keep this head elsewhere, and it proves later that no entry before
            it was changed:
          </p>
          <Copyable id="station-head" label="the head" text={list.head.value} />
          <Copyable
            id="station-verify"
            label="the command that verifies"
            text={`rheonaut verify --audit --data FOLDER --expect ${list.head.value}`}
          />
        </Panel>
      )}
    </div>
  );
}

// It is looked for when the typing rests, or at once with Enter.
function Filter({ name, label, hint, value }: { name: string; label: string; hint: string; value: string }) {
  const typed = useSignal<string | null>(null);
  const timer = useRef<ReturnType<typeof setTimeout>>();
  const apply = (text: string) => {
    clearTimeout(timer.current);
    typed.value = null;
    change_query({ [name]: text.trim() });
  };
  useEffect(() => () => clearTimeout(timer.current), []);
  const id = `station-audit-${name}`;
  return (
    <div class="station-field">
      <label for={id}>{label}</label>
      <input
        id={id}
        type="text"
        autoComplete="off"
        autocapitalize="none"
        spellcheck={false}
        placeholder={hint}
        value={typed.value ?? value}
        onInput={(event) => {
          const text = event.currentTarget.value;
          typed.value = text;
          clearTimeout(timer.current);
          timer.current = setTimeout(() => apply(text), kTyping_ms);
        }}
        onKeyDown={(event) => event.key === 'Enter' && apply(event.currentTarget.value)}
        onBlur={(event) => typed.value !== null && apply(event.currentTarget.value)}
      />
    </div>
  );
}

function Table({ entries, context }: { entries: AuditEntry[]; context: Context }) {
  const open = useSignal<number | null>(null);
  return (
    <table class="station-table station-audit-table">
      <thead>
        <tr>
          <th scope="col">Time</th>
          <th scope="col">Who</th>
          <th scope="col">Did</th>
          <th scope="col">Of</th>
          <th scope="col">More</th>
          <th scope="col" class="number">
            Entry
          </th>
        </tr>
      </thead>
      <tbody>
        {entries.map((entry) => (
          <Row
            key={entry.entry}
            entry={entry}
            is_utc={context.is_utc}
            is_open={open.value === entry.entry}
            on_open={() => (open.value = open.value === entry.entry ? null : entry.entry)}
          />
        ))}
      </tbody>
    </table>
  );
}

interface RowProps {
  entry: AuditEntry;
  is_utc: boolean;
  is_open: boolean;
  on_open(): void;
}

function Row({ entry, is_utc, is_open, on_open }: RowProps) {
  const { actor, action, robot_id, subject } = entry;
  return (
    <>
      <tr data-entry={entry.entry} data-action={action} class={is_refusal(action) ? 'refused' : ''}>
        <td class="time">
          <When at_us={entry.at_us} is_utc={is_utc} has_seconds />
        </td>
        <td data-label="Who">
          <button
            type="button"
            class="station-link"
            title="Show only this one’s"
            onClick={() => change_query({ actor })}
          >
            {actor || 'nobody said'}
          </button>
        </td>
        <td data-label="Did" class="action">
          <span class="quiet">{kind_of(action)}</span> {act_of(action)}
        </td>
        <td data-label={robot_id || subject ? 'Of' : undefined}>
          {robot_id !== '' && (
            <button
              type="button"
              class="station-link"
              title="Show only this robot’s"
              onClick={() => change_query({ robot: robot_id })}
            >
              {robot_id}
            </button>
          )}{' '}
          {subject}
        </td>
        <td class="detail">{detail_text(entry.detail, is_utc)}</td>
        <td class="number">
          <button
            type="button"
            class="station-link"
            aria-expanded={is_open}
            aria-label={`Entry ${entry.entry} in full`}
            onClick={on_open}
          >
            {entry.entry}
          </button>
        </td>
      </tr>
      {is_open && (
        <tr class="station-edit">
          <td colSpan={6}>
            <dl class="facts">
              <div>
                <dt>Exact time</dt>
                <dd>{exact_text(entry.at_us)}</dd>
              </div>
              <div>
                <dt>From</dt>
                <dd>{entry.peer || 'no address'}</dd>
              </div>
              <div>
                <dt>Detail</dt>
                <dd>
                  <code>{JSON.stringify(entry.detail)}</code>
                </dd>
              </div>
              <div>
                <dt>Hash</dt>
                <dd>
                  <code>{entry.hash}</code>
                </dd>
              </div>
            </dl>
          </td>
        </tr>
      )}
    </>
  );
}
