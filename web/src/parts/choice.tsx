// One of a few words, chosen from a list of our own: a native select would keep the first Escape for itself.
//
// It follows the pattern "select-only combobox" of the ARIA Authoring Practices: the focus stays on the field, and
// aria-activedescendant names the option that the keys are at.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { useCloseOnEscape } from '../keys';

export interface Option {
  value: string;
  text: string;
}

export type Move = { open: boolean; at: number } | 'choose' | null;

// Where a key leads in a list of `size` options. null: the key is none of ours.
export function move(key: string, open: boolean, at: number, size: number, has_alt = false): Move {
  const last = size - 1;
  if (!open)
    return ['ArrowDown', 'ArrowUp', 'Enter', ' ', 'Home', 'End'].includes(key)
      ? { open: true, at: key === 'Home' ? 0 : key === 'End' ? last : at }
      : null;
  switch (key) {
    case 'ArrowDown':
      return { open: true, at: Math.min(last, at + 1) };
    case 'ArrowUp':
      return has_alt ? 'choose' : { open: true, at: Math.max(0, at - 1) };
    case 'Home':
    case 'PageUp':
      return { open: true, at: 0 };
    case 'End':
    case 'PageDown':
      return { open: true, at: last };
    case 'Enter':
    case ' ':
    case 'Tab':
      return 'choose';
    default:
      return null;
  }
}

// The option that typed letters mean, from `at` on and round: one letter again and again goes from match to match.
export function search(options: readonly Option[], typed: string, at: number): number {
  const letters = typed.toLowerCase();
  const is_one_letter = [...letters].every((letter) => letter === letters[0]);
  const sought = is_one_letter ? (letters[0] ?? '') : letters;
  const first = is_one_letter ? at + 1 : at;
  for (let step = 0; step < options.length; ++step) {
    const index = (first + step) % options.length;
    if (options[index]?.text.toLowerCase().startsWith(sought)) return index;
  }
  return at;
}

const kTyping_ms = 700; // letters closer together belong to one word

interface ChoiceProps {
  id: string;
  label: string;
  options: readonly Option[];
  value: string;
  disabled?: boolean;
  title?: string;
  on_choose(value: string): void;
}

export function Choice({ id, label, options, value, disabled = false, title = '', on_choose }: ChoiceProps) {
  const chosen = Math.max(
    0,
    options.findIndex((option) => option.value === value),
  );
  const open = useSignal(false);
  const at = useSignal(chosen);
  const typed = useRef({ text: '', at_ms: -Infinity });
  const list = useRef<HTMLUListElement>(null);
  const option_id = (index: number) => `${id}-${index}`;
  const close = () => (open.value = false);
  const choose = (index: number) => {
    close();
    const option = options[index];
    if (option && option.value !== value) on_choose(option.value);
  };
  const go = (next: number) => {
    at.value = next;
    open.value = true;
  };
  useCloseOnEscape(close);
  useEffect(() => {
    if (!open.value) return;
    list.current?.scrollIntoView({ block: 'nearest' });
    list.current?.children[at.value]?.scrollIntoView({ block: 'nearest' });
  }, [open.value, at.value]);

  const on_key = (event: KeyboardEvent) => {
    if (event.ctrlKey || event.metaKey) return;
    const is_word = typed.current.text !== '' && event.timeStamp - typed.current.at_ms < kTyping_ms;
    if (event.key.length === 1 && (event.key !== ' ' || is_word)) {
      typed.current = { text: (is_word ? typed.current.text : '') + event.key, at_ms: event.timeStamp };
      go(search(options, typed.current.text, open.value ? at.value : chosen));
      return event.preventDefault();
    }
    const next = move(event.key, open.value, open.value ? at.value : chosen, options.length, event.altKey);
    if (next === null) return;
    if (event.key !== 'Tab') event.preventDefault();
    if (next === 'choose') choose(at.value);
    else go(next.at);
  };

  return (
    <div class="choice">
      <button
        type="button"
        id={id}
        role="combobox"
        aria-label={label}
        aria-haspopup="listbox"
        aria-expanded={open.value}
        aria-controls={`${id}-list`}
        aria-activedescendant={open.value ? option_id(at.value) : undefined}
        disabled={disabled}
        title={title}
        onClick={() => (open.value ? close() : go(chosen))}
        onKeyDown={on_key}
        onKeyUp={(event) => event.key === ' ' && event.preventDefault()}
        onBlur={close}
      >
        <span>{options[chosen]?.text ?? ''}</span>
      </button>
      <ul role="listbox" id={`${id}-list`} aria-label={label} hidden={!open.value} ref={list}>
        {options.map((option, index) => (
          // Pressing keeps the focus on the field, so that it does not close before the click.
          <li
            key={option.value}
            id={option_id(index)}
            role="option"
            aria-selected={index === chosen}
            class={index === at.value ? 'at' : ''}
            onPointerDown={(event) => event.preventDefault()}
            onMouseDown={(event) => event.preventDefault()}
            onPointerMove={() => (at.value = index)}
            onClick={() => choose(index)}
          >
            {option.text}
          </li>
        ))}
      </ul>
    </div>
  );
}
