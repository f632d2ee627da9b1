// One running page: the store, the live link, the API and the controls that outlive a view, wired together.

import { effect, signal, untracked } from '@preact/signals';
import {
  Api,
  ApiError,
  is_answer_of_station,
  type EventRecord,
  type Fluid,
  type LiveMessage,
  type Me,
  type Recording,
  type RunRecord,
  type Station,
} from './api';
import { alarms_of } from './alarms';
import { Alerts, browser_alerts } from './alerts';
import { DutyHold } from './duty_hold';
import { EmergencyStop, kIdleStop } from './emergency';
import { ExperimentsApi } from './experiments_api';
import { is_refused_in_past, shows_past } from './past_guard';
import type { Robot } from './robot';
import { go_to, route } from './route';
import { kCurrent_ms, LiveLink, type LinkPhase, type Surroundings } from './live';
import { StationPath } from './station_path';
import { StopPath } from './stop_path';
import { browser_shelf, ViewSettings } from './settings';
import { kLogLines, kRefresh_ms, Store } from './store';
import { tab_shelf, TabClient } from './tab_client';
import { browser_channel, kTell_ms, Tabs } from './tabs';
import { Vitals } from './vitals';

const kMaxWatchedAtOnce = 8; // in a larger fleet samples come of the robots that were looked at last
const kMaxWatchedInFleet = 16; // and in the view of the fleet, of those that are in sight
const kLook_ms = 5000; // how often the health of the recording is asked for
const kKeepAlive_ms = 1000; // what this page controls stays its own for 3 s
const kNamedAtOnce = 64; // robots in one sign of life

export class Session {
  readonly api = new Api(
    (path, options) => this.ask(path, options),
    () => this.link.stamp_us,
  );
  readonly experiments = new ExperimentsApi((method, path, body) => this.api.ask(method, path, body));
  readonly store = new Store({ page_ms: () => performance.now(), utc_ms: () => this.utc_us() / 1000 });
  readonly settings = new ViewSettings(browser_shelf());
  readonly tab = new TabClient(tab_shelf());
  readonly station = signal<Station | null>(null);
  readonly fluids = signal<Fluid[] | null>(null); // that a robot may be in; null: the station has no list of them
  readonly me = signal<Me | null>(null);
  readonly phase = signal<LinkPhase>('connecting');
  readonly stop_state = signal(kIdleStop);
  readonly held = signal<{ robot_id: string | null; lapsed: boolean; error: string }>({
    robot_id: null,
    lapsed: false,
    error: '',
  });
  readonly link: LiveLink;
  readonly path = new StationPath();
  readonly stop_path: StopPath;
  readonly vitals = new Vitals(this.path);
  readonly cut_off = signal<{ since_ms: number } | null>(null); // UTC; null while the page receives from the station
  readonly recording = signal<Recording | null>(null);
  readonly in_sight = signal<string[]>([]); // rows of the view of the fleet
  readonly alarms = alarms_of(this);
  readonly alerts = new Alerts(this.settings, browser_alerts());
  readonly tabs = new Tabs(browser_channel(), () => performance.now());
  readonly emergency: EmergencyStop;
  readonly hold: DutyHold;

