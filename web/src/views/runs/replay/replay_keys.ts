// The keys of a replay. None of them is a key of a robot: each changes what is shown and nothing else.

export type Act =
  | { do: 'toggle' }
  | { do: 'step'; by: 1 | -1 }
  | { do: 'move'; by_s: number }
  | { do: 'jump'; by: 1 | -1 }
  | { do: 'faster'; by: 1 | -1 }
  | { do: 'end'; at: 'first' | 'last' };

type Pressed = Pick<KeyboardEvent, 'key' | 'ctrlKey' | 'metaKey' | 'altKey' | 'shiftKey' | 'defaultPrevented'>;

// null: the key is none of ours. Escape never is: it is the stop's.
export function act_of(pressed: Pressed): Act | null {
  if (pressed.ctrlKey || pressed.metaKey || pressed.altKey || pressed.defaultPrevented) return null;
  switch (pressed.key) {
    case ' ':
      return { do: 'toggle' };
    case 'ArrowRight':
      return pressed.shiftKey ? { do: 'move', by_s: 1 } : { do: 'step', by: 1 };
    case 'ArrowLeft':
      return pressed.shiftKey ? { do: 'move', by_s: -1 } : { do: 'step', by: -1 };
    case 'PageDown':
      return { do: 'jump', by: 1 };
    case 'PageUp':
      return { do: 'jump', by: -1 };
    case '+':
      return { do: 'faster', by: 1 };
    case '-':
      return { do: 'faster', by: -1 };
    case 'Home':
      return { do: 'end', at: 'first' };
    case 'End':
      return { do: 'end', at: 'last' };
    default:
      return null;
  }
}

const kTakesKeys = 'input, textarea, select, [contenteditable], [role=combobox], [role=listbox]';
const kTakesSpace = 'button, a, summary, label';
const kScrolls = 'ol, pre, [role=region]'; // where it has the focus
const kScrollKeys = ['PageUp', 'PageDown', 'Home', 'End', ' '];

// Whether what has the focus keeps the key for itself: a field its keys, a list those that scroll it, a button Space.
export function is_taken(target: Partial<Element> | null, key: string): boolean {
  const is_within = (list: string) => Boolean(target?.closest?.(list));
  if (is_within(kTakesKeys)) return true;
  return (kScrollKeys.includes(key) && is_within(kScrolls)) || (key === ' ' && is_within(kTakesSpace));
}
