// One robot as the page knows it: its state as the station reported it last, and what its samples say.

import { computed, signal, type Signal } from '@preact/signals';
import type { RobotModel, RobotState, SamplesMessage } from './api';
import { fluid_text } from './format';
import { estimate_of, SampleRing } from './samples';

export const kStale_ms = 500; // no sample for so long: every numeral is marked

const kSettle_ms = 500;
const kModelConfirmed = 64; // of flags
const kModelMismatch = 128;

// The model that the estimator has, and whether it is that of the fluid; empty where the position is no estimate. `sent`:
// what the station has sent to the robot.
export function model_of(flags: number, position_sd_m: number | null, sent?: RobotModel): string {
  if (position_sd_m === 0) return '';
  const is_confirmed = (flags & kModelConfirmed) !== 0;
  const fluid = sent?.fluid ? fluid_text(sent.fluid) : '';
  const named = fluid && sent?.state === 'confirmed' && is_confirmed ? `model of ${fluid}` : 'model';
  if (flags & kModelMismatch) return `${named} does not fit`;
  // Under the flag, too: a former model of the same fluid may be what is confirmed.
  if (fluid && sent?.state === 'sending') return `model of ${fluid} being sent`;
  if (is_confirmed && (sent?.state === 'failed' || sent?.state === 'sending'))
    return 'model confirmed for another fluid';
  if (is_confirmed) return named === 'model' ? 'model confirmed' : `${named}, confirmed`;
  return fluid && sent?.state === 'failed' ? `model of ${fluid} could not be sent` : 'model assumed';
}

// The parameters that bound motion and are not at their default, in one line; empty when there is none.
export function changed_limits_of(state: Pick<RobotState, 'changed_limits'>): string {
  const number = (value: number | null) => (value === null ? '—' : `${value}`);
  const limits = (state.changed_limits ?? []).map((limit) => {
    const unit = limit.unit ? ` ${limit.unit}` : '';
    return `${limit.name} ${number(limit.value)}${unit} (default ${number(limit.default)}${unit})`;
  });
  return limits.length === 0 ? '' : `Changed limits: ${limits.join(', ')}`;
}

// What the numerals show; null: never received.
export interface Readout {
  watched: boolean; // its samples are asked for; of the others nothing is shown that changes with each sample
  estimate_m: number | null; // where the robot believes that it is
  position_m: number | null; // what its controller sees: the estimate plus the disturbance
  position_sd_m: number | null;
  model: string; // what the estimate's "±" rests on: see model_of
  setpoint_m: number | null;
  reference_m: number | null;
  duty: number | null;
  velocity_m_s: number | null;
  impedance_mv: number | null;
  disturbance_m: number | null;
  mode: string;
  sub_state: string;
  emergency_id: string | null;
  sample_age_ms: number;
  stale: boolean;
  received: number;
  missing: number; // samples that this page has not got, since it first received this boot
}

export const kNothingRead: Readout = {
  watched: true,
  estimate_m: null,
  position_m: null,
  position_sd_m: null,
  model: '',
  setpoint_m: null,
  reference_m: null,
  duty: null,
  velocity_m_s: null,
  impedance_mv: null,
  disturbance_m: null,
  mode: '',
  sub_state: '',
  emergency_id: null,
  sample_age_ms: Infinity,
  stale: true,
  received: 0,
  missing: 0,
};

export const kSameMoment_us = 200_000; // an event comes ahead of the samples of its time

const end_of_samples = ({ boot_id, first_robot_time_us, period_us, position_m, position_sd_m }: SamplesMessage) => ({
  boot_id,
  robot_time_us: first_robot_time_us + (position_m.length - 1) * period_us,
  position_sd_m,
});

const end_of_state = ({ boot_id, latest_robot_time_us, position_sd_m }: RobotState) => ({
  boot_id,
  robot_time_us: latest_robot_time_us,
  position_sd_m,
});

