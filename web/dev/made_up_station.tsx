// A made-up station inside the page: the cockpit with synthetic samples, for work on its looks. Never built into dist.
//
// ?scene=auto (the closed-loop experiment), manual, emergency, fleet (621 robots), silent, empty, signed_out.

import '../src/styles';
import { render } from 'preact';
import type { LiveMessage, RobotState } from '../src/api';
import { keep_menus_shut, listen_for_stop_key, listen_for_view_keys } from '../src/keys';
import type { Socket } from '../src/live';
import { follow_address } from '../src/route';
import { Session } from '../src/session';
import { show_in_tab } from '../src/tab';
import { Cockpit, open_view } from '../src/views/cockpit';

const scene = new URLSearchParams(location.search).get('scene') ?? 'auto';
const emergency_id = scene === 'emergency' ? '9371204588120447103' : null;
const mode = ['silent', 'fleet'].includes(scene) ? 'auto' : (scene as RobotState['mode']);
const boot_id = '4403811029384756012';

const robot = (robot_id: string, seq: number): RobotState => ({
  robot_id,
  link: robot_id === 'rheo-1' ? 'connected' : 'disconnected',
  peer: '127.0.0.1:50122',
  connected_at_us: 0,
  last_received_at_us: 0,
  boot_id,
  reset_cause: 'power_on',
  firmware_version: '0.1.0',
  sample_period_us: 10_000,
  ring_capacity: 800,
  parameters_checksum: 1,
  controller_id: 1,
  controller_checksum: 1,
  mode: robot_id === 'rheo-1' ? mode : 'manual',
  sub_state: mode === 'auto' ? 'navigating' : 'none',
  setpoint_m: 0.1,
  disturbance_m: 0,
  position_sd_m: 0.0031,
  emergency_id: robot_id === 'rheo-1' ? emergency_id : null,
  emergency_cause: emergency_id ? 'operator' : 'none',
  flags: 0,
  sample: null,
  next_seq: seq,
  oldest_seq: 0,
  durable_next_seq: seq - 12,
  latest_robot_time_us: seq * 10_000,
  status: {
    supply_mv: 3712,
    rssi_dbm: -58,
    free_memory_bytes: 31000,
    worst_tick_us: 2100,
    missed_ticks: 0,
    ring_fill: 34,
    imu_calibration: 3,
    bad_frames: 0,
    lost_samples: 0,
    lost_events: 0,
  },
  clock: { offset_us: 0, uncertainty_us: 310, drift_ppm: 12, round_trip_us: 1840 },
  control: null,
  reservation: null,
  pending_stop: null,
  stop_path: { is_open: true, round_trip_us: 1900, answered_at_us: 0 },
  fluid: null,
  model: { state: 'assumed', fluid: null, reason: '', fit_error: null, set_at_us: null },
  retired: false,
  changed_limits: [],
  lease_renewed_at_us: null,
  invalid_values: 0,
  events_left_out: 0,
  unknown_values: null,
});

// Position and duty of the experiment, roughly: to 0.1 m, pushed back by 0.05 m at 20 s, and again.
function sample_at(t_s: number): [position: number, velocity: number, duty: number, impedance: number] {
  const noise = (k: number) => Math.sin(t_s * 137.1 * k) * Math.cos(t_s * 71.7 + k);
  const impedance = 175 + 2 * noise(3) - 52 * Math.exp(-(((t_s - 36) / 2.2) ** 2));
  if (scene === 'manual') {
    const duty = Math.floor(t_s / 6) % 3 === 1 ? 0.3 : 0;
    return [0.02 + 0.004 * Math.sin(t_s / 9) + 0.0003 * noise(1), 0.1 * duty, duty, impedance];
  }
  const stage_s = t_s < 8 ? -1 : t_s < 28 ? t_s - 8 : t_s - 28;
  const from = t_s < 28 ? 0 : 0.05;
  const rest = stage_s < 0 ? 1 : Math.exp(-stage_s * 3.4) * Math.cos(stage_s * 1.1);
  const off = scene === 'emergency' && t_s > 44;
  const position = (stage_s < 0 ? 0 : 0.1 - (0.1 - from) * rest) + 0.0003 * noise(1);
  const duty = off || stage_s < 0 ? 0 : Math.max(-1, Math.min(1, rest * 5 + 0.03 * noise(2)));
  return [position, 0.03 * duty, duty, impedance];
}

