// Thresholds of this browser: a list to set them, and a line that announces what is beyond one until it is acknowledged.

import { useSignal } from '@preact/signals';
import { useEffect, useMemo } from 'preact/hooks';
import {
  clock_time,
  milliseconds_of_us,
  millimetres,
  millimetres_per_s,
  millivolts,
  percent,
  plus_minus,
} from '../format';
import { useCloseOnEscape } from '../keys';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { ThresholdSound } from '../threshold_sound';
import { browser_shelf } from '../settings';
import { Alerts, kChannels, Thresholds, type Alert, type Channel } from '../thresholds';

interface Shown {
  title: string;
  unit: string;
  text(value: number): string;
  per_unit: number; // what one of the unit is in the channel's own
}

const kShown: Record<Channel, Shown> = {
  estimate_m: { title: 'Position, estimated', unit: 'mm', text: (value) => millimetres(value), per_unit: 1e-3 },
  position_sd_m: { title: 'Position sd', unit: 'mm', text: (value) => millimetres(value), per_unit: 1e-3 },
  velocity_m_s: { title: 'Velocity', unit: 'mm/s', text: millimetres_per_s, per_unit: 1e-3 },
  duty: { title: 'Duty', unit: '%', text: (value) => percent(value), per_unit: 1e-2 },
  impedance_mv: { title: 'Impedance', unit: 'mV', text: millivolts, per_unit: 1 },
  round_trip_us: { title: 'Round trip', unit: 'ms', text: (value) => milliseconds_of_us(value), per_unit: 1e3 },
};

export const thresholds = new Thresholds(browser_shelf());
const of_robots = new WeakMap<object, Alerts>();

export function alerts_of(robot: object): Alerts {
  let alerts = of_robots.get(robot);
  if (!alerts) of_robots.set(robot, (alerts = new Alerts()));
  return alerts;
}

// The number that somebody typed; null: nothing is typed; undefined: it is no number.
export function parse_threshold(text: string, per_unit: number): number | null | undefined {
  const plain = text.trim().replace('\u2212', '-').replace(',', '.');
  if (plain === '') return null;
  return /^[+-]?(\d+(\.\d*)?|\.\d+)$/.test(plain) ? Number((Number(plain) * per_unit).toPrecision(12)) : undefined;
}

export function AlertLine({ session, robot }: { session: Session; robot: Robot }) {
  const alerts = alerts_of(robot);
  const now = robot.readout.value;
  const ranges = thresholds.ranges.value;
  const round_trip_us = robot.state.value.clock?.round_trip_us ?? null;
  const { sound, threshold_mute } = session.settings;
  const warning = useMemo(
    () =>
      new ThresholdSound({
        is_on: () => sound.on.peek(),
        is_muted: () => threshold_mute.on.peek(),
        chime: () => session.alerts.chime(),
      }),
    [session, robot],
  );
  useEffect(() => {
    // SAFETY: an old value is not judged as if it were of now.
    if (now.stale || !session.store.is_current.peek()) return;
    alerts.judge(ranges, { ...now, round_trip_us }, Date.now());
    warning.follow(alerts.alerts.peek(), performance.now());
  }, [now, ranges]);
  const is_known = !now.stale && session.store.is_current.value;
  const announced = alerts.alerts.value.filter((alert) => !alert.is_acknowledged);
  if (announced.length === 0) return null;
  return (
    <div class="alert-line" id="alert-line" role="alert">
      <ul>
        {announced.map((alert) => (
          <li key={alert.channel} class={alert.is_beyond && is_known ? 'beyond' : 'over'}>
            {sentence(alert, is_known)}
          </li>
        ))}
      </ul>
      {sound.on.value && (
        <button
          type="button"
          id="mute-alerts"
          aria-pressed={threshold_mute.on.value}
          onClick={() => threshold_mute.set(!threshold_mute.on.peek())}
        >
          {threshold_mute.on.value ? 'Muted' : 'Mute'}
        </button>
      )}
      <button type="button" id="acknowledge-alerts" onClick={() => alerts.acknowledge()}>
        Acknowledge
      </button>
    </div>
  );
}

