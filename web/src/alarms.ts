// What is wrong now, of all robots, of the station and of this page, worst first. Views and the tab show the same list.

import { computed, type ReadonlySignal } from '@preact/signals';
import { words } from './format';
import type { Robot } from './robot';
import type { Session } from './session';

export interface Alarm {
  key: string; // the same for as long as the same is wrong
  level: 'alarm' | 'caution';
  robot_id: string | null;
  text: string;
}

const kNotAcknowledged = 'stop not acknowledged yet';

export function alarms_of(session: Session): ReadonlySignal<Alarm[]> {
  const { store, settings } = session;
  // Computed of its own, so that what changes with each sample changes no list.
  const is_old = computed(() => (session.vitals.now.value.seen_ms ?? 0) > 1000);
  return computed(() => {
    const found: Alarm[] = [];
    const add = (level: Alarm['level'], key: string, text: string, robot_id: string | null = null) =>
      found.push({ key: `${key} ${robot_id ?? ''}`, level, robot_id, text });
    if (session.cut_off.value) add('alarm', 'cut_off', 'Cut off from the station');
    const hidden = settings.hidden_robots.names.value;
    for (const robot of store.robots.value) {
      const is_out_of_sight = hidden.has(robot.robot_id) && robot.is_away.value; // no longer calls
      if (is_out_of_sight) continue;
      if (robot.is_alarming.value) add('alarm', 'emergency', emergency_text(robot), robot.robot_id);
      if (robot.is_stop_kept.value)
        add('alarm', 'stop_kept', `${kNotAcknowledged}: kept for its return`, robot.robot_id);
      if (robot.is_lost_in_motion.value) add('alarm', 'lost', 'the link broke while it was driven', robot.robot_id);
      if (session.cut_off.value) continue; // of each robot the same would be said
      if (robot.is_silent.value) add('caution', 'silent', 'connected, and sends no samples', robot.robot_id);
      if (robot.is_unstoppable.value) add('alarm', 'stop_path', 'does not answer the stop’s probes', robot.robot_id);
    }
    const selected = store.selected.value;
    if (is_old.value && selected && !selected.is_away.value && !selected.is_silent.value)
      add('caution', 'old', 'what is seen of it is more than a second old', selected.robot_id);
    const recording = session.recording.value;
    if (recording && recording.state !== 'recording')
      add('alarm', 'recording', recording.problem ?? `Recording: ${words(recording.state)}`);
    return found.sort((a, b) => Number(a.level === 'caution') - Number(b.level === 'caution'));
  });
}

function emergency_text(robot: Robot): string {
  const { mode, emergency_cause, pending_stop } = robot.state.peek();
  if (mode !== 'emergency' && pending_stop !== null) return kNotAcknowledged;
  return `emergency, ${words(emergency_cause)}`;
}
