// Why a command that this page would send now could only be refused: what disables the controls of a robot.

import type { Robot } from './robot';
import type { Session } from './session';

// '': it may be sent. Where nobody is in control it takes control. A stop needs none of it and never asks here.
export function why_no_command({ store, phase }: Pick<Session, 'store' | 'phase'>, robot: Robot): string {
  if (!store.is_current.value || phase.value !== 'live') return 'Cut off from the station: nothing can be sent.';
  const { control, link } = robot.state.value;
  if (link !== 'connected') return 'The robot is not connected.';
  const holder = control?.holder ?? null;
  return holder !== null && holder !== store.actor.value ? `${holder} is in control.` : '';
}