// SAFETY: what is not known now is said of the time until it was seen last. `is_known`: samples come.
export function sentence(alert: Alert, is_known: boolean): string {
  const { channel, worst, worst_sd_m, limit, since_ms, is_beyond } = alert;
  const { title, unit, text } = kShown[channel];
  const is_above = worst > limit;
  const at = clock_time(since_ms).slice(0, 8);
  const is_past = is_beyond && !is_known;
  const when = is_past ? `from ${at} until it was seen last` : `${is_beyond ? 'since' : 'at'} ${at}`;
  const what = `${is_past ? 'was ' : ''}${is_above ? 'above' : 'below'} ${text(limit)} ${unit}`;
  const spread = channel === 'estimate_m' ? ` ${plus_minus(worst_sd_m)}` : '';
  const most = `${is_above ? 'up' : 'down'} to ${text(worst)}${spread}`;
  return `${title} ${what} ${when}, ${most}${is_beyond ? '' : '; over now'}`;
}

export function ThresholdList({ session }: { session: Session }) {
  const open = useSignal(false);
  useCloseOnEscape(() => (open.value = false));
  const set = Object.keys(thresholds.ranges.value).length;
  return (
    <div class="trace-choice">
      <button
        type="button"
        id="plots-thresholds"
        aria-expanded={open.value}
        aria-controls="threshold-list"
        onClick={() => (open.value = !open.value)}
      >
        Thresholds{set > 0 ? ` (${set})` : ''}
      </button>
      {open.value && (
        <div id="threshold-list" role="group" aria-label="Thresholds, kept in this browser">
          <p class="quiet">They colour values here. They are no limits of the robot.</p>
          <div class="threshold-head quiet" aria-hidden="true">
            <span>below</span>
            <span>above</span>
          </div>
          {kChannels.map((channel) => (
            <ThresholdRow key={channel} channel={channel} />
          ))}
          <SoundChoice session={session} />
        </div>
      )}
    </div>
  );
}

// Thresholds are heard where alarms are, unless somebody wants to hear alarms alone.
function SoundChoice({ session }: { session: Session }) {
  const { sound, threshold_mute } = session.settings;
  return (
    <label class="threshold-sound">
      <input
        type="checkbox"
        autoComplete="off"
        id="threshold-sound"
        checked={!threshold_mute.on.value}
        onChange={(event) => threshold_mute.set(!event.currentTarget.checked)}
      />
      <span>
        A value that goes beyond one sounds
        {!sound.on.value && <span class="quiet">, once sounds are on (in the list of alarms)</span>}
      </span>
    </label>
  );
}

function ThresholdRow({ channel }: { channel: Channel }) {
  const { title, unit, per_unit } = kShown[channel];
  const range = thresholds.ranges.value[channel] ?? { low: null, high: null };
  const problem = useSignal('');
  const said = (value: number | null) => (value === null ? '' : String(Number((value / per_unit).toPrecision(9))));
  const drafts = { low: useSignal(said(range.low)), high: useSignal(said(range.high)) }; // as it is being typed
  const field = (side: 'low' | 'high', word: string) => {
    return (
      <input
        autoComplete="off"
        inputMode="decimal"
        name={`${channel}-${side}`}
        aria-label={`${title} ${word}, in ${unit}`}
        aria-invalid={problem.value === side}
        value={drafts[side].value}
        onInput={(event) => {
          const text = (drafts[side].value = event.currentTarget.value);
          problem.value = parse_threshold(text, per_unit) === undefined ? side : '';
        }}
        // With Enter, or when the field is left: the 1 of 12 alerts nobody.
        onChange={(event) => {
          const wanted = parse_threshold(event.currentTarget.value, per_unit);
          if (wanted !== undefined) thresholds.set(channel, { ...range, [side]: wanted });
        }}
      />
    );
  };
  return (
    <div class="threshold-row">
      <span>
        {title} <span class="unit">{unit}</span>
      </span>
      {field('low', 'below')}
      {field('high', 'above')}
      {problem.value && (
        <p class="outcome failed" role="alert">
          A threshold is a number of {unit}, such as 12.5, or nothing.
        </p>
      )}
    </div>
  );
}
