"""Nothing stale moves the robot: a network that stands still for 2 s, and 50 setpoints sent meanwhile. Real processes,
the robot behind `rheonaut-sim proxy`."""
import json
import threading
import time
import unittest

from processes import PATIENT, commanded, lab, wait_until
from proxy_test import Running

SETPOINTS = [round(0.2 + 0.005 * i, 3) for i in range(50)]
STALL_S = 2
SPREAD_S = 0.03  # between two setpoints: all of them within 1.5 s, where the machine is not too busy
MARGIN_S = 0.4  # how long before its end a setpoint must be sent to be sure to arrive within the stall


class StalenessTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab(config=None))

    def start(self, config=None):
        self.station = self.place.start_station(config=config)
        self.proxy = Running("proxy", "--to", self.station.endpoints["robots"], "--seed", "1")
        self.addCleanup(self.proxy.close)
        port = self.proxy.port()
        self.place._start("sim-1", "rheonaut-sim", "--station", f"127.0.0.1:{port}", "--id", "sim-1", "--sensor", "perfect")
        self.station.wait_for_robot("sim-1")
        def is_there():
            if self.robot()["setpoint_m"] == 0.1:
                return True
            commanded(self.station, "set_mode", mode="auto", setpoint_m=0.1)  # again where the link was lost meanwhile
            return False
        wait_until(is_there, 60, "the setpoint in telemetry")

    def robot(self):
        return self.station.robot("sim-1")

    def stall_and_send(self, life_ms):
        """50 setpoints within a stall of 2 s; what the station says of each at the end, in the order they were sent, and
        how many of the last a busy machine sent so late that they may have come after the stall."""
        begun_s = time.monotonic()
        self.proxy.say(f"outage {STALL_S}")
        self.assertIn("ok", self.proxy.line_with("ok"))
        answers = [None] * len(SETPOINTS)
        late = 0

        def send(number, setpoint_m):
            body = {"kind": "set_setpoint", "setpoint_m": setpoint_m, "life_ms": life_ms}
            status, _, content = self.station.request("POST", "/api/v1/robots/sim-1/commands?wait=verified", body,
                                                      timeout_s=60)
            answers[number] = (status, json.loads(content))

        threads = []
        over = threading.Event()
        for number, setpoint_m in enumerate(SETPOINTS):
            threads.append(threading.Thread(target=send, args=(number, setpoint_m)))
            late += time.monotonic() > begun_s + STALL_S - MARGIN_S
            threads[-1].start()
            over.wait(SPREAD_S)  # spread over the stall, as an operator's dragging finger would
        for thread in threads:
            thread.join(60)
        self.assertNotIn(None, answers, "each is answered")
        return answers, late

    @staticmethod
    def state_of(answer):
        status, said = answer
        return said["state"] if status == 200 else said.get("command", {}).get("state", said["reason"])

    def setpoints_seen(self, run_id):
        rows = self.station.get(f"/api/v1/runs/{run_id}/samples?limit=10000")["samples"]
        seen = []
        for row in rows:
            if not seen or seen[-1] != row["setpoint_m"]:
                seen.append(row["setpoint_m"])
        return seen

    def test_of_setpoints_that_are_still_worth_something_only_the_newest_acts(self):
        self.start(PATIENT)  # a stall of 2 s is no lost link
        run_id = self.station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "stall"})["run_id"]
        answers, late = self.stall_and_send(life_ms=10_000)
        states = [self.state_of(answer) for answer in answers]
        self.assertEqual(states[-1], "verified", answers[-1])
        # The last that went ahead of the stall may be seen in telemetry before the newest is sent.
        self.assertLessEqual(set(states[:-1]), {"superseded", "verified"}, states)
        self.assertLessEqual(states[:-1].count("verified"), 1 + late, states)
        wait_until(lambda: self.robot()["setpoint_m"] == SETPOINTS[-1], 60, "the newest in telemetry")
        self.station.post(f"/api/v1/runs/{run_id}/end")
        # The newest is sent when those that went ahead of the stall are answered: the last of them may act for a tick.
        seen = self.setpoints_seen(run_id)
        self.assertEqual((seen[0], seen[-1]), (0.1, SETPOINTS[-1]), seen)
        self.assertLessEqual(len(seen), 3 + late, seen)

    def test_setpoints_older_than_their_life_never_act(self):
        self.start(PATIENT)  # a stall of 2 s is no lost link
        run_id = self.station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "stall"})["run_id"]
        answers, late = self.stall_and_send(life_ms=200)
        in_time = len(SETPOINTS) - late
        states = [self.state_of(answer) for answer in answers[:in_time]]
        # "unknown": sent before the stall showed, and answered after its caller had to be told something.
        self.assertLessEqual(set(states), {"expired", "superseded", "unknown"}, states)
        seen = self.robot()["next_seq"]
        wait_until(lambda: self.robot()["next_seq"] > seen + 100, 60, "another second of samples")
        self.station.post(f"/api/v1/runs/{run_id}/end")
        self.assertLessEqual(set(self.setpoints_seen(run_id)), {0.1, *SETPOINTS[in_time:]})
        self.assertGreater(in_time, 0, "the machine sent none within the stall")

    def test_a_stall_beyond_the_time_out_is_a_lost_link_and_nothing_moves_after_it(self):
        self.start()
        answers, _ = self.stall_and_send(life_ms=10_000)
        self.station.wait_for_robot("sim-1")
        states = [self.state_of(answer) for answer in answers]
        # "superseded": by a newer one, before the link was held for lost. "rejected": by the robot, which is in manual
        # when it comes back; that happens where the machine is slow, and the last ones are sent after the stall.
        self.assertLessEqual(set(states), {"unknown", "failed", "not_connected", "superseded", "rejected"}, states)
        self.assertIn("not_connected", states, "the link was held for lost within the stall")
        seen = self.robot()["next_seq"]
        wait_until(lambda: self.robot()["next_seq"] > seen + 100, 60, "another second of samples")
        robot = self.robot()  # a link that breaks once more changes none of it
        self.assertEqual((robot["mode"], robot["setpoint_m"], robot["sample"]["duty"]), ("manual", None, 0.0))


if __name__ == "__main__":
    unittest.main()
