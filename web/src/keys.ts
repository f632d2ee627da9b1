// Keys that work everywhere on the page. Escape is the emergency stop, also inside an input field.

export interface KeyTarget {
  addEventListener(type: 'keydown', listener: (event: KeyboardEvent) => void, options: { capture: boolean }): void;
  removeEventListener(type: 'keydown', listener: (event: KeyboardEvent) => void, options: { capture: boolean }): void;
}

// Calls stop() on each press of Escape. It listens before anything else on the page can swallow the key; a key that is
// held down counts once.
export function listen_for_stop_key(target: KeyTarget, stop: () => void): () => void {
  const listener = (event: KeyboardEvent) => {
    if (event.key !== 'Escape') return;
    event.preventDefault();
    if (!event.repeat) stop();
  };
  target.addEventListener('keydown', listener, { capture: true });
  return () => target.removeEventListener('keydown', listener, { capture: true });
}
