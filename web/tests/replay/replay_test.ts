// A run that is replayed: what it shows at a moment, steps, jumps, what has happened so far; and that none of it acts.
import { expect, test } from 'vitest';
import type { CommandRecord, EventRecord, StoredSample } from '../../src/api';
import { line_at, lines_of, marks_of, Replay, type Mark } from '../../src/views/runs/replay/replay';
import { act_of, is_taken } from '../../src/views/runs/replay/replay_keys';
import { outline_of, thinned } from '../../src/views/runs/replay/scrub_bar';
import { why_missing } from '../../src/views/runs/replay/losses';
import { spans_of } from '../../src/views/runs/replay/replay_scene';
import { settle } from '../fakes';
import { at, kOrigin_us, kPeriod_us, samples } from './made';

const kExtent = { first_us: kOrigin_us, last_us: at(2499), period_us: kPeriod_us };

async function replay_of(recorded: StoredSample[]): Promise<Replay> {
  let now_ms = 0;
  const ways = {
    samples: (from_us: number, to_us: number) =>
      Promise.resolve(recorded.filter(({ utc_us }) => utc_us >= from_us && utc_us < to_us)),
    set_timer: () => undefined,
  };
  const replay = new Replay(kExtent, ways, () => (now_ms += 1000));
  await settle();
  return replay;
}

test('numbers at a moment are those of the sample that was recorded then', async () => {
  const replay = await replay_of(samples(0, 2500));
  replay.seek(12.345);
  await settle();
  expect(replay.readout.value).toMatchObject({ position_m: 1.234, mode: 'auto', stale: false });
  expect(replay.missing.value).toBeNull();
});

test('before its samples have come nothing is shown of a moment', async () => {
  const replay = await replay_of(samples(0, 2500));
  replay.seek(20);
  expect(replay.is_unknown.value).toBe(false); // was read ahead
  const other = new Replay(kExtent, { samples: () => new Promise(() => undefined), set_timer: () => 0 }, () => 0);
  other.seek(20);
  expect(other.is_unknown.value).toBe(true);
  expect(other.readout.value.position_m).toBeNull();
});

test('a moment in a gap says since when nothing was recorded', async () => {
  const replay = await replay_of(samples(0, 2500, [500, 900]));
  replay.seek(7);
  await settle();
  expect(replay.readout.value.stale).toBe(true);
  expect(replay.missing.value?.since_s).toBeCloseTo(4.99, 6);
  expect(replay.missing.value?.until_s).toBeCloseTo(9, 6);
});

test('steps go from sample to sample, and pause it', async () => {
  const replay = await replay_of(samples(0, 2500, [500, 900]));
  replay.seek(4.98);
  replay.toggle();
  replay.step(1);
  expect(replay.player.is_playing.value).toBe(false);
  expect(replay.player.at_s.value).toBeCloseTo(4.99, 6);
  replay.step(1);
  expect(replay.player.at_s.value).toBeCloseTo(9, 6);
  replay.step(-1);
  expect(replay.player.at_s.value).toBeCloseTo(4.99, 6);
  replay.seek(0);
  replay.step(-1);
  expect(replay.player.at_s.value).toBe(0);
  replay.seek(24.99);
  replay.step(1);
  expect(replay.player.at_s.value).toBeCloseTo(24.99, 6);
});

test('a step into a page that has not come is made when it comes', async () => {
  const open: { from_us: number; resolve(list: StoredSample[]): void }[] = [];
  const recorded = samples(0, 2500);
  const ways = {
    samples: (from_us: number) => new Promise<StoredSample[]>((resolve) => open.push({ from_us, resolve })),
    set_timer: () => 0,
  };
  const replay = new Replay(kExtent, ways, () => 0);
  const answer = async () => {
    const { from_us, resolve } = open.shift()!;
    resolve(recorded.filter(({ utc_us }) => utc_us >= from_us && utc_us < from_us + 1000 * kPeriod_us));
    await settle();
  };
  await answer();
  replay.seek(9.99);
  replay.step(1);
  expect(replay.player.at_s.value).toBeCloseTo(9.99, 6);
  await answer();
  expect(replay.player.at_s.value).toBeCloseTo(10, 6);
});

