// The plots alone, with ten minutes of made-up samples at 100 Hz in eight traces, for plots_bench.mjs. Never built into dist.

import '../src/styles';
import { render } from 'preact';
import type { RobotState, SamplesMessage } from '../src/api';
import { Plots } from '../src/parts/plots';
import { plot_settings } from '../src/plots/strips';
import { Session } from '../src/session';

const kHz = 100;
const kBatch = 5;
const kPast = 10 * 60 * kHz;

const wave = (seq: number, k: number) => Math.sin(seq / (40 * k)) + 0.2 * Math.sin(seq * 1.7 * k);

function samples(first_seq: number): SamplesMessage {
  const column = (k: number, much: number) => Array.from({ length: kBatch }, (_, i) => much * wave(first_seq + i, k));
  return {
    type: 'samples',
    robot_id: 'rheo-1',
    boot_id: '11',
    first_seq,
    first_robot_time_us: first_seq * (1e6 / kHz),
    period_us: 1e6 / kHz,
    mode: 'auto',
    sub_state: 'navigating',
    setpoint_m: 0.1 * Math.round(wave(first_seq, 30)),
    disturbance_m: 0,
    position_sd_m: 0.003,
    emergency_id: null,
    flags: 0,
    unknown_values: null,
    backfill: false,
    position_m: column(1, 0.1),
    velocity_m_s: column(2, 0.05),
    acceleration_m_s2: column(3, 0.5),
    duty: column(4, 0.8),
    impedance_mv: column(5, 100),
    reference_m: column(6, 0.1),
  };
}

plot_settings.change({
  traces: ['position', 'seen', 'setpoint', 'reference', 'velocity', 'acceleration', 'duty', 'impedance'],
  span_s: 600,
});
const session = new Session();
const state = { robot_id: 'rheo-1', link: 'connected', mode: 'auto', clock: null } as unknown as RobotState;
session.store.receive({ type: 'welcome', actor: '', version: '', utc_us: 0, stamp_us: 0, robots: [state] });
const robot = session.store.robots.value[0]!;
robot.ring.grow(65_536);
const start_ms = performance.now() - (kPast / kHz) * 1000;
let seq = 0;
const feed = (now_ms: number) => {
  for (; (seq + kBatch) / kHz <= (now_ms - start_ms) / 1000; seq += kBatch)
    robot.receive(samples(seq), start_ms + ((seq + kBatch) / kHz) * 1000);
};
feed(performance.now());
setInterval(() => feed(performance.now()), (1000 * kBatch) / kHz);
render(
  <div class="cockpit of-robot">
    <main class="scope">
      <Plots session={session} robot={robot} />
    </main>
  </div>,
  document.getElementById('cockpit') as HTMLElement,
);
