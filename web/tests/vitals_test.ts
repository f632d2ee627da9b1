// How old what is seen is: from the robot's clock to the page.
import { expect, test } from 'vitest';
import type { RobotState } from '../src/api';
import { Robot } from '../src/robot';
import { StationPath } from '../src/station_path';
import { Vitals } from '../src/vitals';
import { batch } from './fakes';

const kOffset_us = 7_000_000; // the station's steady time less the robot's

function seen_by(clock: Partial<RobotState['clock']> | null) {
  const path = new StationPath();
  path.begin({ stamp_us: 0, utc_us: 0 }, 0);
  path.receive({ stamp_us: kOffset_us }, 1); // at 1 ms of the page the station's time was that
  const state = { robot_id: 'rheo-1', link: 'connected', boot_id: '11', mode: 'auto', clock } as RobotState;
  const robot = new Robot(state, 0);
  robot.receive(batch(0, 5), 60); // the newest sample is of 40 ms on the robot's clock
  return { robot, path, vitals: new Vitals(path) };
}

test('the age counts from the robot’s clock, not from when it came', () => {
  const { robot, path } = seen_by({ offset_us: kOffset_us, round_trip_us: 2000 });
  expect(robot.seen_age_ms(61, path.station_us(61))).toBeCloseTo(20);
});

test('without that clock it counts from when it came', () => {
  const { robot, path } = seen_by(null);
  expect(robot.seen_age_ms(75, path.station_us(75))).toBeCloseTo(15);
});

test('shown is the worst of the last half second, twice a second', () => {
  const { robot, vitals } = seen_by({ offset_us: kOffset_us, round_trip_us: 2000 });
  vitals.refresh(robot, 100);
  const first = vitals.now.value.seen_ms;
  vitals.refresh(robot, 300);
  expect(vitals.now.value.seen_ms).toBe(first);
  robot.receive(batch(5, 50), 550);
  vitals.refresh(robot, 600);
  expect(vitals.now.value.seen_ms).toBeCloseTo(259); // of 300 ms, though it is younger now
  expect(vitals.now.value.robot_ms).toBe(2);
});

test('another robot is not shown with the age of the one before', () => {
  const { robot, vitals } = seen_by({ offset_us: kOffset_us });
  vitals.refresh(robot, 5000);
  vitals.refresh(new Robot({ robot_id: 'b', link: 'connected' } as RobotState, 0), 5001);
  expect(vitals.now.value.seen_ms).toBeNull();
});
