// What the sections share: their frame, moments, texts to copy, the switch of the clock, and what is not for everybody.

import { useSignal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { plot_settings } from '../../plots/strips';
import { format } from '../../route';
import { copy_text, kCopiedText } from './copying';
import type { Context } from './facts';
import type { Word } from './health';
import { exact_text, moment_text } from './moments';

interface PanelProps {
  id: string;
  title: string;
  tools?: ComponentChildren;
  children: ComponentChildren;
}

export function Panel({ id, title, tools, children }: PanelProps) {
  return (
    <section class="station-panel" id={id} aria-labelledby={`${id}-title`}>
      <header>
        <h2 id={`${id}-title`}>{title}</h2>
        {tools}
      </header>
      {children}
    </section>
  );
}

export function Problem({ text, id }: { text: string; id?: string }) {
  return text === '' ? null : (
    <p class="station-problem" id={id} role="alert">
      {text}
    </p>
  );
}

// A list that is asked for, or is empty.
export function Nothing({ is_known, children }: { is_known: boolean; children: ComponentChildren }) {
  return <div class="station-nothing">{is_known ? children : <p class="quiet">Asking the station…</p>}</div>;
}

export const WordMark = ({ word, children }: { word: Word; children?: ComponentChildren }) => (
  <span class={`station-word ${word}`}>{children ?? (word === 'unknown' ? 'not known' : word)}</span>
);

// To the minute; exactly when it is pointed at.
export function When({ at_us, is_utc, has_seconds }: { at_us: number | null; is_utc: boolean; has_seconds?: boolean }) {
  if (at_us === null) return <>–</>;
  return (
    <time dateTime={new Date(at_us / 1000).toISOString()} title={exact_text(at_us)}>
      {moment_text(at_us, is_utc, has_seconds)}
    </time>
  );
}

export function ClockSwitch({ is_utc }: { is_utc: boolean }) {
  return (
    <button
      type="button"
      id="station-clock"
      title="The clock of the times below"
      onClick={() => plot_settings.change({ is_utc: !is_utc })}
    >
      {is_utc ? 'UTC' : 'Local time'}
    </button>
  );
}

const kShown_ms = 4000;

// `children`: what the text is called, for the name of its button.
export function Copyable({
  id,
  text,
  label,
  is_secret,
}: {
  id: string;
  text: string;
  label: string;
  is_secret?: boolean;
}) {
  const code = useRef<HTMLElement>(null);
  const said = useSignal('');
  const timer = useRef<ReturnType<typeof setTimeout>>();
  useEffect(() => () => clearTimeout(timer.current), []);
  const copy = async () => {
    const outcome = await copy_text(text, {
      clipboard: navigator.clipboard as Clipboard | undefined, // there is none without HTTPS
      select: () => getSelection()?.selectAllChildren(code.current as HTMLElement),
    });
    said.value = kCopiedText[outcome];
    clearTimeout(timer.current);
    timer.current = setTimeout(() => (said.value = ''), kShown_ms);
  };
  return (
    <div class={`station-copy ${is_secret ? 'secret' : ''}`}>
      <code id={id} ref={code}>
        {text}
      </code>
      <button type="button" id={`copy-${id}`} aria-label={`Copy ${label}`} onClick={() => void copy()}>
        Copy
      </button>
      <output role="status">{said}</output>
    </div>
  );
}

const kMay = {
  viewer: 'A viewer sees everything else and may stop every robot.',
  operator: 'An operator also commands robots, and makes runs and exports.',
  admin: '',
};

// SAFETY: says who may, and nothing of what is there.
export function ForAdmins({ context, what }: { context: Context; what: string }) {
  const me = context.session.me.value;
  if (me === null) return <Nothing is_known={false}>{null}</Nothing>; // who is signed in is not known yet
  const { role } = me;
  return (
    <div class="waiting station-forbidden" id="station-forbidden">
      <h2>{what} are for admins</h2>
      <p>
        You are signed in {me.user ? `as ${me.user}, ` : 'by link, '}
        {role === 'operator' ? 'an operator' : `a ${role}`}. {kMay[role]}
      </p>
      <p>
        Ask an admin of this station. How the station does, everybody sees:{' '}
        <a href={format({ view: 'station', parts: ['health'] })}>Health</a>.
      </p>
    </div>
  );
}

export function Fact({ name, id, children }: { name: string; id?: string; children: ComponentChildren }) {
  return (
    <div id={id}>
      <dt>{name}</dt>
      <dd>{children}</dd>
    </div>
  );
}

interface FieldProps {
  id: string;
  label: string;
  value: string;
  hint?: string;
  max_length?: number;
  is_wrong?: boolean;
  on_input(text: string): void;
}

// Plain text always: a field for passwords opens a list of the browser's own, which keeps the first Escape.
export function Field({ id, label, value, hint, max_length = 200, is_wrong, on_input }: FieldProps) {
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
        maxLength={max_length}
        aria-invalid={is_wrong ? true : undefined}
        value={value}
        onInput={(event) => on_input(event.currentTarget.value)}
      />
    </div>
  );
}
