// The whole run as one bar: its position in outline, what happened in it, where samples are missing, and the moment shown.

import { useMemo, useRef } from 'preact/hooks';
import { since_text } from '../time_axis';
import type { Overview } from '../runs_api';
import type { Mark, Replay } from './replay';

const kHeight = 40; // of the outline, in its own units
const kWidth = 1000;
const kSlots = 240; // marks closer together than this share of the width are one

export function ScrubBar({ replay, whole, gaps_s }: { replay: Replay; whole: Overview; gaps_s: [number, number][] }) {
  const bar = useRef<HTMLDivElement>(null);
  const length_s = Math.max(replay.length_s.value, 1e-6);
  const at_s = replay.player.at_s.value;
  const share = (time_s: number) => `${(Math.min(1, Math.max(0, time_s / length_s)) * 100).toFixed(3)}%`;
  const marks = useMemo(() => thinned(replay.marks.value, length_s), [replay.marks.value, length_s]);
  const outline = useMemo(() => outline_of(whole, length_s, replay.reel.gap_s), [whole, length_s]);
  // The same for as long as the run is: it is not made anew while the moment moves.
  const still = useMemo(
    () => (
      <>
        <svg viewBox={`0 0 ${kWidth} ${kHeight}`} preserveAspectRatio="none" aria-hidden="true">
          <path d={outline} />
        </svg>
        {gaps_s.map(([from_s, to_s]) => (
          <span key={from_s} class="scrub-gap" style={{ left: share(from_s), width: share(to_s - from_s) }} />
        ))}
        {marks.map(({ at_s: time_s, tone, text }) => (
          <i key={`${tone} ${time_s}`} class={tone} style={{ left: share(time_s) }} title={text} />
        ))}
      </>
    ),
    [marks, outline, gaps_s, length_s],
  );
  const seek = (event: PointerEvent) => {
    const { left, width } = (bar.current as HTMLDivElement).getBoundingClientRect();
    replay.seek(((event.clientX - left) / width) * length_s);
  };
  return (
    <div
      class="scrub-bar"
      id="scrub-bar"
      ref={bar}
      role="slider"
      tabIndex={0}
      aria-label="Moment of the run"
      aria-valuemin={0}
      aria-valuemax={Number(length_s.toFixed(2))}
      aria-valuenow={Number(at_s.toFixed(2))}
      aria-valuetext={`${since_text(at_s)} of ${since_text(length_s)}`}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        replay.player.pause();
        seek(event);
      }}
      onPointerMove={(event) => event.currentTarget.hasPointerCapture(event.pointerId) && seek(event)}
    >
      {still}
      <u style={{ width: share(at_s) }} />
      <b style={{ left: share(at_s) }} />
    </div>
  );
}

const kWeight: Record<Mark['tone'], number> = { event: 0, command: 1, marker: 2, gap: 3, alarm: 4 };

// The marks to draw: of those that would lie on each other the most important.
export function thinned(marks: readonly Mark[], length_s: number): Mark[] {
  const slots = new Map<number, Mark>();
  for (const mark of marks) {
    if (mark.tone === 'gap') continue; // is drawn as a stretch
    const slot = Math.round((mark.at_s / length_s) * kSlots);
    const known = slots.get(slot);
    if (!known || kWeight[mark.tone] > kWeight[known.tone]) slots.set(slot, mark);
  }
  return [...slots.values()];
}

// The least and the largest position of each point as one surface, with a break where nothing is recorded.
export function outline_of(
  { first_utc_us, last_utc_us, position_m }: Overview,
  length_s: number,
  gap_s: number,
): string {
  const [low, high] = [position_m?.min ?? [], position_m?.max ?? []];
  const known = [...low, ...high].filter((value): value is number => value !== null);
  if (known.length === 0) return '';
  const [least, most] = known.reduce(
    ([a, b], value) => [Math.min(a, value), Math.max(b, value)],
    [Infinity, -Infinity],
  );
  const origin_us = first_utc_us[0] as number;
  const x = (utc_us: number) => (((utc_us - origin_us) / 1e6 / length_s) * kWidth).toFixed(1);
  const y = (value: number) => (kHeight - 4 - ((value - least) / (most - least || 1)) * (kHeight - 8)).toFixed(1);
  const pieces: string[] = [];
  let is_down = false;
  for (let at = 0; at < first_utc_us.length; ++at) {
    const [min, max] = [low[at] ?? null, high[at] ?? null];
    const step_us = at > 0 ? (first_utc_us[at] as number) - (last_utc_us[at - 1] as number) : 0;
    if (min === null || max === null) {
      is_down = false;
      continue;
    }
    if (step_us > gap_s * 1e6) is_down = false;
    pieces.push(
      `${is_down ? 'L' : 'M'}${x(first_utc_us[at] as number)} ${y(min)}L${x(last_utc_us[at] as number)} ${y(max)}`,
    );
    is_down = true;
  }
  return pieces.join('');
}
