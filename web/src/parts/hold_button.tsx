// Two buttons that are held: one that acts after a second, one that acts while it is down. By pointer or by key.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';

interface HeldProps {
  class?: string;
  disabled?: boolean;
  on_press(): void;
  on_release(): void;
  children: preact.ComponentChildren;
  described_by?: string;
  title?: string;
  id?: string;
}

// Calls on_press once when it goes down and on_release once however the hold ends: let go, slid away by the system,
// key up, focus lost, disabled, or removed from the page.
export function HeldButton({ on_press, on_release, disabled = false, children, described_by, id, ...rest }: HeldProps) {
  const down = useRef(false);
  const release = useRef(on_release);
  release.current = on_release;
  const end = () => {
    if (!down.current) return;
    down.current = false;
    release.current();
  };
  const begin = () => {
    if (down.current || disabled) return;
    down.current = true;
    on_press();
  };
  useEffect(() => end, []);
  useEffect(() => {
    if (disabled) end();
  }, [disabled]);
  const is_press_key = (event: KeyboardEvent) => event.key === ' ' || event.key === 'Enter';
  return (
    <button
      type="button"
      id={id}
      class={rest.class}
      disabled={disabled}
      title={rest.title}
      aria-describedby={described_by}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        begin();
      }}
      onPointerUp={end}
      onPointerCancel={end}
      onLostPointerCapture={end}
      onContextMenu={(event) => event.preventDefault()}
      onBlur={end}
      onKeyDown={(event) => {
        if (!is_press_key(event)) return;
        event.preventDefault();
        if (!event.repeat) begin();
      }}
      onKeyUp={(event) => is_press_key(event) && end()}
    >
      {children}
    </button>
  );
}

export const kGuard_ms = 1000;

// Acts when it was held for a whole second; letting go earlier does nothing. A bar shows how far it is.
export function GuardedButton(props: Omit<HeldProps, 'on_press' | 'on_release'> & { on_held(): void }) {
  const { on_held, children, ...rest } = props;
  const holding = useSignal(false);
  const timer = useRef(0);
  const act = useRef(on_held);
  act.current = on_held;
  const stop = () => {
    clearTimeout(timer.current);
    holding.value = false;
  };
  const start = () => {
    holding.value = true;
    timer.current = window.setTimeout(() => {
      stop();
      act.current();
    }, kGuard_ms);
  };
  return (
    <HeldButton
      {...rest}
      class={`guarded ${rest.class ?? ''} ${holding.value ? 'holding' : ''}`}
      on_press={start}
      on_release={stop}
    >
      <span class="progress" />
      <span>{children}</span>
    </HeldButton>
  );
}
