"""The rules that examples/robot.py keeps, in virtual time and without sockets: what it refuses, when it stops by itself, and
what it sends first."""
import unittest

from example_robot import S, Bench  # first: it may go on in another Python

from station_link import BadFrame, Connection, LinkEnded, pb


class JudgementTest(Bench):
    def test_what_is_wrong_with_a_command_is_found_in_the_documented_order(self):
        self.run_for(S)
        for answer, command in (
                ("malformed", self.command()),
                ("malformed", self.duty(0.1, command_id=0, boot_id=7)),
                ("other_boot", self.duty(0.1, boot_id=7, life_us=-1)),
                ("expired", self.duty(0.1, life_us=-1)),
                ("accepted", self.duty(0.1, life_us=0)),
                ("accepted", self.duty(0.1, life_us=10 * S)),
                ("life_too_long", self.duty(0.1, life_us=10 * S + 1)),
                ("out_of_range", self.duty(0.1, execute_at_robot_us=self.now_us + S + 1)),
                ("unsupported", self.command(set_controller=pb.Controller(controller_id=1))),
                ("unsupported", self.command(restore_controller=pb.RestoreController())),
                ("unsupported", self.command(set_parameter=pb.SetParameter(name="kp", value=1))),
                ("unsupported", self.command(get_parameters=pb.GetParameters())),
                ("accepted", self.command(drop_timed=pb.DropTimed())),
                ("accepted", self.command(ping=pb.Ping()))):
            with self.subTest(answer=answer, command=command):
                self.assertEqual(self.answer(command), answer)

    def test_arguments_and_modes(self):
        nan = float("nan")
        renew = pb.RenewLease()
        for answer, command in (
                ("not_finite", self.duty(nan)), ("out_of_range", self.duty(1.1)),
                ("out_of_range", self.command(set_duty=pb.SetDuty(duty=0.1, lease_ms=501))),
                ("nothing_to_renew", self.command(renew_lease=renew)),
                ("wrong_mode", self.command(set_setpoint=pb.SetSetpoint(setpoint_m=0.1))),
                ("other_emergency", self.clear(0)),
                ("malformed", self.command(set_mode=pb.SetMode(mode=pb.MODE_AUTO))),
                ("malformed", self.command(set_mode=pb.SetMode(mode=pb.MODE_MANUAL, setpoint_m=0))),
                ("malformed", self.command(set_mode=pb.SetMode(mode=pb.MODE_EMERGENCY))),
                ("not_finite", self.auto(nan)), ("out_of_range", self.auto(1.3)),
                ("accepted", self.duty(0.1)), ("motor_on", self.command(zero_position=pb.ZeroPosition())),
                ("accepted", self.duty(0)), ("accepted", self.command(zero_position=pb.ZeroPosition())),
                ("accepted", self.auto(0.1)), ("wrong_mode", self.duty(0.1)),
                ("wrong_mode", self.command(zero_position=pb.ZeroPosition())),
                ("nothing_to_renew", self.command(renew_lease=renew)),
                ("out_of_range", self.command(set_setpoint=pb.SetSetpoint(setpoint_m=-1.3))),
                ("accepted", self.command(set_setpoint=pb.SetSetpoint(setpoint_m=0.2))),
                ("accepted", self.stop()), ("latched", self.duty(nan)), ("latched", self.auto(0.1)),
                ("latched", self.command(set_setpoint=pb.SetSetpoint(setpoint_m=0.2))),
                ("latched", self.command(renew_lease=renew)), ("other_emergency", self.clear(1))):
            with self.subTest(answer=answer, command=command):
                self.assertEqual(self.answer(command), answer)

    def test_no_id_runs_twice(self):
        first = self.duty(0.3)
        self.assertEqual(self.answer(first), "accepted")
        refused = self.duty(2)
        self.assertEqual(self.answer(refused), "out_of_range")
        for _ in range(62):
            self.answer(self.command(ping=pb.Ping()))
        self.assertEqual([self.answer(first), self.answer(refused)], ["duplicate", "duplicate"])
        self.assertEqual(self.answer(self.command(ping=pb.Ping())), "accepted")
        self.assertEqual(self.answer(first), "accepted", "forgotten after 64 others, as documented")

    def test_a_stop_without_an_id_and_a_repeated_one_make_it_forget_no_id(self):
        first, stop = self.duty(0.3), self.stop()
        self.answer(first)
        for _ in range(31):
            self.answer(pb.Command(emergency_stop=pb.EmergencyStop()))
            self.answer(self.clear(self.robot.emergency_id))
            self.assertEqual(self.answer(stop), "accepted")
            self.answer(self.clear(self.robot.emergency_id))
        self.assertEqual(self.answer(first), "duplicate", "63 others came since")

    def test_a_stop_needs_no_boot_and_no_time_and_is_undone_by_its_own_id_alone(self):
        self.answer(self.duty(0.5))
        self.run_for(S // 10)
        for _ in range(2):
            self.assertEqual(self.answer(pb.Command(emergency_stop=pb.EmergencyStop())), "accepted", "also without an id")
        stop = pb.Command(command_id=77, emergency_stop=pb.EmergencyStop())
        self.assertEqual(self.answer(stop), "accepted")
        self.assertEqual(self.robot.cart.duty, 0, "before the next tick")
        first = self.ack.emergency_id
        self.assertEqual((self.answer(stop), self.ack.emergency_id), ("duplicate", first))
        self.assertEqual(self.answer(self.stop()), "accepted")
        second = self.ack.emergency_id
        self.assertEqual(self.answer(self.clear(first)), "other_emergency")
        self.assertEqual(self.answer(self.clear(second)), "accepted")
        self.run_for(S)
        self.assertEqual({values[3] for _, _, values in list(self.robot.samples.items)[-100:]}, {0.0})
        self.assertEqual(self.answer(stop), "accepted", "the same stop again latches anew after a clear")

    def test_a_lease_lapses_and_a_renewal_comes_too_late_also_between_two_ticks(self):
        self.answer(self.duty(0.5))
        self.now_us += 400_000
        self.assertEqual(self.answer(self.command(renew_lease=pb.RenewLease(lease_ms=100))), "accepted")
        self.now_us += 100_000
        self.assertEqual(self.answer(self.command(renew_lease=pb.RenewLease())), "nothing_to_renew")
        self.run_for(20_000)
        self.assertEqual(self.robot.cart.duty, 0)
        self.assertIn("lease_lapsed", self.kinds())
        self.assertTrue(self.robot.samples[self.robot.samples.next_seq - 1][1]["flags"] & pb.TELEMETRY_FLAG_LEASE_LAPSED)

    def test_a_lost_link_ends_auto_and_its_return_moves_nothing(self):
        self.answer(self.auto(1.0))
        self.run_for(S // 2)
        self.assertGreater(self.robot.cart.velocity_m_s, 0.1)
        self.run_for(S, is_heard=False)
        self.assertEqual((self.robot.mode, self.robot.setpoint_m, self.robot.cart.duty), (pb.MODE_MANUAL, None, 0.0))
        self.run_for(S)
        self.assertEqual(self.robot.cart.duty, 0.0)
        self.assertEqual(self.kinds()[-3:], ["link_lost", "mode_changed", "link_restored"])

    def test_before_the_first_welcome_there_is_no_link_to_lose(self):
        self.run_for(10 * S, is_heard=False)
        self.assertEqual((self.kinds(), self.robot.samples[999][1]["flags"]), (["boot"], 0))

    def test_nothing_that_is_left_over_moves_the_motor_in_an_emergency(self):
        self.answer(self.stop())
        self.robot.duty, self.robot.lease_until_us = 0.5, 10 * S  # as by a fault elsewhere in the program
        self.run_for(S)
        self.assertEqual((self.robot.cart.duty, self.robot.cart.position_m), (0, 0))

    def test_a_command_after_a_standstill_of_the_robot_finds_it_at_rest(self):
        self.answer(self.auto(1.0))
        self.run_for(S // 2)
        self.now_us += 2 * S  # its program stood still, and the frames of that time are read before the next tick
        self.robot.heard(self.now_us)
        self.assertEqual(self.answer(self.command(set_setpoint=pb.SetSetpoint(setpoint_m=0.9))), "wrong_mode")
        self.assertEqual(self.kinds()[-3:], ["link_lost", "mode_changed", "link_restored"])

    def test_auto_ends_after_its_limit(self):
        self.answer(self.auto(0.1))
        self.run_for(600 * S - 10_000)
        self.assertEqual(self.robot.mode, pb.MODE_AUTO)
        self.run_for(10_000)
        self.assertEqual((self.robot.mode, self.kinds()[-2:]), (pb.MODE_MANUAL, ["auto_limit", "mode_changed"]))

    def test_the_end_of_the_track_stops_it_and_only_the_way_back_is_open(self):
        while self.robot.mode == pb.MODE_MANUAL:
            self.answer(self.duty(1.0))
            self.run_for(S // 10)
        self.assertAlmostEqual(self.robot.cart.position_m, 1.2, delta=0.1)
        self.assertEqual(self.robot.emergency_cause, pb.EMERGENCY_CAUSE_POSITION_LIMIT)
        self.run_for(S)
        self.assertEqual(self.answer(self.clear(self.robot.emergency_id)), "accepted")
        self.assertEqual([self.answer(self.duty(0.1)), self.answer(self.duty(-1.0))], ["outward", "accepted"])
        self.run_for(S // 2)
        self.assertLess(self.robot.cart.position_m, 1.2)
        self.assertEqual(self.robot.mode, pb.MODE_MANUAL)


class Wire:
    """A writer that keeps what is sent; `is_jammed`: the network takes nothing for now."""

    def __init__(self):
        self.transport, self.is_jammed, self.sent = self, False, []

    def get_write_buffer_size(self):
        return int(self.is_jammed)

    def write(self, frame):
        used = 1 if frame[0] < 0x80 else 2
        self.sent.append(pb.RobotFrame.FromString(frame[used:]))

    def bodies(self):
        bodies, self.sent = [frame.WhichOneof("body") for frame in self.sent], []
        return bodies


class OrderTest(Bench):
    def connect(self, **durable):
        self.wire = Wire()
        self.connection = Connection(self.robot, self.wire, self.wire)
        self.assertEqual(self.wire.bodies(), ["hello"])
        if durable.pop("welcome", True):
            self.receive(welcome=pb.Welcome(protocol_version=1, **durable))

    def receive(self, **body):
        self.connection.on_frame(pb.StationFrame(**body), self.now_us)
        self.connection.flush()

    def sent_again(self, **heartbeat):
        """(first number, count) of each batch of backfill that follows a StationHeartbeat."""
        self.wire.bodies()
        self.receive(heartbeat=pb.StationHeartbeat(**heartbeat))
        self.run_ticks(20)
        batches = [frame.telemetry for frame in self.wire.sent if frame.telemetry.flags & pb.TELEMETRY_FLAG_BACKFILL]
        return [(batch.first_seq, len(batch.duty)) for batch in batches]

    def run_ticks(self, count):
        for _ in range(count):
            self.run_for(10_000)
            self.connection.on_tick()

    def test_before_the_welcome_nothing_but_a_stop_is_obeyed(self):
        self.connect(welcome=False)
        self.run_for(S)
        for body in ({"command": self.duty(1.0)}, {"command": self.auto(1.0)}, {"stop_probe": pb.StopProbe(station_time_us=1)},
                     {"heartbeat": pb.StationHeartbeat(durable_next_seq=50, resend_next_seq=9)}, {}):
            with self.subTest(body=body), self.assertRaises(BadFrame):
                self.receive(**body)
        self.run_ticks(10)
        self.assertEqual((self.wire.bodies(), self.robot.cart.duty, self.robot.samples.oldest_seq), ([], 0.0, 0))
        self.receive(command=self.stop())
        self.assertEqual(self.wire.bodies(), ["command_ack"])

    def test_it_is_welcomed_once_and_by_a_station_of_its_version(self):
        self.connect(welcome=False)
        with self.assertRaisesRegex(LinkEnded, "version 2"):
            self.receive(welcome=pb.Welcome(protocol_version=2))
        self.receive(welcome=pb.Welcome(protocol_version=1))
        with self.assertRaisesRegex(BadFrame, "welcome after the Welcome"):
            self.receive(welcome=pb.Welcome(protocol_version=1))

    def test_a_sample_that_shows_a_change_is_sent_at_once(self):
        self.connect(samples_per_frame=25)
        self.run_ticks(30)
        self.wire.sent.clear()
        self.answer(self.auto(0.5))
        self.run_ticks(1)
        batches = [frame.telemetry for frame in self.wire.sent if frame.WhichOneof("body") == "telemetry"]
        self.assertEqual([(batch.mode, len(batch.duty)) for batch in batches], [(pb.MODE_MANUAL, 5), (pb.MODE_AUTO, 1)])
        self.run_ticks(10)
        self.assertEqual(sum(frame.WhichOneof("body") == "telemetry" for frame in self.wire.sent), 2, "and then as it fills")

    def test_acknowledgements_wait_for_a_connection_and_none_pushes_out_that_of_a_stop(self):
        self.answer_later(self.stop())
        pings = [self.command(ping=pb.Ping()) for _ in range(20)]
        self.answer_later(*pings)
        self.connect()
        waited = [frame.command_ack.command_id for frame in self.wire.sent if frame.WhichOneof("body") == "command_ack"]
        self.assertEqual(waited, [1, *(ping.command_id for ping in pings[-8:])])

    def answer_later(self, *commands):
        for command in commands:
            self.robot.on_command(command, self.now_us)

    def test_events_come_again_until_they_are_durable_and_the_clock_is_answered(self):
        self.connect()
        self.answer(self.auto(0.1))
        self.run_ticks(2)
        self.wire.bodies()
        self.receive(heartbeat=pb.StationHeartbeat(durable_next_event_seq=1, resend_events=True, station_time_us=99))
        events = [frame.event for frame in self.wire.sent if frame.WhichOneof("body") == "event"]
        self.assertEqual([(event.event_seq, event.oldest_event_seq) for event in events], [(1, 1), (2, 1)])
        clock = next(frame.heartbeat for frame in self.wire.sent if frame.WhichOneof("body") == "heartbeat")
        self.assertEqual((clock.echo_station_time_us, clock.echo_received_at_robot_us), (99, self.now_us))

    def test_what_waited_leaves_in_the_documented_order(self):
        self.run_for(S)
        self.connect()
        self.run_ticks(4)
        self.wire.bodies()
        self.wire.is_jammed = True
        self.run_ticks(30)
        for body in ({"command": self.command(ping=pb.Ping())}, {"stop_probe": pb.StopProbe(station_time_us=1)},
                     {"heartbeat": pb.StationHeartbeat(station_time_us=1)}, {"command": self.stop()}):
            self.receive(**body)
        self.assertEqual(self.wire.bodies(), [])
        self.wire.is_jammed = False
        self.connection.flush()
        is_stop = [frame.command_ack.emergency_id != 0 and frame.command_ack.effect_at_robot_us != 0 for frame in self.wire.sent]
        frames = list(self.wire.sent)
        bodies = self.wire.bodies()
        self.assertEqual(bodies[:5], ["command_ack", "stop_probe_answer", "command_ack", "heartbeat", "event"])
        self.assertTrue(is_stop[0], "the acknowledgement of the stop first")
        is_backfill = [bool(frame.telemetry.flags & pb.TELEMETRY_FLAG_BACKFILL) for frame in frames
                       if frame.WhichOneof("body") == "telemetry"]
        self.assertGreater(len(is_backfill), 6)
        self.assertEqual(is_backfill, sorted(is_backfill), "live samples, then backfill")
        self.assertIn(True, is_backfill)

    def test_all_that_is_not_durable_comes_again_and_no_batch_spans_a_change(self):
        self.run_for(1_030_000)
        self.answer(self.duty(0.2))
        self.run_for(970_000)
        self.connect(durable_next_seq=50, samples_per_frame=10)
        self.run_ticks(150)
        batches = [frame.telemetry for frame in self.wire.sent if frame.WhichOneof("body") == "telemetry"]
        seqs = [batch.first_seq + i for batch in batches for i in range(len(batch.duty))]
        self.assertEqual(len(seqs), len(set(seqs)), "none twice")
        self.assertEqual(sorted(seqs), list(range(50, 350)))
        self.assertTrue(all(len(batch.duty) <= 25 and batch.oldest_seq == 50 for batch in batches))
        lapsed_seq = next(event.sample_seq for event in self.robot.events.items if event.kind == pb.EVENT_KIND_LEASE_LAPSED)
        self.assertIn(lapsed_seq, [batch.first_seq for batch in batches], "a flag changes there")
        backfill = [batch for batch in batches if batch.flags & pb.TELEMETRY_FLAG_BACKFILL]
        self.assertEqual(sum(len(batch.duty) for batch in backfill), 150)
        self.assertEqual(self.sent_again(resend_first_seq=60, resend_next_seq=70), [(60, 10)])
        again = self.sent_again(durable_next_seq=340, resend_first_seq=100, resend_next_seq=345)
        self.assertEqual(again, [(340, 5)], "as far as it is held")
        self.receive(heartbeat=pb.StationHeartbeat(durable_next_seq=10**6))
        self.assertEqual(self.robot.samples.oldest_seq, 340, "an acknowledgement of what was never made is ignored")

    def test_what_is_asked_for_during_backfill_is_sent_as_well(self):
        self.run_for(3 * S)
        self.connect()
        self.run_ticks(60)
        again = self.sent_again(resend_first_seq=10, resend_next_seq=20)
        self.assertEqual(again[0], (10, 25))
        self.run_ticks(200)
        seqs = {frame.telemetry.first_seq + i for frame in self.wire.sent for i in range(len(frame.telemetry.duty))}
        self.assertTrue(seqs.issuperset(range(100, 300)), "and the backfill goes on to its end")

    def test_backfill_takes_twice_the_rate_of_live_samples(self):
        self.run_for(10 * S)
        self.connect()
        self.run_ticks(100)
        batches = [frame.telemetry for frame in self.wire.sent if frame.WhichOneof("body") == "telemetry"]
        backfill = sum(len(batch.duty) for batch in batches if batch.flags & pb.TELEMETRY_FLAG_BACKFILL)
        self.assertTrue(150 <= backfill <= 200, backfill)

    def test_an_idle_connection_has_signs_of_life_and_a_silent_one_is_dropped(self):
        self.connect(heartbeat_interval_ms=20, samples_per_frame=25)
        self.run_ticks(100)
        self.assertIn("heartbeat", self.wire.bodies())
        dropped = []
        self.wire.set_exception = dropped.append
        self.run_for(2 * S, is_heard=False)
        self.connection.on_tick()
        self.assertEqual([str(error) for error in dropped], ["no frame within the link time-out"])


if __name__ == "__main__":
    unittest.main()
