// What a gamepad does, beside the manual controls; nothing while there is none.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { percent } from '../format';
import { browser_pads, GamepadHold, is_known_layout, kStill_ms, kWatch_ms, type Pad } from '../gamepad';
import type { Session } from '../session';

interface Props {
  session: Session;
  robot_id: string;
  why_not: string; // no duty can run now
  full_duty: number;
}

const kShown_ms = 3000; // so long before a still pad ends its duty, the page says it

export function GamepadLine({ session, robot_id, why_not, full_duty }: Props) {
  const text = useSignal('');
  const choice = useSignal<readonly Pad[]>([]); // of several pads
  const used = useRef<GamepadHold | null>(null);
  const latest = useRef({ why_not, full_duty });
  latest.current = { why_not, full_duty };
  useEffect(() => {
    const hold = new GamepadHold({
      pads: browser_pads,
      now_ms: () => performance.now(),
      robot_id,
      why_not: () => latest.current.why_not,
      full_duty: () => Math.abs(latest.current.full_duty),
      hold: session.hold,
    });
    used.current = hold;
    let frame = 0;
    const tick = () => {
      hold.frame();
      text.value = line_of(hold, latest.current.why_not);
      const open = hold.pads.length > 1 && !hold.pad ? hold.pads.filter(is_known_layout) : [];
      if (names_of(open) !== names_of(choice.peek())) choice.value = open;
      frame = hold.pads.length > 0 ? requestAnimationFrame(tick) : 0;
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
    <div class="gamepad-line quiet" id="gamepad-line" hidden={text.value === ''}>
      {text}
      {choice.value.map((pad) => (
        <button type="button" key={pad.index} onClick={() => used.current?.choose(pad)}>
          Use {pad.index + 1}: {pad.id.slice(0, 40)}
        </button>
      ))}
    </div>
  );
}

const names_of = (pads: readonly Pad[]) => pads.map(({ index, id }) => `${index} ${id}`).join('\n');

function line_of(hold: GamepadHold, why_not: string): string {
  const { pad, pads, is_running, is_held, is_asleep, duty, still_left_ms } = hold;
  if (pads.length === 0) return '';
  if (!pads.some(is_known_layout)) return 'Gamepad: this page does not know its layout, and reads nothing of it.';
  if (!pad) return 'Several gamepads are connected, or one came back as another: choose the one in your hand.';
  if (is_running) {
    const still =
      still_left_ms < kShown_ms ? ` It says nothing new: off in ${(still_left_ms / 1000).toFixed(1)} s, move it.` : '';
    return `Gamepad: duty ${percent(duty, 0)} %. Let go of the shoulder button to stop.${still}`;
  }
  if (why_not) return `Gamepad: ${why_not}`;
  if (is_asleep) return `Gamepad: off, since it said nothing new for ${kStill_ms / 1000} s. Move the stick to go on.`;
  if (is_held && duty !== 0) return 'Gamepad: let go of the shoulder button, then hold it again.';
  return 'Gamepad: hold a shoulder button and push the left stick. Its end is the duty above. The right one of its four buttons stops.';
}
