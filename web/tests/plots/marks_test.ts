// What stands on the time axis beside the samples, and what this browser keeps of the choice of traces.
import { expect, test } from 'vitest';
import type { CommandRecord, EventRecord, RunRecord } from '../../src/api';
import { Marks } from '../../src/plots/marks';
import { chosen_strips, columns_of, PlotSettings } from '../../src/plots/strips';
import { line_at } from '../../src/views/runs/replay/replay';

const command = (id: string, at_us: number, state = 'verified') =>
  ({
    command_id: id,
    kind: 'set_setpoint',
    state,
    submitted_at_us: at_us,
    arguments: {},
    reason: '',
    verified_after_us: null,
  }) as unknown as CommandRecord;
const event = (seq: number, at_us: number, kind = 'mode_changed') =>
  ({
    robot_id: 'a',
    boot_id: '1',
    event_seq: seq,
    received_at_us: at_us,
    kind,
    cause: 'none',
    position_m: null,
    detail: '',
  }) as unknown as EventRecord;

test('marks stand in the order of time, and one that is told again is one', () => {
  const marks = new Marks();
  marks.take_commands([command('2', 9e6), command('1', 3e6)]);
  marks.take_events([event(1, 5e6)]);
  marks.take_commands([command('2', 9e6, 'failed')]);
  expect(marks.all.map(({ at_s }) => at_s)).toEqual([3, 5, 9]);
  expect(marks.all.at(-1)?.tone).toBe('caution');
  expect(marks.within(4, 9).map(({ at_s }) => at_s)).toEqual([5]);
  expect(marks.near(5.4, 0.5)?.at_s).toBe(5);
  expect(marks.near(6, 0.5)).toBeNull();
});

test('the log of another robot is not ours, and what is known from the station is not doubled', () => {
  const marks = new Marks();
  const line = { at_ms: 5000, note: null, position_sd_m: null, command: null };
  marks.take_log([{ ...line, key: 'event-b-1-1-5000000', robot_id: 'b', event: event(1, 5e6) }], 'a');
  expect(marks.all).toHaveLength(0);
  marks.take_log([{ ...line, key: 'event-a-1-1-5000000', robot_id: 'a', event: event(1, 5e6) }], 'a');
  marks.take_events([event(1, 5e6)]);
  expect(marks.all).toHaveLength(1);
});

test('a mark of a replay has of a command what was known at the moment, there and back', () => {
  let now_us = 0;
  const marks = new Marks((line) => line_at(line, now_us));
  const refused = {
    ...command('5', 2e6, 'rejected'),
    reason: 'latched',
    sent_after_us: 50_000,
    acknowledged_after_us: null,
    ended_at_us: 3e6,
  } as CommandRecord;
  marks.take_commands([refused]);
  const shown = (at_s: number) => {
    now_us = at_s * 1e6;
    return { under_cursor: marks.near(2, 0.1), drawn: marks.within(0, 9)[0] };
  };
  for (const at_s of [3, 2.5, 3]) {
    const { under_cursor, drawn } = shown(at_s);
    expect(under_cursor).toEqual(drawn);
    expect(drawn?.tone).toBe(at_s === 3 ? 'caution' : '');
    expect(drawn?.text).toMatch(at_s === 3 ? /rejected: / : /· sent$/);
  }
});

test('a run that is open has no end', () => {
  const marks = new Marks();
  marks.set_runs([{ run_id: 4, name: '', started_at_us: 2e6, ended_at_us: null } as unknown as RunRecord]);
  expect(marks.runs).toEqual([{ run_id: 4, from_s: 2, to_s: null, text: 'run 4' }]);
});

function shelf(kept: string | null = null) {
  const held = { text: kept, getItem: () => held.text, setItem: (_: string, text: string) => void (held.text = text) };
  return held;
}

test('the choice of traces is kept, and what cannot be read is the usual one', () => {
  const held = shelf();
  const settings = new PlotSettings(held);
  settings.toggle('velocity');
  settings.toggle('duty');
  settings.change({ is_utc: true });
  const again = new PlotSettings(held).kept.value;
  expect(again).toEqual(settings.kept.value);
  expect(again.traces).toContain('velocity');
  expect(again.traces).not.toContain('duty');
  for (const broken of ['{', '{"traces":"x"}', '{"traces":["none"],"span_s":-1}', 'null']) {
    expect(new PlotSettings(shelf(broken)).kept.value).toEqual(new PlotSettings(null).kept.value);
  }
});

test('the last trace stays', () => {
  const settings = new PlotSettings(null);
  for (const name of [...settings.kept.value.traces]) settings.toggle(name);
  expect(settings.kept.value.traces).toHaveLength(1);
});

test('only chosen traces are drawn, and the band goes with the estimate', () => {
  expect(columns_of(chosen_strips(['setpoint', 'duty']))).toEqual(['setpoint_m', 'duty']);
  expect(columns_of(chosen_strips(['position']))).toEqual(['estimate_low_m', 'estimate_high_m', 'estimate_m']);
});
