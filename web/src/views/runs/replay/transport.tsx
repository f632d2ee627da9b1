// What moves a replay: play and pause, steps and jumps, speed, the bar of the whole run, and what is at the moment.

import { clock_time, date_and_time } from '../../../format';
import { Choice } from '../../../parts/choice';
import type { Losses, Overview } from '../runs_api';
import { since_text } from '../time_axis';
import { why_missing } from './losses';
import { kSpeeds } from './player';
import type { Replay } from './replay';
import { ScrubBar } from './scrub_bar';

const kMarkBefore = 'M3 3h2v10h-2zM14 3v10l-8-5z';
const kStepBack = 'M11 3v10l-7-5zM12 3h1.5v10h-1.5z';
const kStepOn = 'M5 3v10l7-5zM2.5 3h1.5v10h-1.5z';
const kMarkAfter = 'M13 3h-2v10h2zM2 3v10l8-5z';

interface Props {
  replay: Replay;
  whole: Overview;
  gaps_s: [number, number][];
  note: string; // of the address
  losses: Losses | null;
  unread: string; // what happened, and could not be read
  out_of_reach: string; // events that the station does not list any more
}

export function Transport({ replay, whole, gaps_s, note, losses, unread, out_of_reach }: Props) {
  const { player } = replay;
  const is_playing = player.is_playing.value;
  const at_s = player.at_s.value;
  const speed = player.speed.value;
  const speeds = [...new Set([...kSpeeds, speed])].sort((a, b) => a - b);
  const button = (id: string, path: string, title: string, act: () => void) => (
    <button type="button" id={id} aria-label={title} title={title} onClick={act}>
      <svg viewBox="0 0 16 16" aria-hidden="true">
        <path d={path} />
      </svg>
    </button>
  );
  return (
    <div class="transport" role="group" aria-label="Replay">
      <div class="transport-row">
        <span class="transport-buttons">
          {button('replay-mark-before', kMarkBefore, 'Previous event, marker or gap (Page Up)', () => replay.jump(-1))}
          {button('replay-step-back', kStepBack, 'Previous sample (←)', () => replay.step(-1))}
          <button
            type="button"
            id="replay-play"
            class="primary"
            aria-pressed={is_playing}
            title="Space"
            onClick={() => replay.toggle()}
          >
            {is_playing ? 'Pause' : 'Play'}
          </button>
          {button('replay-step-on', kStepOn, 'Next sample (→)', () => replay.step(1))}
          {button('replay-mark-after', kMarkAfter, 'Next event, marker or gap (Page Down)', () => replay.jump(1))}
        </span>
        <Choice
          id="replay-speed"
          label="Speed"
          options={speeds.map((value) => ({ value: String(value), text: `${value} ×` }))}
          value={String(speed)}
          on_choose={(value) => player.set_speed(Number(value))}
        />
        <output class="replay-moment" id="replay-moment">
          <b>{since_text(at_s, is_playing ? 1 : 3)}</b>
          <span class="quiet"> of {since_text(replay.length_s.value)}</span>
        </output>
        <time class="replay-clock" id="replay-clock">
          {date_and_time(replay.at_us.value / 1000).slice(0, 10)} {clock_time(Math.floor(replay.at_us.value / 1000))}
        </time>
      </div>
      <ScrubBar replay={replay} whole={whole} gaps_s={gaps_s} />
      <p class="transport-note" id="replay-note" role="status">
        {note_of(replay, losses, unread) || note || out_of_reach}
      </p>
    </div>
  );
}

// What is to be known of the moment, the most important first.
function note_of(replay: Replay, losses: Losses | null, unread: string): string {
  const problem = replay.pages.problem.value;
  if (problem) return `Samples do not come: ${problem} It is tried again each second.`;
  if (unread) return unread;
  if (replay.player.is_waiting.value) return 'Waiting for samples: the station does not send them as fast as this.';
  if (replay.is_unknown.value) return 'The samples of this moment are on their way.';
  const missing = replay.missing.value;
  if (!missing) return '';
  const { since_s, until_s } = missing;
  const length = until_s === null ? '' : `, ${since_text(until_s - since_s)} long`;
  const why = why_missing(missing, losses);
  return `A gap${length}: no sample was recorded here since ${since_text(since_s)}. ${why}`.trim();
}
