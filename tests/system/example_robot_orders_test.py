"""Schedules, timed commands and disturbances of examples/robot.py, in virtual time: when they act, and what ends them."""
import unittest

from example_robot import S, Bench  # first: it may go on in another Python

from station_link import pb

NAN = float("nan")


class Orders(Bench):
    def schedule(self, *pairs, **fields):
        ticks, duties = zip(*pairs) if pairs else ((), ())
        return self.command(set_duty_schedule=pb.SetDutySchedule(tick=ticks, duty=duties), **fields)

    def renew(self, **fields):
        return self.command(renew_lease=pb.RenewLease(**fields))

    def disturbance(self, disturbance_m):
        return self.command(inject_disturbance=pb.InjectDisturbance(disturbance_m=disturbance_m))

    def store(self, after_us=S // 5, life_us=S, duty=0.5):
        """A duty that waits for its time."""
        command = self.duty(duty, execute_at_robot_us=self.now_us + after_us, life_us=life_us)
        self.assertEqual(self.answer(command), "accepted")
        self.assertEqual(self.ack.effect_at_robot_us, command.execute_at_robot_us)
        return command

    def duties(self, count):
        return [values[3] for _, _, values in list(self.robot.samples.items)[-count:]]


class ScheduleTest(Orders):
    def test_it_runs_tick_by_tick_to_its_end(self):
        self.run_for(S)
        self.assertEqual(self.answer(self.schedule((0, 0.25), (3, -0.5), (5, 0.0))), "accepted")
        self.run_for(80_000)
        self.assertEqual(self.duties(8), [0.25] * 3 + [-0.5] * 2 + [0.0] * 3)
        self.assertEqual(self.kinds()[-1], "duty_schedule_ended")
        self.assertEqual(self.answer(self.renew()), "nothing_to_renew")

    def test_it_has_a_lease(self):
        self.answer(self.schedule((0, 0.25), (100, 0.5), (200, 0.0)))
        self.run_for(400_000)
        self.assertEqual(self.answer(self.renew()), "accepted")
        self.run_for(490_000)
        self.assertEqual(self.duties(1), [0.25])
        self.run_for(S)
        self.assertEqual(set(self.duties(99)), {0.0})
        self.assertEqual(self.kinds()[-1], "lease_lapsed")

    def test_a_duty_a_mode_and_a_stop_end_it(self):
        manual = pb.SetMode(mode=pb.MODE_MANUAL)
        for end in (self.duty(0.0), self.auto(0.0), self.stop()):
            self.answer(self.schedule((0, 0.25), (20, 0.5), (40, 0.0)))
            self.run_for(50_000)
            self.answer(end)
            if self.robot.emergency_id:
                self.assertEqual(self.answer(self.schedule((0, 0.25), (1, 0.0))), "latched")
                self.answer(self.clear(self.robot.emergency_id))
            self.answer(self.command(set_mode=manual))
            self.run_for(300_000)
            self.assertEqual(set(self.duties(30)), {0.0}, end)

    def test_what_is_wrong_with_one(self):
        for answer, pairs in (("malformed", []), ("malformed", [(0, 0.1)]), ("malformed", [(1, 0.1), (1, 0.0)]),
                              ("malformed", [(i, 0.0) for i in range(65)]), ("not_finite", [(0, NAN), (1, 0.0)]),
                              ("out_of_range", [(0, -1.5), (1, 0.0)])):
            self.assertEqual(self.answer(self.schedule(*pairs)), answer)
        uneven = pb.SetDutySchedule(tick=[0, 1, 2], duty=[0.1, 0.0])
        self.assertEqual(self.answer(self.command(set_duty_schedule=uneven)), "malformed")
        self.answer(self.schedule((5, 0.25), (6, 0.0)))
        self.assertEqual(self.answer(self.command(zero_position=pb.ZeroPosition())), "motor_on", "it is about to run")
        self.answer(self.auto(0.1))
        self.assertEqual(self.answer(self.schedule((0, 0.1), (1, 0.0))), "wrong_mode")
        self.robot.cart.position_m, self.robot.is_outside = 1.3, True
        self.answer(self.command(set_mode=pb.SetMode(mode=pb.MODE_MANUAL)))
        self.assertEqual(self.answer(self.schedule((0, -0.1), (1, 0.1), (2, 0.0))), "outward")


class TimedTest(Orders):
    def test_it_acts_at_its_time_and_not_before(self):
        at_us = self.store().execute_at_robot_us
        self.run_for(S // 2)
        ticks = [(robot_time_us, values[3]) for robot_time_us, _, values in self.robot.samples.items]
        self.assertTrue(all((duty == 0.5) == (robot_time_us >= at_us) for robot_time_us, duty in ticks))
        self.assertEqual(self.later_answers(), [], "it was acknowledged when it was stored")

    def test_the_earliest_first_and_four_at_most(self):
        ids = [self.store(after_us=after_us).command_id for after_us in (400_000, 200_000, 300_000, 100_000)]
        self.assertEqual([command.command_id for command in self.robot.timed], [ids[3], ids[1], ids[2], ids[0]])
        self.assertEqual(self.answer(self.duty(0.1, execute_at_robot_us=self.now_us + 1)), "busy")

    def test_it_waits_under_a_lease_that_is_renewed_also_in_auto(self):
        self.answer(self.auto(0.0))
        step = self.command(set_setpoint=pb.SetSetpoint(setpoint_m=0.1), life_us=3 * S, execute_at_robot_us=self.now_us + 2 * S)
        self.assertEqual(self.answer(step), "accepted")
        for _ in range(6):
            self.run_for(400_000)
            self.answer(self.renew())
        self.assertAlmostEqual(self.robot.setpoint_m, 0.1)
        late = self.command(set_setpoint=pb.SetSetpoint(setpoint_m=0.2), life_us=3 * S, execute_at_robot_us=self.now_us + 2 * S)
        self.assertEqual(self.answer(late), "accepted")
        self.run_for(3 * S)
        self.assertEqual(self.later_answers(), [(late.command_id, "expired")])
        self.assertAlmostEqual(self.robot.setpoint_m, 0.1)

    def test_a_renewal_cannot_wait(self):
        self.answer(self.duty(0.3))
        ahead = self.command(renew_lease=pb.RenewLease(), execute_at_robot_us=self.now_us + 490_000)
        self.assertEqual(self.answer(ahead), "malformed")
        self.run_for(600_000)
        self.assertEqual(self.robot.cart.duty, 0.0)

    def test_a_lapsed_one_is_not_revived_between_two_ticks(self):
        old = self.store(after_us=600_000)
        self.now_us += 500_000
        self.store(after_us=600_000)
        self.assertEqual(self.later_answers(), [(old.command_id, "expired")])
        self.now_us += 500_000
        self.assertEqual(self.answer(self.renew()), "nothing_to_renew")

    def test_its_renewal_does_not_revive_a_duty_that_has_lapsed_between_two_ticks(self):
        self.answer(self.duty(0.3))
        self.now_us += 300_000
        self.store(after_us=600_000)
        self.now_us += 250_000
        self.assertEqual(self.answer(self.renew()), "accepted")
        self.run_for(10_000)
        self.assertEqual(self.robot.cart.duty, 0.0)

    def test_what_drops_it_and_how(self):
        drop, manual = self.command(drop_timed=pb.DropTimed()), pb.SetMode(mode=pb.MODE_MANUAL)
        for word, end in (("expired", drop), ("expired", self.duty(0.0)), ("wrong_mode", self.command(set_mode=manual)),
                          ("wrong_mode", self.auto(0.0)), ("latched", self.stop())):
            self.answer(self.command(set_mode=manual))
            waits = self.store()
            self.assertEqual(self.answer(end), "accepted")
            self.assertEqual(self.later_answers(), [(waits.command_id, word)])
        self.assertEqual(self.answer(self.duty(0.1, execute_at_robot_us=self.now_us + 1)), "latched")
        self.run_for(S)
        self.assertEqual(set(self.duties(100)), {0.0})

    def test_the_lapse_of_a_duty_and_a_lost_link_drop_it(self):
        self.answer(self.duty(0.3))
        self.run_for(400_000)
        waits = self.store(after_us=300_000)
        self.run_for(200_000)
        self.assertEqual(self.later_answers(), [(waits.command_id, "expired")])
        self.run_for(S // 2)
        waits = self.store(after_us=450_000)
        self.robot.link_timeout_us = 100_000
        self.run_for(200_000, is_heard=False)
        self.assertEqual(self.later_answers(), [(waits.command_id, "expired")])

    def test_another_duty_and_a_timed_duty_of_0_drop_nothing(self):
        self.store(after_us=50_000, duty=0.3)
        self.answer(self.duty(0.2))
        self.run_for(60_000)
        self.assertEqual((self.later_answers(), self.duties(1)), ([], [self.robot.duty]))
        self.assertAlmostEqual(self.robot.duty, 0.3)
        self.store(after_us=100_000, duty=0.0)
        self.store(after_us=200_000)
        self.run_for(300_000)
        self.assertEqual((self.later_answers(), self.robot.duty), ([], 0.5))

    def test_it_is_judged_again_at_its_time(self):
        refused = self.store(duty=2.0)
        self.run_for(300_000)
        self.assertEqual(self.later_answers(), [(refused.command_id, "out_of_range")])
        late = self.store(after_us=100_000, life_us=100_000)
        due_us, self.now_us = self.now_us + 100_000, self.now_us + 300_000  # the program stood still
        self.robot.step(due_us)
        self.assertEqual(self.later_answers(), [(late.command_id, "expired")])
        self.assertEqual(self.robot.duty, 0.0)


class DisturbanceTest(Orders):
    def test_the_controller_sees_it_until_auto_ends(self):
        self.assertEqual(self.answer(self.disturbance(0.05)), "wrong_mode")
        self.answer(self.auto(0.1))
        self.assertEqual([self.answer(self.disturbance(NAN)), self.answer(self.disturbance(2))], ["not_finite", "out_of_range"])
        self.assertEqual(self.answer(self.disturbance(0.05)), "accepted")
        self.run_for(5 * S)
        _, shared, values = self.robot.samples[self.robot.samples.next_seq - 1]
        self.assertAlmostEqual(self.robot.cart.position_m, 0.05, places=3)
        self.assertAlmostEqual(values[0], 0.1, places=3)
        self.assertAlmostEqual(shared["disturbance_m"], 0.05, places=6)
        self.answer(self.command(set_mode=pb.SetMode(mode=pb.MODE_MANUAL)))
        self.assertEqual(self.robot.disturbance_m, 0.0)


if __name__ == "__main__":
    unittest.main()
