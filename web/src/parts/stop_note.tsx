// What the stop button is and is not, behind a small line below it.

import { useSignal } from '@preact/signals';
import { useCloseOnEscape } from '../keys';

export function StopNote({ why, parts }: { why: string; parts: string }) {
  const open = useSignal(false);
  useCloseOnEscape(() => (open.value = false));
  return (
    <div class="stop-note">
      <button
        type="button"
        class="plain"
        id="show-stop-note"
        aria-expanded={open.value}
        aria-controls="stop-note"
        onClick={() => (open.value = !open.value)}
      >
        A stop function, not an emergency-stop device
      </button>
      <section id="stop-note" aria-label="About the stop" hidden={!open.value}>
        <p>
          It asks the robot’s own program to switch the motor off and to keep it off until the latch is cleared. Page,
          network, station and robot must work for that, so it does not replace a device that cuts the power. Keep the
          robot’s power switch within reach.
        </p>
        <p>
          The way is measured all the time: the station answers this page five times a second, and asks the robot twice
          a second, as a stop would. {why || parts}.
        </p>
        <p>
          When a stop would not work now the button is hatched and says what becomes of a press. It can be pressed all
          the same: the page and the station keep a stop and send it first.
        </p>
        <p class="quiet">More: docs/cockpit.md, “Stopping”, and docs/robot.md</p>
      </section>
    </div>
  );
}