test('jumps lead to the next mark, and at the end to the end', async () => {
  const replay = await replay_of(samples(0, 2500));
  const mark = (at_s: number): Mark => ({ at_s, tone: 'event', text: '' });
  replay.take_marks([mark(9), mark(3)]);
  replay.jump(1);
  expect(replay.player.at_s.value).toBe(3);
  replay.jump(1);
  expect(replay.player.at_s.value).toBe(9);
  replay.jump(1);
  expect(replay.player.at_s.value).toBeCloseTo(24.99, 6);
  replay.jump(-1);
  replay.jump(-1);
  expect(replay.player.at_s.value).toBe(3);
  replay.jump(-1);
  expect(replay.player.at_s.value).toBe(0);
});

test('it lists what had happened until then, the newest first, and nothing of later', async () => {
  const replay = await replay_of(samples(0, 2500));
  const event = { robot_id: 'rheo-1', boot_id: '11', event_seq: 4, received_at_us: at(900), kind: 'detection' };
  const command = { command_id: '5', robot_id: 'rheo-1', kind: 'set_setpoint', submitted_at_us: at(200) };
  const late = { ...command, command_id: '7', submitted_at_us: at(9000) };
  const moment = { key: 'e11-4', utc_us: at(600), kind: 'event' as const, text: '', by: '' };
  const lines = lines_of(
    [event as unknown as EventRecord],
    [command, late] as unknown as CommandRecord[],
    [moment],
    kExtent,
  );
  expect(lines).toHaveLength(2);
  replay.take_lines(lines);
  replay.seek(1);
  expect(replay.lines.value).toHaveLength(0);
  replay.seek(7);
  expect(replay.lines.value.map(({ key }) => key)).toEqual([`event-11-4-${at(900)}`, 'command-5']);
  replay.seek(5);
  expect(replay.lines.value.map(({ key }) => key)).toEqual(['command-5']);
});

test('of a command it shows what had become of it by then', async () => {
  const replay = await replay_of(samples(0, 2500));
  const made = {
    command_id: '5',
    robot_id: 'rheo-1',
    kind: 'set_setpoint',
    state: 'verified',
    reason: '',
    submitted_at_us: at(200),
    sent_after_us: 50_000,
    acknowledged_after_us: 100_000,
    verified_after_us: 2_000_000,
    ended_at_us: at(400),
  };
  const [line] = lines_of([], [made as unknown as CommandRecord], [], kExtent);
  replay.take_lines([line!]);
  const shown = (at_s: number) => {
    replay.seek(at_s);
    return replay.lines.value[0]?.command;
  };
  expect([2, 2.06, 2.2, 4.5, 2.2].map((at_s) => shown(at_s)?.state)).toEqual([
    'queued',
    'sent',
    'acknowledged',
    'verified',
    'acknowledged',
  ]);
  expect(shown(2.2)).toMatchObject({ sent_after_us: 50_000, acknowledged_after_us: 100_000, verified_after_us: null });

  const refused = {
    ...made,
    state: 'rejected',
    reason: 'latched',
    acknowledged_after_us: null,
    verified_after_us: null,
  };
  const [of_refused] = lines_of([], [{ ...refused, ended_at_us: at(300) } as unknown as CommandRecord], [], kExtent);
  expect(line_at(of_refused!, at(250)).command).toMatchObject({ state: 'sent', reason: '' });
  expect(line_at(of_refused!, at(300)).command).toMatchObject({ state: 'rejected', reason: 'latched' });
});

test('of renewals that were counted the number is shown from the last one on', () => {
  const renewal = {
    command_id: '5',
    robot_id: 'rheo-1',
    kind: 'renew_lease',
    state: 'acknowledged',
    reason: '',
    submitted_at_us: at(200),
    sent_after_us: 1000,
    acknowledged_after_us: 2000,
    verified_after_us: null,
    ended_at_us: at(201),
    further_renewals: 12,
    last_renewed_at_us: at(400),
  };
  const [line] = lines_of([], [renewal as unknown as CommandRecord], [], kExtent);
  expect(line_at(line!, at(200)).command).toMatchObject({ state: 'queued', further_renewals: 0 });
  expect(line_at(line!, at(300)).command).toMatchObject({ state: 'acknowledged', further_renewals: null });
  expect(line_at(line!, at(400)).command).toMatchObject({ state: 'acknowledged', further_renewals: 12 });
});

