// Tabs of one session that know of each other.
import { expect, test } from 'vitest';
import { kForgotten_ms, kTell_ms, Tabs, type Channel } from '../src/tabs';

function three_tabs() {
  const world = { now_ms: 0 };
  const channels: Channel[] = [];
  const open = () => {
    const own: Channel = {
      onmessage: null,
      postMessage: (data) =>
        channels.filter((other) => other !== own).forEach((other) => other.onmessage?.({ data } as MessageEvent)),
    };
    channels.push(own);
    return new Tabs(own, () => world.now_ms);
  };
  return { world, tabs: [open(), open(), open()] as const };
}
const idle = (actor: string) => ({ actor, duty_robot_id: null });

test('tabs of one session know of each other at once, those of another do not count', () => {
  const { tabs } = three_tabs();
  tabs[0].tell(idle('session:1'));
  tabs[1].tell(idle('session:1'));
  tabs[2].tell(idle('session:2'));
  expect(tabs.map((tab) => tab.others.value.length)).toEqual([1, 1, 0]);
});

test('which of them runs a motor is known to the others', () => {
  const { tabs } = three_tabs();
  tabs[0].tell(idle('session:1'));
  tabs[1].tell({ actor: 'session:1', duty_robot_id: 'sim-1' });
  expect(tabs[0].others.value).toEqual([{ actor: 'session:1', duty_robot_id: 'sim-1' }]);
  tabs[1].tell(idle('session:1'));
  expect(tabs[0].others.value[0]?.duty_robot_id).toBeNull();
});

test('one that is closed is gone at once, one that was killed after a while', () => {
  const { tabs, world } = three_tabs();
  for (const tab of tabs) tab.tell(idle('session:1'));
  tabs[1].leave();
  expect(tabs[0].others.value).toHaveLength(1);
  for (; world.now_ms <= kForgotten_ms; world.now_ms += kTell_ms) tabs[0].tell(idle('session:1')); // the third is silent
  tabs[0].tell(idle('session:1'));
  expect(tabs[0].others.value).toHaveLength(0);
});

test('a browser without channels has no other tabs', () => {
  const tabs = new Tabs(null, () => 0);
  tabs.tell(idle('session:1'));
  expect(tabs.others.value).toEqual([]);
});
