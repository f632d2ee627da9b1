// Keys that work everywhere on the page. Escape is the emergency stop, whatever has the focus and whatever is open.
//
// What opens on the page is drawn by the page itself: the first Escape would only close a native pop-up (select, datalist,
// date, a list of earlier entries), and the page would never know of it.

import { useLayoutEffect } from 'preact/hooks';

export interface KeyTarget {
  addEventListener(type: 'keydown', listener: (event: KeyboardEvent) => void, options: { capture: boolean }): void;
  removeEventListener(type: 'keydown', listener: (event: KeyboardEvent) => void, options: { capture: boolean }): void;
}

// While an input method composes a word, a browser hides the name of the key.
const kHidden = ['Process', 'Unidentified', 'Dead'];
export const is_escape = (event: KeyboardEvent) =>
  event.key === 'Escape' || (event.code === 'Escape' && kHidden.includes(event.key));

// Calls stop() on each press of Escape. A key that is held down counts once.
// SAFETY: it listens on the window, in the capture phase and before anything else, so nothing can swallow the key first.
export function listen_for_stop_key(target: KeyTarget, stop: () => void): () => void {
  const listener = (event: KeyboardEvent) => {
    if (!is_escape(event)) return;
    if (!event.repeat) stop();
    event.preventDefault();
  };
  target.addEventListener('keydown', listener, { capture: true });
  return () => target.removeEventListener('keydown', listener, { capture: true });
}

// Escape never only closes something: it has stopped the robot already when it comes here, and closes as well.
// It listens from the start: a list that has just opened is not painted yet when the key comes.
export function useCloseOnEscape(close: () => void): void {
  useLayoutEffect(() => {
    const listener = (event: KeyboardEvent) => is_escape(event) && close();
    window.addEventListener('keydown', listener, { capture: true });
    return () => window.removeEventListener('keydown', listener, { capture: true });
  }, []);
}

// A menu of the browser is a native pop-up as well. With Shift it opens all the same, for a developer; a
// touch screen has no Escape, and its menus stay.
export function keep_menus_shut(target: Pick<Window, 'addEventListener'>): void {
  target.addEventListener('contextmenu', (event) => {
    const is_touch = event.pointerType === 'touch';
    if (!is_touch && !event.shiftKey) event.preventDefault();
  });
}

// Calls act() on each press of a key, a button or a finger, wherever it is; it takes none of them away.
export function listen_for_any_press(target: Pick<Window, 'addEventListener'>, act: () => void): void {
  const listener = (event: Event) => {
    if (!(event as KeyboardEvent).repeat) act();
  };
  for (const kind of ['keydown', 'pointerdown'])
    target.addEventListener(kind, listener, { capture: true, passive: true });
}

const kChord_ms = 1500;
const kTakesLetters = 'input, textarea, select, [contenteditable], [role=combobox], [role=listbox]';

// "g" and then the key of a view opens it; not while the focus is where letters belong to something else.
export function listen_for_view_keys(target: KeyTarget, open: (key: string) => boolean): () => void {
  let began_ms = -Infinity;
  const listener = (event: KeyboardEvent) => {
    const at = event.target as Partial<Element> | null;
    const is_ours = !event.ctrlKey && !event.metaKey && !event.altKey && !event.defaultPrevented;
    const is_second = event.timeStamp - began_ms < kChord_ms;
    began_ms = -Infinity;
    if (!is_ours || event.key.length !== 1 || at?.closest?.(kTakesLetters)) return;
    if (is_second && open(event.key)) event.preventDefault();
    else if (event.key === 'g' && !event.repeat) began_ms = event.timeStamp;
  };
  target.addEventListener('keydown', listener, { capture: false });
  return () => target.removeEventListener('keydown', listener, { capture: false });
}

// Of a button that stops. SAFETY: Space never stops; it belongs to the held button and to text, and a button that was
// clicked keeps the focus. Enter presses it, once however long it is held.
export const stop_button_keys = {
  onKeyDown: (event: KeyboardEvent) => {
    if (event.key === ' ' || (event.key === 'Enter' && event.repeat)) event.preventDefault();
  },
  onKeyUp: (event: KeyboardEvent) => {
    if (event.key === ' ') event.preventDefault();
  },
};

// What the page says of its keys.
export const kShortcuts: readonly { keys: string[]; what: string }[] = [
  {
    keys: ['Esc'],
    what: 'Stops the robot that the red button names; without one, every robot. From every field, list and panel; what is open closes as well.',
  },
  {
    keys: ['right button of a gamepad'],
    what: 'The right one of its four (B, circle) stops as Escape does, in every view; not in a hidden page.',
  },
  { keys: ['Space'], what: 'Never stops. It belongs to “Hold to run” and to text; in a replay it plays and pauses.' },
  {
    keys: ['Enter'],
    what: 'Presses the button that has the focus, the stop as well; in a field it sends what was typed.',
  },
  { keys: ['↑', '↓'], what: 'Choose in a list; letters search in it.' },
  {
    keys: ['←', '→', 'Page Up', 'Page Down'],
    what: 'In a replay: the sample before and after; what happened before and after. + and − change its speed.',
  },
  {
    keys: ['Shift', 'right click'],
    what: 'The browser’s own menu. While it is open the browser keeps Escape: press the red button.',
  },
];
export const kFullScreenNote =
  'In full screen a browser keeps Escape for itself: the first press may only leave full screen. Press the red button there.';
