"""What stops the motor of examples/robot.py beside commands: readings, the track's ends, late ticks, and what fails."""
import asyncio
import ssl
import time
import unittest
from unittest import mock

from example_robot import S, Bench  # first: it may go on in another Python

from robot import Robot
from station_link import BadFrame, LinkEnded, StationLink, from_network, pb


class MeasuredTest(Bench):
    """What the sensors read is what the test says."""

    def setUp(self):
        super().setUp()
        self.robot.cart.move = lambda dt_s: None

    def place(self, position_m, velocity_m_s=0.0):
        self.robot.cart.position_m, self.robot.cart.velocity_m_s = position_m, velocity_m_s
        self.run_for(10_000)

    def clear_it(self):
        return self.answer(self.clear(self.robot.emergency_id))

    def test_what_is_not_a_number_stops_it(self):
        nan = float("nan")
        for place in ((nan, 0.0), (0.0, nan), (float("inf"), 0.0)):
            for order in (self.auto, self.duty):
                with self.subTest(place=place, order=order.__name__):
                    self.assertEqual(self.answer(order(0.5)), "accepted")
                    self.place(*place)
                    self.assertEqual((self.robot.mode, self.robot.cart.duty), (pb.MODE_EMERGENCY, 0.0))
                    self.run_for(S)
                    self.assertEqual(self.clear_it(), "cause_stands")
                    self.place(0.0)
                    self.assertEqual(self.clear_it(), "accepted")
        self.assertEqual(self.kinds().count("emergency"), 6, "once each")
        self.answer(self.auto(0.5))
        self.robot.controller = lambda: nan
        self.run_for(10_000)
        self.assertEqual((self.robot.emergency_cause, self.robot.cart.duty), (pb.EMERGENCY_CAUSE_INTERNAL_ERROR, 0.0))
        self.assertEqual(self.robot.events[self.robot.events.next_seq - 1].cause, pb.EVENT_CAUSE_INTERNAL)

    def test_outside_the_track_the_motor_only_leads_back_in_each_tick(self):
        self.place(1.205)
        self.clear_it()
        self.assertEqual(self.answer(self.auto(1.19)), "accepted")
        self.place(1.204, velocity_m_s=-0.3)  # the derivative alone would lead further out
        self.assertEqual(self.robot.cart.duty, 0.0)
        self.place(1.204, velocity_m_s=0.0)
        self.assertAlmostEqual(self.robot.cart.duty, -0.14, places=5)
        self.place(1.1995, velocity_m_s=-0.3)
        self.assertEqual((self.robot.is_outside, self.robot.cart.duty), (True, 0.0), "1 mm inside it is back")
        self.place(1.1985, velocity_m_s=-0.3)
        self.assertAlmostEqual(self.robot.cart.duty, 0.215, places=5)
        self.assertEqual(self.kinds().count("limit_hit"), 1)

    def test_a_new_zero_does_not_move_the_ends_of_the_track(self):
        self.place(-1.25)
        self.clear_it()
        self.assertEqual(self.answer(self.command(zero_position=pb.ZeroPosition())), "accepted")
        self.assertEqual([self.answer(self.duty(-1.0)), self.answer(self.auto(-0.1))], ["outward", "out_of_range"])
        manual = self.command(set_mode=pb.SetMode(mode=pb.MODE_MANUAL))
        self.assertEqual([self.answer(manual), self.answer(self.auto(0.1))], ["accepted", "accepted"])
        self.place(0.0)
        self.place(1.25)
        self.assertEqual(self.robot.emergency_cause, pb.EMERGENCY_CAUSE_POSITION_LIMIT)
        hit = [event.value for event in self.robot.events.items if event.kind == pb.EVENT_KIND_LIMIT_HIT]
        self.assertAlmostEqual(hit[-1], 2.45, places=5)

    def test_the_end_of_the_track_is_a_setpoint(self):
        self.assertEqual([self.answer(self.auto(1.2)), self.answer(self.auto(1.2001))], ["accepted", "out_of_range"])

    def test_the_zero_is_refused_until_the_motor_itself_is_off(self):
        self.answer(self.duty(0.5))
        self.run_for(10_000)
        self.answer(self.duty(0.0))
        zero = pb.ZeroPosition()
        self.assertEqual(self.answer(self.command(zero_position=zero)), "motor_on")
        self.run_for(10_000)
        self.assertEqual(self.answer(self.command(zero_position=zero)), "accepted")

    def test_a_tick_that_comes_late_judges_by_the_time_that_it_is(self):
        for order in (self.duty, self.auto):
            self.answer(order(0.5))
            self.run_for(100_000)
            self.assertNotEqual(self.robot.cart.duty, 0.0)
            due_us, self.now_us = self.now_us + 10_000, self.now_us + 2 * S
            self.robot.step(due_us)
            self.assertEqual((self.robot.mode, self.robot.cart.duty), (pb.MODE_MANUAL, 0.0))
            self.run_for(100_000)
        self.assertEqual(self.kinds()[-4:], ["setpoint_changed", "link_lost", "mode_changed", "link_restored"])

    def test_a_motor_that_fails_at_a_stop_finds_it_latched_and_leaves_no_acknowledgement(self):
        class Broken(type(self.robot.cart)):
            duty = property(lambda _: 0.5, lambda *_: (_ for _ in ()).throw(OSError("the driver is gone")))
        self.answer(self.auto(0.5))
        self.robot.cart.__class__ = Broken
        with self.assertRaisesRegex(OSError, "gone"):
            self.robot.on_command(self.stop(), self.now_us)
        self.assertEqual((self.robot.mode, self.robot.setpoint_m, len(self.robot.stop_acks)), (pb.MODE_EMERGENCY, None, 0))
        self.assertNotEqual(self.robot.emergency_id, 0)

    def test_its_clock_counts_while_the_computer_sleeps(self):
        with mock.patch("time.clock_gettime_ns", lambda clock: 3_000_000_000 if clock == time.CLOCK_BOOTTIME else 0):
            robot = Robot("cart-1", "")
            robot.started_ns -= 2_000_000_000
            self.assertEqual(robot.now_us(), 2 * S)


