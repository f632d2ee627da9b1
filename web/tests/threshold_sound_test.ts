// The sound of thresholds, with a fake instead of audio: when it is heard, and when not.
import { expect, test } from 'vitest';
import { Alerts as AlarmAlerts } from '../src/alerts';
import { ViewSettings } from '../src/settings';
import { kSoundAgain_ms, ThresholdSound } from '../src/threshold_sound';
import { Alerts, type Channel } from '../src/thresholds';

function sound_with() {
  const heard: number[] = [];
  const state = { is_on: true, is_muted: false };
  let now_ms = 0;
  const sound = new ThresholdSound({
    is_on: () => state.is_on,
    is_muted: () => state.is_muted,
    chime: () => void heard.push(now_ms),
  });
  const alerts = new Alerts();
  const values = { estimate_m: 0, position_sd_m: 0, velocity_m_s: 0, duty: 0, impedance_mv: 0, round_trip_us: 0 };
  const ranges = { duty: { low: null, high: 0.5 }, impedance_mv: { low: null, high: 100 } };
  const read = (change: Partial<Record<Channel, number | null>>, after_ms = 100) => {
    now_ms += after_ms;
    alerts.judge(ranges, { ...values, ...change }, now_ms);
    sound.follow(alerts.alerts.value, now_ms);
  };
  return { heard, state, alerts, read };
}

test('a value that crosses a threshold sounds once, and not with each reading', () => {
  const { heard, read } = sound_with();
  read({ duty: 0.2 });
  expect(heard).toHaveLength(0);
  for (let i = 0; i < 20; ++i) read({ duty: 0.9 });
  expect(heard).toHaveLength(1);
});

test('a second one sounds as well, and one that comes again', () => {
  const { heard, read } = sound_with();
  read({ duty: 0.9 });
  read({ duty: 0.9, impedance_mv: 200 });
  expect(heard).toHaveLength(2);
  read({});
  read({ duty: 0.9 });
  expect(heard).toHaveLength(3);
});

test('it sounds again while nobody acknowledges it, and not afterwards', () => {
  const { heard, read, alerts } = sound_with();
  read({ duty: 0.9 });
  read({ duty: 0.9 }, kSoundAgain_ms);
  expect(heard).toHaveLength(2);
  alerts.acknowledge();
  read({ duty: 0.9 }, kSoundAgain_ms);
  expect(heard).toHaveLength(2);
});

test('what is back within its threshold is silent, though it is still announced', () => {
  const { heard, read, alerts } = sound_with();
  read({ duty: 0.9 });
  read({}, kSoundAgain_ms);
  expect(alerts.alerts.value).toHaveLength(1);
  expect(heard).toHaveLength(1);
});

test('without sounds, or muted, nothing is heard; unmuted it is heard while it is still so', () => {
  const { heard, state, read } = sound_with();
  state.is_on = false;
  read({ duty: 0.9 });
  state.is_on = true;
  state.is_muted = true;
  read({ duty: 0.9, impedance_mv: 200 });
  expect(heard).toHaveLength(0);
  state.is_muted = false;
  read({ duty: 0.9, impedance_mv: 200 });
  expect(heard).toHaveLength(1);
});

test('it is heard only where alarms are, and muting it is kept', () => {
  const kept = new Map<string, string>();
  const shelf = {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
  };
  const played: string[] = [];
  const settings = new ViewSettings(shelf);
  const alerts = new AlarmAlerts(settings, {
    beep: () => void played.push('beep'),
    chime: () => void played.push('chime'),
    notify: () => undefined,
    ask: () => Promise.resolve(true),
  });
  alerts.chime();
  expect(played).toEqual([]);
  settings.sound.set(true);
  alerts.chime();
  expect(played).toEqual(['chime']);
  expect(settings.threshold_mute.on.value).toBe(false);
  settings.threshold_mute.set(true);
  expect(new ViewSettings(shelf).threshold_mute.on.value).toBe(true);
});
