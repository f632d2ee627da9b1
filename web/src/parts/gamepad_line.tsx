// What a gamepad does, beside the manual controls; nothing while there is none.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { percent } from '../format';
import { GamepadHold, kWatch_ms, type Pad } from '../gamepad';
import type { Session } from '../session';

interface Props {
  session: Session;
  robot_id: string;
  why_not: string; // no duty can run now
  full_duty: number;
}

const pads = (): readonly (Pad | null)[] => {
  try {
    return navigator.getGamepads?.() ?? [];
  } catch {
    return []; // a page that may not read them has none
  }
};

export function GamepadLine({ session, robot_id, why_not, full_duty }: Props) {
  const text = useSignal('');
  const latest = useRef({ why_not, full_duty });
  latest.current = { why_not, full_duty };
  useEffect(() => {
    const hold = new GamepadHold({
      pads,
      now_ms: () => performance.now(),
      robot_id,
      why_not: () => latest.current.why_not,
      full_duty: () => Math.abs(latest.current.full_duty),
      hold: session.hold,
    });
    let frame = 0;
    const tick = () => {
      hold.frame();
      text.value = line_of(hold, latest.current.why_not);
      frame = hold.pad ? requestAnimationFrame(tick) : 0;
    };
    const begin = () => (frame ||= requestAnimationFrame(tick));
    const end = () => hold.end();
    const hidden = () => document.hidden && end();
    const timer = setInterval(() => hold.watch(), kWatch_ms);
    // SAFETY: whatever hides the robot from the hand ends its duty.
    addEventListener('blur', end);
    addEventListener('pagehide', end);
    document.addEventListener('visibilitychange', hidden);
    addEventListener('gamepaddisconnected', end);
    addEventListener('gamepadconnected', begin);
    begin();
    return () => {
      end();
      clearInterval(timer);
      cancelAnimationFrame(frame);
      removeEventListener('blur', end);
      removeEventListener('pagehide', end);
      document.removeEventListener('visibilitychange', hidden);
      removeEventListener('gamepaddisconnected', end);
      removeEventListener('gamepadconnected', begin);
    };
  }, [session, robot_id]);
  return (
    <p class="gamepad-line quiet" id="gamepad-line" hidden={text.value === ''}>
      {text}
    </p>
  );
}

function line_of({ pad, is_running, is_held, duty }: GamepadHold, why_not: string): string {
  if (!pad) return '';
  if (is_running) return `Gamepad: duty ${percent(duty, 0)} %. Let go of the shoulder button to stop.`;
  if (why_not) return `Gamepad: ${why_not}`;
  if (is_held && duty !== 0) return 'Gamepad: let go of the shoulder button, then hold it again.';
  return 'Gamepad: hold a shoulder button and push the left stick. Its end is the duty above.';
}