  constructor(surroundings: Partial<Surroundings> = {}) {
    this.link = new LiveLink(
      {
        open_socket: () =>
          new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/live?${this.tab.query()}`),
        now_ms: () => performance.now(),
        set_timer: (callback, delay_ms) => setTimeout(callback, delay_ms),
        clear_timer: (timer) => clearTimeout(timer as number),
        random: () => Math.random(),
        is_signed_out: () => this.api.is_signed_out(),
        ...surroundings,
      },
      (message) => {
        this.measure(message);
        if (message.type === 'problem') this.hold.lapse(); // the only message that it can be about, but for a stop
        this.store.receive(message);
        if (message.type === 'welcome') {
          if (message.client) this.tab.keep(message.client);
          this.emergency.again();
          void this.load_log();
        }
        // With each stamp: what this page has set going needs a sign of life within 400 ms.
        if (message.type === 'stamp' && this.kept_experiments().length > 0) this.keep_alive();
      },
      () => this.on_phase(),
    );
    this.stop_path = new StopPath(this.path, {
      now_ms: () => performance.now(),
      set_timer: (callback, delay_ms) => setTimeout(callback, delay_ms),
      clear_timer: (timer) => clearTimeout(timer as number),
      is_live: () => this.link.phase === 'live',
    });
    this.emergency = new EmergencyStop({
      over_socket: (robot_id, key) => this.link.send({ type: 'emergency_stop', robot_id, key }),
      over_http: (robot_id, key) =>
        robot_id === null ? this.api.emergency_stop_all(key) : this.api.emergency_stop(robot_id, key),
      evidence: (robot_id, since_ms) => this.store.stop_evidence(robot_id, since_ms),
      was_answered: is_answer_of_station,
      now_ms: () => performance.now(),
      on_change: (state) => (this.stop_state.value = state),
    });
    this.hold = new DutyHold({
      set_duty: (robot_id, duty) => this.api.set_duty(robot_id, duty),
      renew_lease: (robot_id) => this.renew_lease(robot_id),
      now_ms: () => performance.now(),
      set_interval: (callback, period_ms) => setInterval(callback, period_ms),
      clear_interval: (timer) => clearInterval(timer as number),
      on_change: () => this.on_hold(),
    });
  }

  // By the station's clock: what the station dates is compared with it.
  utc_us = (): number => this.path.utc_s(performance.now()) * 1e6;

  private refreshed_at_ms = 0;
  private let_pass = false;
  private recording_asked_at_ms = -Infinity;
  private looked_at: string[] = []; // robots, the latest first

  // The name under which a notice about a run is dismissed; run numbers begin anew with each store.
  notice_of = (run: RunRecord): string => `run ${run.run_id} of ${this.station.value?.store_id ?? ''}`;

  start(): void {
    this.link.start();
    effect(() => this.follow_route());
    effect(() => this.date_latch());
    effect(() => this.watch());
    effect(() => {
      const robot_id = this.store.selected_id.value;
      if (this.phase.peek() === 'live') void this.load_newest_run(robot_id).catch(() => undefined);
    });
    setInterval(() => this.refresh(), kRefresh_ms);
    setInterval(() => this.keep_alive(), kKeepAlive_ms);
    setInterval(() => this.tell_tabs(), kTell_ms);
    setInterval(() => void this.load_recording(), kLook_ms);
    effect(() => this.tell_tabs(this.held.value.robot_id));
    this.alerts.follow(this.alarms);
    addEventListener('online', () => this.link.hurry());
    for (const kind of ['focus', 'pageshow', 'resume']) addEventListener(kind, this.stop_path.look);
    document.addEventListener('visibilitychange', () => {
      this.stop_path.look();
      if (document.hidden) this.hold.release();
      else this.link.hurry();
    });
    addEventListener('blur', () => this.hold.release());
    addEventListener('pagehide', () => {
      this.hold.release();
      this.tabs.leave();
    });
  }

  // The robot of the address is the one that is selected, and the one that is selected stands in the address.
  private follow_route(): void {
    const { view, parts } = route.value;
    if (shows_past(route.value)) untracked(() => this.hold.release()); // SAFETY: no hand holds a duty in the past
    if (view !== 'robot') return;
    const asked_id = parts[0];
    // SAFETY: an address is followed when it changes, never because something else has: a press must not move the selection.
    if (asked_id !== undefined) return untracked(() => this.store.want(asked_id));
    const chosen_id = this.store.is_chosen.value ? this.store.selected_id.value : null;
    if (chosen_id !== null) untracked(() => go_to({ view, parts: [chosen_id] }, true));
  }

  // A latch that is older than this page: the events of the robot say since when.
  private date_latch(): void {
    const robot = this.store.selected.value;
    const emergency_id = robot?.emergency_id.value ?? null;
    if (!robot || emergency_id === null || this.phase.value !== 'live') return;
    const { latches } = this.store;
    if (latches.is_known(emergency_id)) return;
    const take = (events: EventRecord[]) =>
      events
        .filter((event) => event.kind === 'emergency')
        .forEach((event) => latches.note(event.emergency_id, event.received_at_us / 1000, true));
    void this.api.events(robot.robot_id).then(take, () => undefined);
  }

  // SAFETY: the echo leaves before anything else is done with the message.
  private measure(message: LiveMessage): void {
    const now_ms = performance.now();
    if (message.type === 'welcome') this.path.begin(message, now_ms);
    else if (message.type === 'echo') this.path.receive_echo(message.stamp_us, now_ms);
    else if (message.type !== 'stamp') return;
    else if (this.path.receive(message, now_ms) && this.link.send({ type: 'echo', stamp_us: message.stamp_us }))
      this.path.echoed(message.stamp_us, now_ms);
    this.stop_path.look();
  }

  // Whatever is sent to a robot goes to the one that is selected, which stays so.
  private ask(path: string, options: RequestInit): Promise<Response> {
    // SAFETY: beside the past that is shown nothing commands a robot; a stop is sent.
    if (is_refused_in_past(route.peek(), options.method ?? 'GET', path, options.body))
      return Promise.reject(new ApiError('A replay is shown: nothing is sent to robots from here but a stop.', 0));
    if (options.method === 'POST' && path.startsWith('/api/v1/robots/')) this.store.keep_selected();
    return fetch(path, { ...options, headers: { ...options.headers, 'Rheonaut-Client': this.tab.id } });
  }

  // Stops the robot that is looked at; without one, every robot.
  stop_selected = (): void => {
    this.store.keep_selected();
    this.hold.forget();
    void this.emergency.stop(this.store.selected_id.peek());
  };

  stop_all = (): void => {
    this.hold.forget();
    void this.emergency.stop(null);
  };

  // SAFETY: the link opens as soon as the password is right; nothing else is waited for.
  log_in = async (user: string, password: string): Promise<void> => {
    this.me.value = await this.api.log_in(user, password);
    this.link.sign_in();
  };

  // The station ends the link, and the page finds itself signed out.
  log_out = async (): Promise<void> => {
    this.hold.release();
    await this.api.log_out();
  };

  // What /live does not report: the station itself and the runs that are open.
  private tell_tabs(duty_robot_id = this.held.peek().robot_id): void {
    this.tabs.tell({ actor: this.store.actor.value, duty_robot_id });
  }

  private async load_recording(): Promise<void> {
    if (this.phase.peek() !== 'live') return;
    // An answer did not come in time: without them nobody has controls, or knows whether a run is open.
    if (this.me.peek() === null || !this.store.are_runs_known.peek()) void this.load();
    const asked_at_ms = performance.now();
    const recording = await this.api.recording().catch(() => null);
    if (recording) this.take_recording(recording, asked_at_ms);
  }

  // Alarms follow from it: an answer that was asked for earlier does not replace a newer one.
  take_recording(recording: Recording, asked_at_ms: number): void {
    if (asked_at_ms < this.recording_asked_at_ms) return;
    this.recording_asked_at_ms = asked_at_ms;
    this.recording.value = recording;
  }

  private async load(): Promise<void> {
    try {
      this.station.value = await this.api.station();
      this.me.value = await this.api.me();
      void this.load_recording();
      this.fluids.value = await this.api.fluids();
      const asked_at = this.store.mark();
      this.store.set_runs(await this.api.open_runs(), asked_at);
      await this.load_newest_run(this.store.selected_id.peek());
    } catch (error) {
      this.store.note(error instanceof Error ? error.message : String(error));
    }
  }

  // What happened before this page was there, or while it was cut off; of a large fleet with the robot that is selected.
  private async load_log(): Promise<void> {
    const { robots, selected } = this.store;
    const is_fleet = robots.peek().length > kMaxWatchedAtOnce;
    const asked = is_fleet ? [selected.peek()].filter((robot) => robot !== null) : robots.peek();
    const asked_at = this.store.mark_log();
    const load = async ({ robot_id }: Robot) => {
      const events = await this.api.newest_events(robot_id, kLogLines);
      this.store.take_past(events, await this.api.newest_commands(robot_id, kLogLines), asked_at);
    };
    let is_whole = true;
    // One after the other: a browser has six connections to a station, and a stop by HTTP may need one.
    for (const robot of asked) await load(robot).catch(() => (is_whole = false));
    if (!is_whole) this.store.note('What had happened before could not be read: the log may have less than there was.');
  }

  // A page that stood still (a machine under load) receives first what waits for it: one refresh is let pass, never two.
  private judge_current(now_ms: number): void {
    const stood_still = now_ms - this.refreshed_at_ms > 3 * kRefresh_ms && !this.let_pass;
    const is_current = this.link.is_current() && this.path.stamp_age_ms(now_ms) < kCurrent_ms;
    this.refreshed_at_ms = now_ms;
    this.let_pass = stood_still && !is_current;
    if (!this.let_pass) this.store.is_current.value = is_current;
  }

  private judge_cut_off(now_ms: number): void {
    if (this.store.is_current.peek() || this.phase.peek() === 'signed_out') return void (this.cut_off.value = null);
    const heard_ms = this.link.lost_at_ms ?? this.link.heard_at_ms;
    if (now_ms - heard_ms >= kCurrent_ms) this.cut_off.value ??= { since_ms: Date.now() - (now_ms - heard_ms) };
  }

  // The newest run of a robot may be one that was interrupted.
  private async load_newest_run(robot_id: string | null): Promise<void> {
    const asked_at = this.store.mark();
    const run = robot_id === null ? null : await this.api.newest_run(robot_id);
    if (run) this.store.take_run_answer(run, asked_at);
  }

  private refresh(): void {
    const now_ms = performance.now();
    this.judge_current(now_ms);
    this.judge_cut_off(now_ms);
    this.store.refresh();
    this.vitals.refresh(this.store.selected.peek(), now_ms);
    this.emergency.look();
    this.judge_hold();
  }

  // A mode that takes no duty, or somebody else in control, has ended the hold; the hand has to press again.
  // SAFETY: nothing says that the motor runs by this hand while it does not.
  private judge_hold(): void {
    if (this.hold.robot_id === null) return;
    const robot = this.store.find(this.hold.robot_id);
    const holder = robot?.state.peek().control?.holder ?? null;
    const is_taken = holder !== null && holder !== this.store.actor.peek() && this.hold.is_past_first_lease;
    if (is_taken || robot?.readout.peek().mode !== 'manual') this.hold.forget();
  }

  // Asks for no more samples than a page can show; of all robots while they are few.
  private watch(): void {
    const selected_id = this.store.selected_id.value;
    const is_fleet = this.store.robots.value.length > kMaxWatchedAtOnce;
    const is_live = this.phase.value === 'live';
    if (selected_id !== null) {
      this.looked_at = [selected_id, ...this.looked_at.filter((id) => id !== selected_id)].slice(0, kMaxWatchedAtOnce);
    }
    const in_sight = this.in_sight.value.filter((id) => this.store.find(id)?.is_away.value === false);
    if (!is_fleet || !is_live) return;
    const watched =
      in_sight.length === 0
        ? this.looked_at
        : [...new Set([...this.looked_at.slice(0, 1), ...in_sight])].slice(0, kMaxWatchedInFleet);
    if (this.link.send({ type: 'watch', robots: watched })) this.store.watch(watched);
  }

  private kept_experiments = () => this.store.experiments.kept_by(this.store.actor.peek(), this.store.client.peek());

  // Keeps the connection, and with a fresh stamp what this page controls and what is in its hands, in whatever view it is.
  private keep_alive(): void {
    const { link, store } = this;
    const { stamp_us } = link;
    if (!link.stamp_is_fresh() || stamp_us === null) return void link.send({ type: 'keep_alive' });
    const robots = store.controlled();
    const experiments = this.kept_experiments();
    link.send({ type: 'keep_alive', stamp_us, robots: robots.slice(0, kNamedAtOnce), experiments });
    for (let at = kNamedAtOnce; at < robots.length; at += kNamedAtOnce)
      link.send({ type: 'keep_alive', stamp_us, robots: robots.slice(at, at + kNamedAtOnce) });
  }

  private renew_lease(robot_id: string): boolean {
    const { link } = this;
    if (!link.stamp_is_fresh() || link.stamp_us === null || shows_past(route.peek())) return false;
    return link.send({ type: 'renew_lease', robot_id, stamp_us: link.stamp_us });
  }

  private on_phase(): void {
    const before = this.phase.peek();
    const now = this.link.phase;
    this.phase.value = now;
    if (now !== 'live') this.path.end();
    this.stop_path.look();
    if (now === 'signed_out') {
      this.me.value = null;
    }
    if (before === 'live') {
      this.store.is_current.value = false;
      this.store.forget_runs();
      this.hold.release();
      this.store.note('The live connection was lost.');
    } else if (now === 'live') {
      this.store.note('The live connection is up.');
      void this.load();
      void this.load_experiments();
    }
  }

  // SAFETY: a page that was loaded anew goes on giving signs of life for what it has begun, whatever it shows.
  load_experiments = async (): Promise<void> => {
    const { experiments } = this.store;
    const asked_at = experiments.mark();
    try {
      experiments.take_open(await this.experiments.open(), asked_at);
    } catch (error) {
      this.store.note(error instanceof Error ? error.message : String(error));
    }
  };

  private on_hold(): void {
    const { robot_id, lapsed, error } = this.hold;
    this.held.value = { robot_id, lapsed, error: error?.message ?? '' };
  }
}
