// The plots alone, with ten minutes of made-up samples at 100 Hz in eight traces, for plots_bench.mjs and heap_bench.mjs.
// Never built into dist.
//
// ?rate=10: samples come ten times as fast as they are made. ?more=1: with a computed trace and the X–Y plot as well.

import '../src/styles';
import { render } from 'preact';
import type { RobotState, SamplesMessage } from '../src/api';
import { Plots } from '../src/parts/plots';
import { column_of } from '../src/plots/derived';
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

const asked = new URLSearchParams(location.search);
const rate = Number(asked.get('rate') ?? 1);
if (asked.has('more')) {
  plot_settings.add_derived({ kind: 'derivative', of: 'position_m', window_s: 0.2 });
  plot_settings.change({ xy: { is_open: true, x: 'position_m', y: 'velocity_m_s' } });
}
plot_settings.change({
  traces: [
    ...['position', 'seen', 'setpoint', 'reference', 'velocity', 'acceleration', 'duty', 'impedance'],
    ...plot_settings.kept.peek().derived.map(column_of),
  ],
  span_s: 600,
});
const session = new Session();
const state = { robot_id: 'rheo-1', link: 'connected', mode: 'auto', clock: null } as unknown as RobotState;
session.store.receive({ type: 'welcome', actor: '', version: '', utc_us: 0, stamp_us: 0, robots: [state] });
const robot = session.store.robots.value[0]!;
robot.ring.grow(65_536);
const start_ms = performance.now();
let seq = 0;
const page = window as unknown as { fed_s: number };
const feed = (now_ms: number) => {
  const due_s = kPast / kHz + (rate * (now_ms - start_ms)) / 1000;
  for (; (seq + kBatch) / kHz <= due_s; seq += kBatch) {
    const behind_ms = rate === 1 ? 1000 * (due_s - (seq + kBatch) / kHz) : 0;
    robot.receive(samples(seq), now_ms - behind_ms);
  }
  page.fed_s = seq / kHz - kPast / kHz;
};
feed(start_ms);
setInterval(() => feed(performance.now()), (1000 * kBatch) / kHz);
render(
  <div class="cockpit of-robot">
    <main class="scope">
      <Plots session={session} robot={robot} />
    </main>
  </div>,
  document.getElementById('cockpit') as HTMLElement,
);