function samples(seq: number, size: number): LiveMessage {
  const rows = Array.from({ length: size }, (_, i) => sample_at((seq + i) / 100));
  const commanded = scene !== 'manual' && seq > 800 && !(scene === 'emergency' && seq > 4400);
  return {
    type: 'samples',
    robot_id: 'rheo-1',
    boot_id,
    first_seq: seq,
    first_robot_time_us: seq * 10_000,
    period_us: 10_000,
    mode,
    sub_state: mode === 'auto' ? 'navigating' : 'none',
    setpoint_m: commanded ? 0.1 : null,
    disturbance_m: commanded && seq >= 2800 ? -0.05 : 0,
    position_sd_m: 0.0031,
    emergency_id,
    flags: 0,
    unknown_values: null,
    backfill: false,
    position_m: rows.map((row) => row[0]),
    velocity_m_s: rows.map((row) => row[1]),
    acceleration_m_s2: rows.map(() => 0),
    duty: rows.map((row) => row[2]),
    impedance_mv: rows.map((row) => row[3]),
    reference_m: rows.map(() => (commanded ? 0.1 : 0)),
  };
}

function open_socket(): Socket {
  const socket: Socket = {
    readyState: 1,
    onopen: null,
    onmessage: null,
    onclose: null,
    onerror: null,
    send() {},
    close() {},
  };
  const say = (message: LiveMessage) => socket.onmessage?.({ data: JSON.stringify(message) } as never);
  let seq = 0;
  setTimeout(() => {
    if (scene === 'signed_out') return (socket.onclose as (() => void) | null)?.();
    const others = Array.from({ length: scene === 'fleet' ? 620 : 1 }, (_, n) =>
      robot(n === 0 ? 'tank-b' : `tank-${n}`, 0),
    );
    const robots = scene === 'empty' ? [] : [robot('rheo-1', 5600), ...others];
    say({ type: 'welcome', actor: 'session:1', version: '0.1.0', utc_us: Date.now() * 1000, stamp_us: 0, robots });
    if (scene === 'empty') return setInterval(() => say({ type: 'stamp', stamp_us: 1 }), 100);
    session.me.value = { actor: 'session:1', user: '', role: 'admin', scopes: 'admin' };
    session.store.set_runs([
      {
        run_id: 7,
        robot_id: 'rheo-1',
        name: 'closed loop, 100 mm',
        started_at_us: (Date.now() - 31_000) * 1000,
        ended_at_us: null,
      } as never,
    ]);
    const at_us = (ago_s: number) => (Date.now() - ago_s * 1000) * 1000;
    const command = (
      n: number,
      kind: string,
      values: object,
      state: 'acknowledged' | 'rejected',
      ago_s: number,
      reason = '',
    ) =>
      say({
        type: 'command',
        command: {
          command_id: String(n),
          robot_id: 'rheo-1',
          boot_id,
          kind,
          arguments: values as never,
          actor: 'session:1',
          state,
          reason,
          submitted_at_us: at_us(ago_s),
          sent_at_us: 0,
          ended_at_us: 0,
          effect_at_robot_us: 0,
          emergency_id,
          sent_after_us: 210,
          acknowledged_after_us: 640,
          verified_after_us: null,
          life_from: 'stamp',
        },
      });
    const event = (n: number, kind: string, cause: string, ago_s: number) =>
      say({
        type: 'event',
        event: {
          robot_id: 'rheo-1',
          boot_id,
          event_seq: n,
          robot_time_us: 0,
          sample_seq: 0,
          kind,
          cause,
          emergency_cause: emergency_id ? 'operator' : 'none',
          detail: '',
          unknown_values: null,
          mode,
          sub_state: 'navigating',
          position_m: 0.0984,
          value: 0,
          emergency_id,
          command_id: null,
          received_at_us: at_us(ago_s),
        },
      });
    command(1, 'set_mode', { mode: 'auto', setpoint_m: 0.1 }, 'acknowledged', 48);
    event(1, 'mode_changed', 'command', 47.9);
    command(2, 'set_setpoint', { setpoint_m: 4 }, 'rejected', 35, 'out_of_range');
    command(3, 'inject_disturbance', { disturbance_m: -0.05 }, 'acknowledged', 28);
    event(2, 'disturbance', 'command', 27.9);
    if (scene === 'emergency') event(3, 'emergency', 'command', 12);
    for (; seq < 5600; seq += 5) if (seq < 3000 || seq > 3150) say(samples(seq, 5));
    setInterval(() => {
      say({ type: 'stamp', stamp_us: 1 });
      if (scene !== 'silent') for (let i = 0; i < 2; ++i, seq += 5) say(samples(seq, 5));
    }, 100);
    return setInterval(() => say({ type: 'robot', robot: robot('rheo-1', seq) }), 500);
  }, 50);
  return socket;
}

const session = new Session({ open_socket, is_signed_out: () => Promise.resolve(scene === 'signed_out') });
follow_address(window);
listen_for_stop_key(window, session.stop_selected);
listen_for_view_keys(window, open_view);
keep_menus_shut(window);
session.start();
show_in_tab(document, session);
render(<Cockpit session={session} />, document.getElementById('cockpit') as HTMLElement);
