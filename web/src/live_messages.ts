// What passes over the /live WebSocket, both ways; the schemas in server/api/openapi.yaml say the same.

import type { RobotState, CommandRecord, EventRecord, RunRecord } from './api';

export interface SamplesMessage {
  type: 'samples';
  robot_id: string;
  boot_id: string;
  first_seq: number;
  first_robot_time_us: number;
  period_us: number;
  mode: string;
  sub_state: string;
  setpoint_m: number | null;
  disturbance_m: number;
  position_sd_m: number;
  emergency_id: string | null;
  backfill: boolean;
  position_m: number[];
  velocity_m_s: number[];
  acceleration_m_s2: number[];
  duty: number[];
  impedance_mv: number[];
  reference_m: number[];
}

export type LiveMessage =
  | { type: 'welcome'; robots: RobotState[] }
  | { type: 'robot'; robot: RobotState }
  | SamplesMessage
  | { type: 'event'; event: EventRecord }
  | { type: 'command'; command: CommandRecord }
  | { type: 'run'; run: RunRecord }
  | { type: 'stamp'; stamp_us: number }
  | { type: 'dropped'; count: number };

export type ClientMessage =
  | { type: 'emergency_stop'; robot_id: string | null }
  | { type: 'renew_lease'; robot_id: string; stamp_us: number }
  | { type: 'keep_alive' };
