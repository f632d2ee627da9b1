// What the station says of an experiment, in words: states, what it waits for, why it ended, and what to do.

import type { ExperimentSummary } from '../../experiments_store';
import { duration, words } from '../../format';

export const kStates: Record<ExperimentSummary['state'], string> = {
  waiting: 'Waiting',
  running: 'Running',
  paused: 'Paused',
  aborting: 'Coming to rest',
  done: 'Done',
  aborted: 'Aborted',
  cancelled: 'Cancelled',
  interrupted: 'Interrupted',
};

// What it waits for, and what to do.
export const kWaits: Record<string, { what: string; todo: string }> = {
  held: { what: 'It is held.', todo: 'Resume it when the robot may move.' },
  others: { what: 'Others are before it.', todo: 'Move it up, or wait.' },
  another_experiment: { what: 'Another experiment runs on this robot.', todo: 'It begins after that.' },
  robot_not_connected: { what: 'The robot is not connected.', todo: 'Switch it on; it connects by itself.' },
  robot_not_at_rest: { what: 'The robot is not at rest.', todo: 'Set it to manual, with duty 0.' },
  sample_period: {
    what: "The robot's sample period is not 10 ms.",
    todo: 'Experiments are for robots that sample each 10 ms; cancel it.',
  },
  emergency: { what: 'The robot is in emergency.', todo: 'Look at the robot, then clear the latch.' },
  reserved: { what: 'The robot is reserved for somebody else.', todo: 'It begins when that slot is over.' },
  reserved_soon: {
    what: 'It would run into the reservation of somebody else.',
    todo: 'It begins after that slot, or when it is cancelled.',
  },
  control_of_another: { what: 'Somebody else controls the robot.', todo: 'Ask for control, or wait for its release.' },
  nobody_present: {
    what: 'Nobody is there in whose name it would act.',
    todo: 'Open the page from which it was begun, or take it over.',
  },
  fluid: { what: 'The robot is in another fluid than the first run.', todo: 'Put it into that fluid, and say so.' },
  robot_in_use: { what: 'Somebody has just commanded the robot.', todo: 'It begins 3 s after the last command.' },
  unattended_not_allowed: {
    what: 'The station does not allow unattended experiments any more.',
    todo: 'Cancel it, and begin it attended.',
  },
  unreadable: { what: 'This version of the station cannot read its profile.', todo: 'Cancel it.' },
  disk_space: { what: 'The station begins nothing new: its disk is full.', todo: 'Free space on its disk.' },
};

// Why it is paused, was held, or has ended.
export const kEnds: Record<string, string> = {
  requested: 'Somebody asked for it.',
  position: 'The position came near a limit of the profile, within twice its standard deviation.',
  position_sd: 'The position became too uncertain for the profile.',
  power: 'The motor ran at power for longer than the profile allows.',
  gap: 'No sample came for longer than the profile allows.',
  missing_samples: 'Too many samples were missing.',
  sensor_fault: 'The robot reported a fault of a sensor.',
  nobody_present: 'Nobody was there in whose name it acts.',
  control_changed: 'Control of the robot changed hands. Who has it may take this over and resume, within 60 s.',
  control_of_another: 'Somebody else controlled the robot.',
  right_ended: 'The right to command of whom it acted for has ended: the detail says why.',
  operator_command: 'The person in whose name it acted sent a command of their own. The robot is theirs.',
  unattended_limit: 'Nobody was there for as long as the robot stays in auto by itself.',
  reserved: 'The robot is reserved for somebody else.',
  emergency: 'The robot was in emergency.',
  position_uncertain: 'The robot stopped by itself, since its position was too uncertain for how near a limit is.',
  emergency_stop: 'Somebody stopped the robot.',
  link_lost: 'The link to the robot broke.',
  reboot: 'The robot restarted.',
  mode_left: 'The robot left the mode that it was to be in.',
  robot_not_at_rest: 'The robot was not at rest.',
  not_at_rest: 'The robot did not come to rest.',
  lease_lapsed: 'A duty was not renewed in time, on a slow link.',
  command_late: 'A command came to the robot too late.',
  robot_limits: 'The robot would refuse a duty or a setpoint of the profile.',
  no_room: 'From where the robot is, what is left would pass a limit of the profile.',
  not_recorded: 'Nothing is recorded: see to the disk of the station, then resume.',
  command_refused: 'A command was refused.',
  fluid: 'Put the robot into the next fluid, say so on its page, and resume.',
  model: 'The model of the fluid could not be sent to the robot.',
  controller: 'The controller of the run could not be sent to the robot.',
  run_refused: 'The run could not be begun.',
  pump: 'Set the pump, and resume.',
  other_controller: 'The robot was switched off meanwhile, and has forgotten the controller of the first run.',
  too_many_repeats: 'A step had to be repeated too often.',
  paused_too_long: 'It was paused for too long.',
  fit_failed: 'The runs could not be fitted.',
  no_excitation: 'No next run could be computed.',
  target_reached: 'The parameter is known as well as wanted.',
  target_out_of_reach: 'No further runs that are allowed would make the parameter known as well as wanted.',
  most_runs: 'All the runs that the profile allows were made.',
  station_restarted: 'The station restarted.',
  previous_aborted: 'The one before it was aborted.',
  internal: 'A fault of the station; its log says more.',
};

