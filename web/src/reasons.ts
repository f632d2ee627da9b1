// The station's and the robot's reasons for a refusal, as sentences for the operator.

export const kReasons: Record<string, string> = {
  malformed: 'The command was malformed.',
  not_finite: 'That is not a finite number.',
  out_of_range: 'Outside the range that is allowed.',
  step_too_large: 'The step is larger than is allowed.',
  too_long_at_power: 'The motor has run at power for as long as is allowed.',
  stop_pending: 'An emergency stop is still on its way to the robot. Clear it when it has arrived.',
  wrong_mode: 'Not possible in this mode.',
  latched: 'The emergency stop is latched. Clear it first.',
  other_emergency: 'Another emergency is in force than the one you meant to clear. Look again.',
  cause_stands: 'The cause of the emergency still stands, or the motor’s supply is cut.',
  life_too_long: 'The command would have lived too long.',
  nothing_to_renew: 'The duty had ended already.',
  motor_on: 'Not while the motor runs.',
  outward: 'Outside the position limit: only motion inward is accepted.',
  uncertain: 'Too near a position limit for how well the position is known. Zero the position at a known place.',
  busy: 'Too many commands wait.',
  unsupported: 'This firmware does not have it.',
  not_connected: 'The robot is not connected.',
  expired: 'It arrived too late and was discarded.',
  superseded: 'Another command took its place.',
  by_emergency_stop: 'An emergency stop took its place.',
  by_an_emergency: 'An emergency took its place.',
  by_a_newer_command: 'A newer command took its place.',
  not_seen_in_telemetry: 'The robot accepted it, and telemetry does not show it.',
  too_old_on_arrival: 'It arrived too late and was discarded.',
  stopped_by_a_later_stop: 'A later stop was answered first.',
  stale: 'What this page showed was too old. Look again.',
  timed_out: 'The robot did not answer in time.',
  no_answer: 'The robot did not answer in time. Whether it has obeyed is not known yet.',
  duplicate: 'The robot has had it before. Whether it has obeyed is not known yet.',
  not_sent_in_time: 'It could not be sent in time and was discarded.',
  unknown_robot: 'The station does not know this robot.',
  link_lost: 'The link to the robot broke before it answered. Whether it has obeyed is not known yet.',
  other_boot: 'The robot restarted in between.',
  not_permitted: 'Your role does not allow that.',
  wrong_credentials: 'The user or the password is wrong.',
  bad_link:
    'This link is no longer valid: it was used, or is older than 10 minutes. On the station’s machine rheonaut login-link --data FOLDER makes a new one.',
  no_credential: 'This page is signed out.',
  wrong_token: 'The station does not know this token any more.',
};

// What helps after an event that ends motion for a reason that nobody sees.
export const kWaysOut: Record<string, string> = {
  position_uncertain:
    'A position limit is nearer than the position is known. Turn round, or bring the robot to a known place and press “Zero position”.',
};

// An identifier of a refusal as a sentence.
export const sentence = (reason: string) => kReasons[reason] ?? reason.replaceAll('_', ' ');
