// Generated from server/api/openapi.yaml by generate_types.mjs; not edited by hand.

// What a live batch has for each of its samples.
export const kSampleFields = [
  'position_m',
  'velocity_m_s',
  'acceleration_m_s2',
  'duty',
  'impedance_mv',
  'reference_m',
] as const;

// The numbers that it has once for all of them.
export const kBatchNumbers = [
  'setpoint_m',
  'disturbance_m',
  'position_sd_m',
] as const;
