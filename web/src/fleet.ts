// Which robots the view of the fleet lists: their states in words, the filter by state and by name.

import type { Robot } from './robot';

export type FleetState = 'emergency' | 'silent' | 'auto' | 'manual' | 'away';

export const kFleetStates: readonly { state: FleetState; text: string; title: string }[] = [
  { state: 'emergency', text: 'in emergency', title: 'Latched, or with a stop that is on its way' },
  { state: 'silent', text: 'silent', title: 'Connected, and their samples do not come' },
  { state: 'auto', text: 'in auto', title: 'Their controller drives them' },
  { state: 'manual', text: 'in manual', title: 'They wait for a duty' },
  { state: 'away', text: 'away', title: 'Not connected' },
];

// Each robot is counted once: what is worst decides.
export function fleet_state_of(robot: Robot): FleetState {
  if (robot.is_alarming.value) return 'emergency';
  if (robot.is_away.value) return 'away';
  if (robot.is_silent.value) return 'silent';
  return robot.mode.value === 'auto' ? 'auto' : 'manual';
}

export interface FleetFilter {
  state: string; // '': every one, 'connected', 'hidden', or a FleetState
  search: string;
  hidden: (robot: Robot) => boolean;
}

// Words in any order, each a part of the name.
export function listed(robots: readonly Robot[], { state, search, hidden }: FleetFilter): Robot[] {
  const parts = search.toLowerCase().split(/\s+/).filter(Boolean);
  return robots.filter((robot) => {
    const name = robot.robot_id.toLowerCase();
    if (!parts.every((part) => name.includes(part))) return false;
    if (state === 'hidden') return hidden(robot);
    if (hidden(robot)) return false;
    if (state === '') return true;
    return state === 'connected' ? !robot.is_away.value : fleet_state_of(robot) === state;
  });
}

const collator = new Intl.Collator('en', { numeric: true });

// sim-2 before sim-10.
export const natural_order = (a: string, b: string) => collator.compare(a, b) || (a < b ? -1 : Number(a > b));
