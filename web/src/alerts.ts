// Sound and notification of a new alarm, for a person who looks elsewhere. Both are off until somebody turns them on.

import { effect, signal, type ReadonlySignal } from '@preact/signals';
import type { Alarm } from './alarms';
import type { ViewSettings } from './settings';

export interface AlertWays {
  beep(): void;
  chime(): void; // softer: a value beyond a threshold of this browser
  notify(title: string, text: string): void;
  ask(): Promise<boolean>; // whether the browser may notify
}

export class Alerts {
  readonly problem = signal(''); // why notification is not on
  private known = new Set<string>();

  constructor(
    readonly settings: Pick<ViewSettings, 'sound' | 'notification'>,
    private readonly ways: AlertWays,
  ) {}

  follow(alarms: ReadonlySignal<Alarm[]>): () => void {
    return effect(() => this.take(alarms.value.filter((alarm) => alarm.level === 'alarm')));
  }

  // By a person: the sound is heard at once, so that its loudness is known.
  set_sound(on: boolean): void {
    this.settings.sound.set(on);
    if (on) this.ways.beep();
  }

  chime(): void {
    if (this.settings.sound.on.peek()) this.ways.chime();
  }

  async set_notification(on: boolean): Promise<void> {
    this.problem.value = '';
    const may = on && (await this.ways.ask());
    if (on && !may)
      this.problem.value = 'The browser does not allow it for this page (it needs HTTPS or this machine).';
    this.settings.notification.set(may);
  }

  private take(alarms: Alarm[]): void {
    const fresh = alarms.filter((alarm) => !this.known.has(alarm.key));
    this.known = new Set(alarms.map((alarm) => alarm.key));
    if (fresh.length === 0) return;
    if (this.settings.sound.on.peek()) this.ways.beep();
    const text = fresh.map(({ robot_id, text }) => (robot_id === null ? text : `${robot_id}: ${text}`)).join('\n');
    if (this.settings.notification.on.peek()) this.ways.notify('Rheonaut', text);
  }
}

// Three short tones of an alarm, two lower ones of a threshold, made by the browser itself. It plays none before the first
// press on a page.
export function browser_alerts(): AlertWays {
  let audio: AudioContext | null = null;
  const play = (frequency_hz: number, at: readonly number[]) => {
    const context = (audio ??= new AudioContext());
    void context.resume().then(() => at.forEach((at_s) => tone(context, frequency_hz, context.currentTime + at_s)));
  };
  return {
    beep: () => play(880, [0, 0.22, 0.44]),
    chime: () => play(587, [0, 0.22]),
    notify(title, text) {
      try {
        new Notification(title, { body: text, tag: 'rheonaut', icon: '/favicon_emergency.svg' });
      } catch {
        // Some telephones allow it to no page that is open.
      }
    },
    async ask() {
      if (typeof Notification === 'undefined' || !isSecureContext) return false;
      return (await Notification.requestPermission()) === 'granted';
    },
  };
}

function tone(audio: AudioContext, frequency_hz: number, at_s: number): void {
  const [source, loudness] = [audio.createOscillator(), audio.createGain()];
  source.frequency.value = frequency_hz;
  loudness.gain.setValueAtTime(0, at_s);
  loudness.gain.linearRampToValueAtTime(0.25, at_s + 0.01);
  loudness.gain.setValueAtTime(0.25, at_s + 0.12);
  loudness.gain.linearRampToValueAtTime(0, at_s + 0.15);
  source.connect(loudness).connect(audio.destination);
  source.start(at_s);
  source.stop(at_s + 0.16);
}
