"""A record becomes a trace up to what the model does not have, and says why it ends there; docs/protocol_model.md lists why."""
import json
import pathlib
import unittest

import recorded

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs" / "protocol_model.md"


class Robot(recorded.Record):
    """A record as a database has it: what happened second by second, in the station's clock and in the robot's."""

    def __init__(self):
        self.commands, self.events, self.moving = [], [], []
        self.boots, self.restarts, self.kills, self.restored, self.reported = {"7": 1}, [], [], [], {}
        self.has_lost_events = self.is_a_replay = False
        self.now_us = 0
        self.station_event("connected")

    def tick(self):
        self.now_us += 1_000_000
        return self.now_us

    def station_event(self, kind, detail=""):
        self.events.append({"event_seq": None, "kind": kind, "detail": detail, "received_at_us": self.tick(), "command_id": 0})

    def event(self, kind, command_id="", mode="manual", cause="none", emergency_id=0):
        self.events.append({"event_seq": len(self.events), "kind": kind, "command_id": command_id, "mode": mode, "cause": cause,
                            "boot_key": 1, "robot_time_us": self.tick(), "emergency_id": emergency_id})

    def command(self, kind, actor="anna", state="verified", ran=True, **arguments):
        number = str(100 + len(self.commands))
        self.commands.append({"command_id": number, "kind": kind, "actor": actor, "arguments": json.dumps(arguments), "boot_id": "7",
                              "state": state, "submitted_at_us": self.tick(), "effect_at_robot_us": self.now_us if ran else 0})
        return number

    def moves(self):
        self.moving.append({"boot_key": 1, "robot_time_us": self.tick(), "received_at_us": self.now_us})

    def restart(self, is_killed):
        self.restarts.append(self.tick())
        self.kills += self.restarts[-1:] if is_killed else []