export class Robot {
  private made_ring: SampleRing | null = null;
  readonly robot_id: string;
  readonly state: Signal<RobotState>;
  // What a list of hundreds depends on: each changes seldom, while the state changes ten times a second.
  readonly is_away = computed(() => this.state.value.link !== 'connected');
  // Out of use, and not there: it is listed only where it is asked for, and the stop of all leaves it out.
  readonly is_left_out = computed(() => this.state.value.retired === true && this.is_away.value);
  // In an emergency, or with a stop that is on its way. A list of the fleet counts one that is away as away: its stop is kept.
  readonly is_alarming = computed(() => {
    const { mode, emergency_id, pending_stop } = this.state.value;
    if (this.is_left_out.value) return false;
    return mode === 'emergency' || emergency_id !== null || (pending_stop !== null && !this.is_away.value);
  });
  // Away, and a stop waits for it: whether it moves on nobody knows.
  readonly is_stop_kept = computed(
    () => this.is_away.value && !this.is_left_out.value && this.state.value.pending_stop !== null,
  );
  // Away, and driven by the last that was received of it. One that was at rest may have been switched off on purpose.
  readonly is_lost_in_motion = computed(() => {
    const { mode, sample } = this.state.value;
    if (!this.is_away.value || this.is_left_out.value || this.is_alarming.value) return false;
    return mode === 'auto' || (sample?.duty ?? 0) !== 0;
  });
  readonly readout = signal<Readout>(kNothingRead);
  readonly mode = computed(() => this.state.value.mode);
  readonly emergency_id = computed(() => this.state.value.emergency_id);
  // Connected, and its samples do not come.
  readonly is_silent = computed(() => !this.is_away.value && this.readout.value.watched && this.readout.value.stale);
  // Connected, and its own way for a stop is not open. Of one that is not measured, or not yet, nothing is said.
  readonly is_unstoppable = computed(() => {
    const path = this.state.value.stop_path;
    return !this.is_away.value && path?.is_open === false && path.round_trip_us !== null;
  });
  private latest: SamplesMessage | null = null;
  private sampled_at_ms = -Infinity;
  private watched = true; // its samples are asked for
  private boot_id: string | null = null;
  private first_seq = 0;
  private next_seq = 0;
  private received = 0;
  private stated_at_ms: number; // when the station last reported its state
  private latched_at_ms = -Infinity; // when news last showed the latch
  private is_latched = false; // by the latest news
  private shown: { state: RobotState; is_current: boolean } | null = null; // of a robot that is not watched

  constructor(state: RobotState, now_ms: number) {
    this.robot_id = state.robot_id;
    this.state = signal(state);
    this.stated_at_ms = now_ms;
    this.note_latch(state.mode, state.link === 'connected', now_ms);
  }

  // Made when it is needed: a fleet of hundreds would fill the memory with empty rings.
  get ring(): SampleRing {
    return (this.made_ring ??= new SampleRing());
  }

  // UTC less the times of its ring, by the station's estimate of the robot's clock; without one by when they came.
  utc_shift_s(utc_minus_steady_us: number | null, page_utc_s: number): number {
    const offset_us = this.state.peek().clock?.offset_us;
    if (offset_us === undefined || utc_minus_steady_us === null) return page_utc_s;
    return (offset_us + utc_minus_steady_us) / 1e6 - this.ring.time_base_s;
  }

  take(state: RobotState, now_ms: number): void {
    this.state.value = state;
    this.stated_at_ms = now_ms;
    this.note_latch(state.mode, state.link === 'connected', now_ms);
  }

  // What was received since then of a stop of this robot. A latch counts by telemetry, and by the state of a robot that is
  // connected, which is made of telemetry; a robot that is away keeps the mode that it had.
  stop_evidence(since_ms: number): 'latched' | 'cleared' | 'kept' | 'open' {
    if (this.latched_at_ms > since_ms) return this.is_latched ? 'latched' : 'cleared';
    const { link, pending_stop } = this.state.peek();
    return link !== 'connected' && pending_stop !== null && this.stated_at_ms > since_ms ? 'kept' : 'open';
  }

  private note_latch(mode: string, is_news: boolean, now_ms: number): void {
    if (!is_news) return;
    const is_latched = mode === 'emergency';
    // States come at once and samples some 50 ms later: what was made before the latch may arrive after it.
    if (!is_latched && now_ms - this.latched_at_ms < kSettle_ms) return;
    this.is_latched = is_latched;
    if (is_latched) this.latched_at_ms = now_ms;
  }

