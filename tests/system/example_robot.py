"""For the tests of examples/robot.py: goes on in a Python that has Google's protobuf, and has the robot in virtual time."""
import os
import pathlib
import sys
import unittest

DEBIANS_PYTHON = "/usr/bin/python3"
try:
    import google.protobuf  # noqa: F401
except ModuleNotFoundError:  # another Python comes first here: python3-protobuf belongs to Debian's
    if os.path.realpath(sys.executable) == os.path.realpath(DEBIANS_PYTHON):
        sys.exit("no google.protobuf here; deploy/packages installs python3-protobuf")
    os.execv(DEBIANS_PYTHON, [DEBIANS_PYTHON, "-B", *sys.argv])

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

from robot import Robot  # noqa: E402
from station_link import pb  # noqa: E402

S = 1_000_000  # µs


class Bench(unittest.TestCase):
    """The robot in virtual time, without sockets."""

    def setUp(self):
        self.now_us = 5_000  # a little after its boot
        self.robot = Robot("cart-1", "")
        self.robot.now_us = lambda: self.now_us
        self.ids = iter(range(1, 1000))

    def run_for(self, duration_us, is_heard=True):
        for _ in range(duration_us // 10_000):
            self.now_us += 10_000
            if is_heard:
                self.robot.heard(self.now_us)
            self.robot.step(self.now_us)

    def command(self, life_us=S, boot_id=None, **fields):
        """Any command, by default with an id of its own and valid for a second."""
        fields.setdefault("command_id", next(self.ids))
        return pb.Command(boot_id=self.robot.boot_id if boot_id is None else boot_id,
                          valid_until_robot_us=self.now_us + life_us, **fields)

    def answer(self, command):
        """What the robot answers: the word of its result, or of its reason where it rejects."""
        self.robot.on_command(command, self.now_us)
        self.ack = (self.robot.stop_acks or self.robot.acks).pop()
        self.assertEqual(self.ack.command_id, command.command_id)
        self.assertEqual(self.ack.effect_at_robot_us != 0, self.ack.result == pb.COMMAND_RESULT_ACCEPTED)
        return self.word_of(self.ack)

    def word_of(self, ack):
        result = pb.CommandResult.Name(ack.result).removeprefix("COMMAND_RESULT_").lower()
        reason = pb.RejectReason.Name(ack.reason).removeprefix("REJECT_REASON_").lower()
        return reason if result == "rejected" else result

    def later_answers(self):
        """(id, word) of the acknowledgements that came without being asked for."""
        later = [(ack.command_id, self.word_of(ack)) for ack in self.robot.acks]
        self.robot.acks.clear()
        return later

    def duty(self, duty, **fields):
        return self.command(set_duty=pb.SetDuty(duty=duty), **fields)

    def auto(self, setpoint_m, **fields):
        return self.command(set_mode=pb.SetMode(mode=pb.MODE_AUTO, setpoint_m=setpoint_m), **fields)

    def stop(self, **fields):
        return self.command(emergency_stop=pb.EmergencyStop(), **fields)

    def clear(self, emergency_id):
        return self.command(clear_emergency=pb.ClearEmergency(emergency_id=emergency_id))

    def kinds(self):
        return [pb.EventKind.Name(event.kind).removeprefix("EVENT_KIND_").lower() for event in self.robot.events.items]