class RecordedTest(unittest.TestCase):
    def setUp(self):
        self.robot = Robot()
        self.robot.command("set_duty", duty=0.2)

    def trace(self):
        return recorded.trace_of(self.robot)

    def ends_before(self, reason):
        """The trace has the duty of setUp() and nothing after it."""
        trace = self.trace()
        self.assertEqual((trace.robot, trace.station, trace.left_out), ([("duty", 0)], [("CONNECTED", 0), ("duty", 1)], reason))

    def has_no_trace(self, reason):
        self.assertEqual(vars(self.trace()), {"robot": [], "station": [], "left_out": reason})

    def test_each_reason_is_on_the_page(self):
        page = " ".join(PAGE.read_text().split())
        for reason in recorded.NOT_IN_THE_MODEL:
            self.assertIn(f"| {reason} |", page)

    def test_a_schedule(self):
        self.robot.command("set_duty_schedule", ticks=[0], duties=[0])
        self.robot.moves()
        self.robot.event("emergency", self.robot.command("emergency_stop"))
        self.ends_before(recorded.SCHEDULE)

    def test_a_timed_setpoint(self):
        self.robot.command("set_setpoint", setpoint_m=0.1, execute_at_robot_us=9)
        self.ends_before(recorded.TIMED)

    def test_a_timed_duty_is_in_the_model(self):
        self.robot.command("set_duty", duty=0.2, execute_at_robot_us=9)
        self.assertEqual((self.trace().station[-1], self.trace().left_out), (("timed", 1), ""))

    def test_an_experiment_that_the_station_ends(self):
        self.robot.command("set_duty", actor="station:experiments", duty=0)
        self.ends_before(recorded.EXPERIMENT)

    def test_a_duty_that_nobody_has_answered(self):
        self.robot.command("set_duty", state="unknown", ran=False, duty=0.2)
        self.robot.moves()
        self.assertEqual(self.trace().left_out, recorded.UNANSWERED)
        self.assertEqual(self.trace().station, [("CONNECTED", 0), ("duty", 1)])

    def test_what_had_no_effect_is_left_out(self):
        for state in ("rejected", "expired", "failed", "superseded"):
            self.robot.command("set_duty", state=state, ran=False, duty=0.2)
        self.assertEqual(vars(self.trace()), {"robot": [("duty", 0)], "station": [("CONNECTED", 0), ("duty", 1)], "left_out": ""})

    def test_a_command_that_has_run_by_its_event_alone(self):
        number = self.robot.command("set_mode", state="unknown", ran=False, mode="auto")
        self.robot.event("mode_changed", number, mode="auto", cause="command")
        self.robot.reported[number] = self.robot.now_us
        self.assertEqual(self.trace().robot, [("duty", 0), ("automatic", 0)])

    def test_another_action_after_link_loss(self):
        self.robot.command("set_parameter", name="link_loss_action", value=0)
        self.assertEqual(self.trace().left_out, "")
        self.robot.command("set_parameter", name="link_loss_action", value=1)
        self.ends_before(recorded.LINK_LOSS)

    def test_a_fifth_operator(self):
        for name in ("b", "c", "d"):
            self.robot.station_event("control_forced", f"by {name}, page 0123abcd from anna: why")
        self.assertEqual(self.trace().left_out, "")
        self.robot.station_event("control_forced", "by e from d: why")
        self.assertEqual(self.trace().left_out, recorded.OPERATORS)

    def test_a_restored_database(self):
        self.robot.restored.append(self.robot.tick())
        self.robot.station_event("connected")
        self.ends_before(recorded.RESTORED)

    def test_a_long_record(self):
        for _ in range(recorded.LONGEST):
            self.robot.command("set_duty", duty=0.2)
        self.assertEqual(self.trace().left_out, recorded.LENGTH)
        self.assertEqual(len(self.trace().station), recorded.LONGEST)

    def test_many_stops(self):
        for _ in range(recorded.MOST_STOPS):
            self.robot.event("emergency", self.robot.command("emergency_stop"))
        self.assertEqual(self.trace().left_out, recorded.LENGTH)
        self.assertEqual(len(self.trace().robot), recorded.MOST_STOPS)

    def test_a_command_that_was_lost_with_the_station(self):
        self.robot.event("mode_changed", "999", mode="auto", cause="command")
        self.has_no_trace(recorded.UNKNOWN)

    def test_motion_after_a_kill_without_a_command(self):
        self.robot.event("lease_lapsed")
        self.robot.restart(is_killed=False)
        self.robot.moves()
        self.assertEqual(self.trace().left_out, "", "a station that was not killed has stored everything")
        self.robot.kills = self.robot.restarts
        self.has_no_trace(recorded.UNKNOWN)

    def test_motion_after_a_stop_is_no_such_command(self):
        self.robot.event("emergency", self.robot.command("emergency_stop"))
        self.robot.restart(is_killed=True)
        self.robot.moves()
        self.assertEqual((self.trace().robot[-2:], self.trace().left_out), ([("stop", 0), ("MOVING", 0)], ""))

    def test_lost_events(self):
        self.robot.has_lost_events = True
        self.has_no_trace(recorded.LOST_EVENTS)

    def test_a_robot_without_events(self):
        self.robot.command("emergency_stop")
        self.has_no_trace(recorded.NO_EVENTS)

    def test_a_replay(self):
        self.robot.is_a_replay = True
        self.has_no_trace(recorded.REPLAYED)

    def test_motion_that_ends_by_itself(self):
        self.robot.event("position_uncertain")
        self.robot.event("mode_changed", mode="manual", cause="time")
        self.robot.event("mode_changed", mode="manual", cause="link_loss")
        self.assertEqual(self.trace().robot, [("duty", 0), ("AT_REST", 0), ("AT_REST", 0)])

    def test_a_latch_that_survives_a_reset_is_no_new_emergency(self):
        self.robot.event("emergency", cause="sensor", emergency_id=5)
        self.robot.event("boot")
        self.robot.event("boot")
        self.robot.event("emergency", cause="reset", emergency_id=5)
        self.robot.event("emergency", cause="reset", emergency_id=6)
        self.assertEqual(self.trace().robot, [("duty", 0), ("EMERGENCY", 0), ("BOOT", 0), ("EMERGENCY", 0)])


if __name__ == "__main__":
    unittest.main()