  // What was not asked for is not missing afterwards.
  watch(watched: boolean): void {
    if (watched && !this.watched) this.boot_id = null;
    this.watched = watched;
  }

  // The sd of the position at that moment; null: the newest sample of the page is of another moment.
  position_sd_m_at(boot_id: string | null, robot_time_us: number | null): number | null {
    const newest = this.watched && this.latest ? end_of_samples(this.latest) : end_of_state(this.state.peek());
    if (robot_time_us === null || boot_id === null || boot_id !== newest.boot_id) return null;
    return Math.abs(robot_time_us - newest.robot_time_us) <= kSameMoment_us ? newest.position_sd_m : null;
  }

  receive(message: SamplesMessage, now_ms: number): void {
    const size = message.position_m.length;
    if (message.boot_id !== this.boot_id) {
      this.boot_id = message.boot_id;
      this.first_seq = this.next_seq = message.first_seq;
      this.received = 0;
    }
    const before = this.ring.received;
    this.ring.round_trip_us = this.state.peek().clock?.round_trip_us ?? NaN;
    this.ring.append(message, now_ms / 1000);
    if (message.first_seq >= this.first_seq) this.received += this.ring.received - before;
    if (message.first_seq + size <= this.next_seq) return; // sent again: history, not news
    this.next_seq = message.first_seq + size;
    this.latest = message;
    this.sampled_at_ms = now_ms;
    this.note_latch(message.mode, true, now_ms);
  }

  // How old the newest sample is: from the robot's clock to now, when the station knows that clock, else since it came. null:
  // none has come.
  seen_age_ms(now_ms: number, station_us: number | null): number | null {
    if (!this.watched || !this.latest) return null;
    const since_ms = now_ms - this.sampled_at_ms;
    const { clock, boot_id } = this.state.peek();
    if (station_us === null || !clock || boot_id !== this.latest.boot_id) return since_ms;
    const { robot_time_us } = end_of_samples(this.latest);
    return Math.max(since_ms, (station_us - robot_time_us - clock.offset_us) / 1000);
  }

  // is_current: the page receives from the station; what it knows of a robot is old otherwise.
  refresh(now_ms: number, is_current: boolean): void {
    if (!this.watched) return this.refresh_from_state(is_current);
    this.shown = null;
    const sample_age_ms = now_ms - this.sampled_at_ms;
    const stale = sample_age_ms > kStale_ms;
    const { latest } = this;
    const state = this.state.peek();
    const last = <T>(values: T[]): T | null => values[values.length - 1] ?? null;
    const position_m = latest && last(latest.position_m);
    this.readout.value = {
      watched: true,
      estimate_m: latest && estimate_of(position_m, latest.disturbance_m),
      position_m,
      position_sd_m: latest && latest.position_sd_m,
      model: latest ? model_of(latest.flags, latest.position_sd_m, state.model) : '',
      setpoint_m: latest ? latest.setpoint_m : null,
      reference_m: latest && last(latest.reference_m),
      duty: latest && last(latest.duty),
      velocity_m_s: latest && last(latest.velocity_m_s),
      impedance_mv: latest && last(latest.impedance_mv),
      disturbance_m: latest && latest.disturbance_m,
      // What the station says of a robot that is silent is newer than its last sample.
      mode: latest && !stale ? latest.mode : state.mode,
      sub_state: latest && !stale ? latest.sub_state : state.sub_state,
      emergency_id: latest && !stale ? latest.emergency_id : state.emergency_id,
      sample_age_ms,
      stale,
      received: this.received,
      missing: this.next_seq - this.first_seq - this.received,
    };
  }

  // The station reports its link, mode and emergency at once; numbers would be old.
  private refresh_from_state(is_current: boolean): void {
    const state = this.state.peek();
    if (this.shown?.state === state && this.shown.is_current === is_current) return;
    this.shown = { state, is_current };
    const { mode, sub_state, emergency_id, link } = state;
    const stale = link !== 'connected' || !is_current;
    this.readout.value = { ...kNothingRead, watched: false, mode, sub_state, emergency_id, stale };
  }
}