class ErrorTest(Bench):
    """Errors of the network end the link; errors of the robot end the program."""

    def served(self, sent, *beside, hangs=False):
        """What comes of a robot whose station sends these bytes, and closes or hangs."""
        async def station(reader, writer):
            writer.write(sent)
            if not hangs:
                writer.write_eof()
            try:
                await reader.read()
            finally:
                writer.close()

        async def serve():
            server = await asyncio.start_server(station, "127.0.0.1", 0)
            self.link = StationLink(self.robot, *server.sockets[0].getsockname())
            self.link.say = self.said.append
            async with server, asyncio.timeout(60), asyncio.TaskGroup() as tasks:
                others = [tasks.create_task(other()) for other in (*beside, self.link.stay_connected)]
                while len(self.said) < 2:
                    await asyncio.sleep(0.01)
                for other in others:
                    other.cancel()
        self.said = []
        asyncio.run(serve())

    def frame(self, **body):
        payload = pb.StationFrame(**body).SerializeToString()
        return bytes([len(payload)]) + payload

    def test_an_error_of_the_motor_ends_the_program_and_not_the_link(self):
        for error in (ConnectionError("the driver is gone"), ValueError("no such duty"), EOFError()):
            self.robot.stop = mock.Mock(side_effect=error)
            with self.assertRaises(ExceptionGroup) as ended:
                self.served(self.frame(command=self.stop()))
            self.assertEqual((ended.exception.exceptions, self.said), ((error,), []))

    def test_a_bad_frame_ends_the_link_and_is_counted(self):
        self.served(b"\x01\xff")
        self.assertIn("cannot be decoded", self.said[0])
        self.assertEqual(self.robot.bad_frames, 2)
        self.served(self.frame(welcome=pb.Welcome(refusal=2, detail="no such robot")))
        self.assertIn("refused: no such robot", self.said[0])
        self.served(b"")
        self.assertIn("the station closed the connection", self.said[0])
        self.assertEqual(self.robot.bad_frames, 2)

    def test_a_station_that_falls_silent_is_left(self):
        async def tick():
            while True:
                self.now_us += 10_000
                self.robot.step(self.now_us)
                if self.link.connection:
                    self.link.connection.on_tick()
                await asyncio.sleep(0)
        self.served(self.frame(welcome=pb.Welcome(protocol_version=1, link_timeout_ms=500)), tick, hangs=True)
        self.assertIn("connected to", self.said[0])
        self.assertIn("no frame within the link time-out", self.said[1])

    def test_frames_that_come_together_do_not_delay_the_tick(self):
        order = []

        async def tick():
            while True:
                order.append("tick")
                await asyncio.sleep(0)
        self.robot.on_command = lambda *_: order.append("frame")
        self.served(self.frame(command=self.stop()) * 50, tick)
        self.assertGreaterEqual(order.count("frame"), 100)
        self.assertNotIn("frame frame", " ".join(order))

    def test_errors_of_the_network_end_the_link(self):
        for error, why in ((ssl.SSLCertVerificationError("bad"), "bad"), (EOFError(), "the station closed the connection")):
            async def fail():
                raise error
            with self.assertRaisesRegex(LinkEnded, why) as ended:
                asyncio.run(from_network(fail(), None))
            self.assertNotIsInstance(ended.exception, BadFrame)


if __name__ == "__main__":
    unittest.main()