export const end_text = (reason: string | null) => (reason === null ? '' : (kEnds[reason] ?? `${words(reason)}.`));

// One line on what becomes of it: why it waits, is paused or has ended.
export function situation(experiment: ExperimentSummary): { what: string; todo: string } {
  const { state, waits_for, held, reason, run_counts, runs_planned } = experiment;
  const done = run_counts['done'] ?? 0;
  if (state === 'waiting') {
    const key = held ? 'held' : waits_for;
    if (key === null) return { what: 'It is its turn; it begins now.', todo: '' };
    const known = kWaits[key] ?? { what: `It waits: ${words(key)}.`, todo: '' };
    return held && reason !== null ? { ...known, what: `${known.what} ${end_text(reason)}` } : known;
  }
  if (state === 'aborting') return { what: 'The robot is being brought to rest.', todo: '' };
  if (state === 'running') return { what: experiment.activity ? sentence_of(experiment.activity) : '', todo: '' };
  if (state === 'done') return { what: `${end_text(reason)} ${done} of ${runs_planned} runs made.`.trim(), todo: '' };
  return { what: end_text(reason), todo: '' };
}

// The station's words as a sentence; one that begins with an actor ("token:ci has …") keeps its first letter.
export function sentence_of(text: string): string {
  if (text === '') return '';
  const first = /^\S*:/.test(text) ? text[0] : text[0]!.toUpperCase();
  return `${first}${text.slice(1)}${/[.!?]$/.test(text) ? '' : '.'}`;
}

// "run 2 of 6, step 1 of 2": the word for the screen; the seconds stand beside it.
export function progress_text({ progress }: Pick<ExperimentSummary, 'progress'>): string {
  if (!progress) return '';
  const { run, runs, step, steps, elapsed_s, duration_s } = progress;
  const of_step = steps > 1 ? `, step ${step} of ${steps}` : '';
  return `Run ${run} of ${runs}${of_step}, ${Math.floor(elapsed_s)} of ${Math.round(duration_s)} s`;
}

// "40 s", "2:35 min", "1:02:03 h".
export function how_long(time_s: number): string {
  const rounded_s = time_s < 10 ? Number(time_s.toFixed(1)) : Math.round(time_s);
  if (rounded_s < 100) return `${rounded_s} s`;
  return `${duration(rounded_s * 1000)} ${rounded_s < 3600 ? 'min' : 'h'}`;
}

// An actor or account as people call it: "anna", "token ci", "a page (session 3)".
export function who(actor: string, me = ''): string {
  if (actor !== '' && actor === me) return 'this page';
  const [kind = '', name = ''] = (actor.split('/')[0] ?? '').split(':');
  if (kind === 'user') return name;
  if (kind === 'session') return `page ${name}`;
  return kind === 'token' ? `token ${name}` : actor;
}

// Where a refusal of a profile points to: "profile:5:6: step[0].duty: is 2, …".
export function place_of_refusal(detail: string): { line: number | null; text: string } {
  const found = /^profile:(\d+):\d+: ([\s\S]*)$/.exec(detail);
  if (found) return { line: Number(found[1]), text: found[2]! };
  return { line: null, text: detail.replace(/^profile: /, '') };
}
