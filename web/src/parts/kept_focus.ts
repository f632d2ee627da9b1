// Where what has the focus goes away or is disabled, the focus stays beside it. On <body> Tab would begin at the top again.

import { useLayoutEffect, useRef } from 'preact/hooks';

// For the element that gets the focus; once it is gone itself, its parent gets it. Never another button: the key that is
// still down would press it.
export function useKeptFocus() {
  const root = useRef<HTMLDivElement>(null);
  const before = root.current;
  const focused = before?.contains(document.activeElement ?? null) ? document.activeElement : null;
  const parent = before?.parentElement ?? null;
  useLayoutEffect(() => {
    if (!focused || (root.current?.contains(focused) && !focused.matches(':disabled'))) return;
    const nearest = root.current ?? parent;
    if (!nearest) return;
    nearest.tabIndex = -1; // by Tab nobody comes to it
    nearest.focus({ preventScroll: true });
  });
  return root;
}