test('marks are moments of the run and beginnings of gaps', () => {
  const moment = (seq: number) => ({ key: `${seq}`, utc_us: at(seq), kind: 'marker' as const, text: 'light', by: '' });
  const marks = marks_of([moment(100), moment(-5), moment(9999)], [[3, 4.5]], kExtent);
  expect(marks).toEqual([
    { at_s: 1, tone: 'marker', text: 'light' },
    { at_s: 3, tone: 'gap', text: '1.50 s without samples' },
  ]);
});

test('marks on each other are one, the most important; the outline breaks where nothing is recorded', () => {
  const mark = (at_s: number, tone: Mark['tone']): Mark => ({ at_s, tone, text: '' });
  expect(thinned([mark(1, 'event'), mark(1.001, 'alarm'), mark(50, 'command')], 100)).toHaveLength(2);
  expect(thinned([mark(1, 'event'), mark(1.001, 'alarm')], 100)[0]?.tone).toBe('alarm');
  const [first_utc_us, last_utc_us] = [
    [at(0), at(10), at(500)],
    [at(9), at(19), at(509)],
  ];
  const position_m = { min: [0, 0, 0], max: [1, 1, 1] };
  const path = outline_of({ first_utc_us, last_utc_us, position_m } as never, 10, 0.015);
  expect(path.match(/M/g)).toHaveLength(2);
});

test('keys move what is shown; Escape and the letters of the page are none of them', () => {
  const press = (key: string, more = {}) =>
    act_of({ key, ctrlKey: false, metaKey: false, altKey: false, shiftKey: false, defaultPrevented: false, ...more });
  expect(press(' ')).toEqual({ do: 'toggle' });
  expect(press('ArrowRight')).toEqual({ do: 'step', by: 1 });
  expect(press('ArrowLeft', { shiftKey: true })).toEqual({ do: 'move', by_s: -1 });
  expect(press('PageDown')).toEqual({ do: 'jump', by: 1 });
  for (const key of ['Escape', 'Enter', 'g', 'r', 'm', 'a', 'ArrowUp', 'Tab']) expect(press(key)).toBeNull();
  expect(press(' ', { defaultPrevented: true })).toBeNull(); // the stop button keeps Space from everything
  expect(press('ArrowRight', { altKey: true })).toBeNull();
});

test('a field keeps its keys, and a button its Space', () => {
  const within = (tag: string) =>
    ({ closest: (list: string) => (list.split(', ').includes(tag) ? {} : null) }) as unknown as Element;
  expect(is_taken(within('input'), 'ArrowLeft')).toBe(true);
  expect(is_taken(within('button'), ' ')).toBe(true);
  expect(is_taken(within('button'), 'ArrowLeft')).toBe(false);
  expect(is_taken(within('div'), ' ')).toBe(false);
  expect(is_taken(null, ' ')).toBe(false);
});

test('a list that has the focus keeps the keys that scroll it', () => {
  const log = { closest: (list: string) => (list.split(', ').includes('ol') ? {} : null) } as unknown as Element;
  for (const key of ['PageUp', 'PageDown', 'Home', 'End', ' ']) expect(is_taken(log, key)).toBe(true);
  expect(is_taken(log, 'ArrowLeft')).toBe(false);
});

test('the plots offer spans that are shorter than the run, and the whole of it', () => {
  expect(spans_of(15).map(({ span_s }) => span_s)).toEqual([10, 20]);
  expect(spans_of(610).at(-1)).toEqual({ span_s: 660, text: 'Whole run' });
});

test('of a gap it is said whether its samples are lost, on their way, or were never made', () => {
  const hole = { boot_id: '11', seq: 299 };
  const gap = { robot_id: 'a', boot_id: '11', first_seq: 300, last_seq: 499, cause: 'ring_overrun', noticed_at_us: 0 };
  const losses = (change: object) => ({ gaps: [], missing: [], is_whole: true, ...change }) as never;
  expect(why_missing(hole, losses({ gaps: [gap] }))).toBe('200 samples are lost for good (ring overrun).');
  expect(why_missing(hole, losses({ missing: [gap] }))).toMatch(/^200 samples are not here yet/);
  expect(why_missing(hole, losses({ gaps: [{ ...gap, boot_id: '12' }] }))).toMatch(/^The robot made none/);
  expect(why_missing(hole, losses({ is_whole: false }))).toBe('');
  expect(why_missing(hole, null)).toBe('');
});
