// The list of keys, behind a button of the top bar. It takes no focus and closes by its button, Escape or a press elsewhere.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { kFullScreenNote, kShortcuts, useCloseOnEscape } from '../keys';
import { kViews } from '../views/table';

const view_keys = kViews.map(({ key, title }) => ({ keys: ['g', key], what: `Opens ${title}.` }));

export function KeyList() {
  const open = useSignal(false);
  const root = useRef<HTMLSpanElement>(null);
  const close = () => (open.value = false);
  useCloseOnEscape(close);
  useEffect(() => {
    const listener = (event: PointerEvent) => root.current?.contains(event.target as Node) || close();
    addEventListener('pointerdown', listener);
    return () => removeEventListener('pointerdown', listener);
  }, []);
  return (
    <span class="keys" ref={root}>
      <button
        type="button"
        id="show-keys"
        aria-expanded={open.value}
        aria-controls="key-list"
        onClick={() => (open.value = !open.value)}
      >
        Keys
      </button>
      <section class="key-list" id="key-list" aria-label="Keys" hidden={!open.value}>
        <dl>
          {[...kShortcuts, ...view_keys].map(({ keys, what }) => (
            <div key={keys.join()}>
              <dt>
                {keys.map((key) => (
                  <kbd key={key}>{key}</kbd>
                ))}
              </dt>
              <dd>{what}</dd>
            </div>
          ))}
        </dl>
        <p class="caution">{kFullScreenNote}</p>
      </section>
    </span>
  );
}
