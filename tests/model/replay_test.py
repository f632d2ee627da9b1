"""What a real station and robot have recorded is an execution of the model; a forged record is none."""
import contextlib
import copy
import dataclasses
import io
import json
import pathlib
import signal
import sys
import tempfile
import unittest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "system"))

import check  # noqa: E402
import recorded  # noqa: E402
import replay  # noqa: E402
from processes import cleared, commanded, lab, stopped, swimming, wait_until  # noqa: E402


class ReplayTest(unittest.TestCase):
    def robot(self):
        return self.station.robot("sim-1")

    def until(self, condition, what):
        return wait_until(lambda: condition(self.robot()) and self.robot(), 60, what)

    def other_operator(self):
        made = self.station.post("/api/v1/tokens", {"name": "other", "scopes": "admin"})
        other = copy.copy(self.station)
        other.token = made["secret"]
        return other

    def stop_and_clear(self):
        emergency_id = stopped(self.station)["emergency_id"]
        self.until(lambda robot: robot["mode"] == "emergency" and not robot["pending_stop"], "latched")
        cleared(self.station, emergency_id)

    def swim(self, setpoint_m):
        swimming(self.station, setpoint_m=setpoint_m)

    def record(self, place):
        """Stop, clear, takeover, lapse of a lease, lost link with a pending stop, kill of the station."""
        self.station = place.start_station()
        robot = place.start_robot(self.station)
        self.station.wait_for_robot("sim-1")
        other = self.other_operator()
        self.swim(0.3)
        self.stop_and_clear()
        other.post("/api/v1/robots/sim-1/control", {"action": "force", "reason": "a test"})
        commanded(other, "set_duty", duty=0.2)
        wait_until(lambda: any(event["kind"] == "lease_lapsed" for event in
                               self.station.get("/api/v1/robots/sim-1/events")["events"]), 60, "the lease has lapsed")
        robot.send_signal(signal.SIGSTOP)
        try:
            self.until(lambda robot: robot["link"] == "disconnected", "the link is lost")
            self.station.post("/api/v1/robots/sim-1/emergency-stop")
            ports = self.station.endpoints
            place.kill_station()
            self.station = place.start_station(http=ports["http"], robots=ports["robots"])
        finally:
            robot.send_signal(signal.SIGCONT)
        latched = self.until(lambda robot: robot["mode"] == "emergency" and not robot["pending_stop"], "stopped")
        cleared(self.station, latched["emergency_id"])
        self.swim(-0.1)
        self.stop_and_clear()
        self.assertEqual(place.stop_station(), 0)
        return recorded.traces(place.data / "station.sqlite")["sim-1"]

    def forged(self, **lists):
        return recorded.is_allowed(self.model, dataclasses.replace(self.trace, **lists))

    def test_a_real_record_is_allowed_and_forged_ones_are_not(self):
        with lab(config=None) as place, tempfile.TemporaryDirectory() as folder:
            self.trace = self.record(place)
            self.model = check.Model(folder)
            robot, station = self.trace.robot, self.trace.station
            print(f"robot: {robot}\nstation: {station}", flush=True)
            self.assertEqual(self.trace.left_out, "")
            self.assertTrue(self.forged(), "as it is")
            kinds = [action for action, _ in robot]
            for kind in ("stop", "clear", "MOVING", "duty", "automatic", "LAPSE"):
                self.assertIn(kind, kinds)

            first_clear = kinds.index("clear")
            moved_before_the_clear = robot[:first_clear] + [("MOVING", 0)] + robot[first_clear:]
            self.assertFalse(self.forged(robot=moved_before_the_clear), "motion after a stop")
            self.assertFalse(self.forged(robot=robot[:first_clear] + robot[first_clear + 1:]), "no clear at all")

            duty = kinds.index("duty")
            of_the_former = robot[:duty + 1] + [("automatic", robot[0][1])] + robot[duty + 1:]
            sent = station.index(("duty", 2))
            self.assertFalse(self.forged(robot=of_the_former), "a command that nobody sent")
            both = station[:sent + 1] + [("automatic", 1)] + station[sent + 1:]
            self.assertFalse(self.forged(robot=of_the_former, station=both), "a command of the former holder of control")
            lapse = kinds.index("LAPSE")
            self.assertFalse(self.forged(robot=robot[:lapse + 1] + [("MOVING", 0)] + robot[lapse + 1:]),
                             "motion after its lease has lapsed")
            at_rest = robot[:duty + 1] + [("rest", robot[duty][1]), ("MOVING", 0)]
            self.assertFalse(self.forged(robot=at_rest, station=station[:sent + 1] + [("rest", 2)]), "motion after a duty of 0")
            self.leaves_its_record(place)

    def leaves_its_record(self, place):
        """As at the end of each system test; then forged ones lie beside it."""
        with tempfile.TemporaryDirectory() as folder:
            replay.keep(place.data / "station.sqlite", folder, "this_test_1")
            names, kept = zip(*replay.kept(folder))
            self.assertEqual((names, kept), ((["this_test_1 sim-1"],), (self.trace,)))
            self.assertEqual(self.wrong_in(folder), (0, ["1 records", "1 whole"]))
            cut = dataclasses.replace(self.trace, robot=[], station=[], left_out=recorded.SCHEDULE)
            odd = dataclasses.replace(cut, left_out="something else")
            forged = dataclasses.replace(self.trace, robot=[("MOVING", 0)] + self.trace.robot)
            pathlib.Path(folder, "others_1.json").write_text(json.dumps({
                "cut": vars(cut), "odd": vars(odd), "forged": vars(forged)}))
            self.assertEqual(self.wrong_in(folder), (2, ["4 records", "2 beyond the model", "2 whole"]))

    def wrong_in(self, folder):
        with contextlib.redirect_stdout(io.StringIO()) as out:
            wrong = replay.replay(self.model, folder)
        print(out.getvalue(), flush=True)
        total, kinds = out.getvalue().splitlines()[-1].split(": ")
        return wrong, [total.split(", ")[0], *kinds.split(", ")]


if __name__ == "__main__":
    unittest.main()
