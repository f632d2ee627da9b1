"""Experiments of a real station with a simulated robot: one in one command; the queue under kill -9 at random moments."""
import contextlib
import itertools
import json
import os
import pty
import random
import re
import select
import signal
import sqlite3
import subprocess
import threading
import time
import unittest

from processes import BIN, ApiError, commanded, lab, wait_until

KILLS = int(os.environ.get("RHEONAUT_QUEUE_KILLS", "6"))  # docs/reliability.md has the figures of 50
ENDED = {"done", "aborted", "cancelled", "interrupted"}
DUTY = {"name": "duty", "purpose": "moves", "conditions": {"start": "here"}, "limits": {"position_min_m": -50, "position_max_m": 50},
        "step": [{"kind": "rest", "for_s": 0.2}, {"kind": "duty", "duty": 0.2, "for_s": 0.8}]}
AUTO = {"name": "auto", "purpose": "moves", "step": [{"kind": "setpoint", "setpoint_m": 0.05, "for_s": 1}]}


class SignsOfLife:
    """Of the script, for each experiment that is in its hands, until it is closed: for the next ones ten times a second,
    for all that wait every 5 s."""

    def __init__(self, station):
        self.station = station
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)  # a test that fails ends
        self.thread.start()

    def run(self):
        for turn in itertools.count():
            if self.ends.wait(0.1):
                return
            with contextlib.suppress(ApiError, OSError):  # it is being killed
                listed = self.station.get("/api/v1/experiments?limit=1000")["experiments"]
                left = [one["experiment_id"] for one in listed if one["state"] not in ENDED]  # the newest first
                for one in left if turn % 50 == 0 else left[-3:]:  # 409: it has just ended, or is in other hands
                    self.station.request("POST", f"/api/v1/experiments/{one}/keep-alive")

    def close(self):
        self.ends.set()
        self.thread.join()


class ExperimentsTest(unittest.TestCase):
    def performed(self, attempt):
        """What the command says of the experiment that was done. A machine that stands still has one aborted, as it
        must be; then it is begun again."""
        said = []
        for _ in range(8):
            done = attempt()
            said.append(done.stdout + done.stderr)
            if done.returncode == 0:
                return done.stdout
            self.assertEqual(done.returncode, 5, said[-1])
        self.fail("\n".join(said))

    def test_a_profile_in_one_command(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station, "sim-1", "--sensor", "perfect")
            station.wait_for_robot("sim-1")
            profile = place.folder / "steps.toml"
            profile.write_text('name = "Two steps"\npurpose = "To see it work."\n[conditions]\nfluid = "non_newtonian"\n'
                               '[[step]]\nkind = "duty"\nduty = 0.3\nfor_s = 0.5\n'
                               '[[step]]\nkind = "setpoint"\nsetpoint_m = 0.1\nfor_s = 1\n')
            said = self.performed(lambda: place.tool("experiment", "begin", profile, "--robot", "sim-1", "--wait",
                                                     "--data", place.data))
            one = int(re.search(r"experiment (\d+) \(Two steps\) is done", said)[1])
            run_id = station.get(f"/api/v1/experiments/{one}")["runs"][0]["run_id"]
            run = station.get(f"/api/v1/runs/{run_id}")
            self.assertEqual((run["state"], run["verdict"], run["fluid"]), ("ended", "done", "non_newtonian"))
            prediction = station.get(f"/api/v1/experiments/{one}/runs/1/prediction")
            self.assertEqual(prediction["model_of"], "(29)")
            listed = place.tool("experiment", "list", "--data", place.data)
            self.assertIn("Two steps", listed.stdout)
            metrics = station.get(f"/api/v1/runs/{run_id}/metrics")
            self.assertAlmostEqual(metrics["steps"][0]["target_m"], 0.1, places=6)

    def test_an_invocation_keeps_alive_what_it_began_and_nothing_else(self):
        with lab() as place:
            station = place.start_station()
            for robot_id in ("sim-1", "sim-2"):
                place.start_robot(station, robot_id, "--sensor", "perfect")
            for robot_id in ("sim-1", "sim-2"):
                station.wait_for_robot(robot_id)
            profile = place.folder / "duty.json"
            profile.write_text(json.dumps(DUTY))
            rest = place.folder / "rest.json"
            rest.write_text(json.dumps({"name": "rest", "purpose": "nothing moves", "conditions": {"start": "here"},
                                        "step": [{"kind": "rest", "for_s": 4}]}))
            begin = lambda *words: place.tool("experiment", "begin", *words, "--data", place.data)
            commanded(station, "set_mode", "sim-2", mode="manual")  # nothing begins within 3 s of a person's command
            left = begin(profile, "--robot", "sim-2", "--json")
            self.assertEqual(left.returncode, 0, left.stderr)
            left_alone = json.loads(left.stdout)
            self.assertEqual(left_alone["waits_for"], "robot_in_use")
            self.performed(lambda: begin(rest, "--robot", "sim-1", "--wait"))
            waits = station.get(f"/api/v1/experiments/{left_alone['experiment_id']}")
            self.assertEqual((waits["state"], waits["waits_for"]), ("waiting", "nobody_present"))
            self.assertIn("token:local, script", waits["waits_for_detail"])
            refused = station.request("POST", f"/api/v1/experiments/{left_alone['experiment_id']}/keep-alive")
            self.assertEqual(refused[0], 409)
            wait_until(lambda: station.robot("sim-2")["sample"]["duty"] == 0, 10, "it is at rest")
            with sqlite3.connect(f"file:{place.data / 'station.sqlite'}?mode=ro", uri=True) as database:
                moved = database.execute("SELECT count(*) FROM sample JOIN segment ON row BETWEEN first_row AND last_row"
                                         " JOIN boot USING (boot_key) WHERE robot_id = 'sim-2' AND duty <> 0").fetchone()
            self.assertEqual(moved, (0,))
            done = place.tool("experiment", "take-over", left_alone["experiment_id"], "--wait", "--data", place.data)
            self.assertIn(done.returncode, (0, 5), done.stderr)  # 5: a machine that stood still
            self.assertNotEqual(station.get(f"/api/v1/experiments/{left_alone['experiment_id']}")["state"], "waiting")

    def test_a_key_pauses_the_count_down(self):
        """The simulator stands still for 1.5 s in a duty; at the terminal of who waits a key is pressed."""
        with lab() as place:
            station = place.start_station()
            robot = place.start_robot(station, "sim-1", "--sensor", "perfect")
            station.wait_for_robot("sim-1")
            profile = place.folder / "duty.json"
            profile.write_text(json.dumps({**DUTY, "step": [{"kind": "duty", "duty": 0.2, "for_s": 60}]}))
            command = [str(BIN / "rheonaut"), "experiment", "begin", str(profile), "--robot", "sim-1", "--wait",
                       "--data", str(place.data)]
            pid, terminal = pty.fork()
            if pid == 0:
                os.execv(command[0], command)
            try:
                self.read_until(terminal, b"running: run 1 of 1, step 1 of 1, 2 of 60 s")
                robot.send_signal(signal.SIGSTOP)
                time.sleep(1.5)
                robot.send_signal(signal.SIGCONT)
                self.read_until(terminal, b"(any key pauses it)")
                os.write(terminal, b"x")
                self.read_until(terminal, b"has paused it")
                one = station.get("/api/v1/experiments?limit=1")["experiments"][0]
                self.assertEqual((one["state"], one["reason"], one["progress"]["goes_on_in_s"]),
                                 ("paused", "requested", None))
                time.sleep(4)  # longer than the count-down
                self.assertEqual(station.robot("sim-1")["sample"]["duty"], 0)
                station.request("POST", f"/api/v1/experiments/{one['experiment_id']}/abort")
                with contextlib.suppress(OSError):  # its end
                    while os.read(terminal, 4096):
                        pass
            finally:
                os.waitpid(pid, 0)
                os.close(terminal)
            run = station.get(f"/api/v1/runs/{station.get('/api/v1/runs?limit=1')['runs'][0]['run_id']}")
            reasons = [part["reason"] for part in run["interrupted"]]
            self.assertGreater(len(reasons), 0)  # a busy machine may interrupt it again
            self.assertNotIn("requested", reasons)  # but why it was interrupted

    def read_until(self, terminal, wanted):
        shown = b""
        while wanted not in shown:
            self.assertTrue(select.select([terminal], [], [], 60)[0], shown)
            try:
                shown += os.read(terminal, 4096)
            except OSError:  # its end
                self.fail(f"it ended before it said {wanted}: {shown}")

    def test_the_pump_of_the_simulator_is_set_by_a_person_and_stored_with_the_run(self):
        with lab() as place:
            station = place.start_station()
            truth = place.folder / "truth.csv"
            place.start_robot(station, "sim-1", "--sensor", "perfect", "--mean-flow-m3-s", 0, "--faults", "127.0.0.1:0",
                              "--truth", truth)
            station.wait_for_robot("sim-1")
            signs = SignsOfLife(station)
            self.addCleanup(signs.close)
            address = re.search(r"faults at http://(\S+)/faults", place.log("sim-1"))[1]
            sim = lambda *words: subprocess.run([BIN / "rheonaut-sim", "pump", *words, "--faults", address],
                                                capture_output=True, text=True, timeout=60)
            conditions = {"pump": "constant", "mean_flow_m_s": 0.04}
            profile = {"name": "carried", "purpose": "by the flow", "conditions": conditions,
                       "step": [{"kind": "rest", "for_s": 1}]}
            begun = []

            def state():
                return station.get(f"/api/v1/experiments/{begun[-1]}")

            def begin():
                begun.append(station.post("/api/v1/experiments", {"robot_id": "sim-1", "profile": profile})["experiment_id"])
                wait_until(lambda: state()["state"] == "paused", 60, "it asks for the pump")

            def resume():
                if state()["state"] != "paused":
                    begin()
                return place.tool("experiment", "resume", begun[-1], "--wait", "--data", place.data)

            begin()
            self.assertEqual((state()["reason"], state()["runs"]), ("pump", []))
            self.assertIn("set the pump to 'constant, mean 0.04 m/s'", state()["detail"])
            refused = sim("constant", "--mean-flow-m-s", "7")
            self.assertEqual(refused.returncode, 1)
            self.assertIn("mean_flow_m_s: is 7.0, allowed is -1 to 1", refused.stderr)
            done = sim("constant", "--mean-flow-m-s", "0.04")
            self.assertEqual((done.returncode, done.stdout), (0, "pump: constant, 0.04 m/s\n"), done.stderr)
            wait_until(lambda: abs(self.velocities(truth)[-20:][0] - 0.04) < 0.001, 60, "the end of the pump's ramp")
            self.performed(resume)
            run = station.get(f"/api/v1/runs/{state()['runs'][0]['run_id']}")
            self.assertEqual((run["pump_profile"], run["mean_flow_m_s"]), ("constant", 0.04))
            self.assertIs(station.get(f"/api/v1/experiments/{begun[-1]}/runs/1/prediction")["ignores_flow"], True)
            begun_us = state()["runs"][0]["steps"][0]["robot_time_us"]
            wait_until(lambda: self.points(truth)[-1][0] > begun_us + 900_000, 60, "the truth of the run in its file")
            velocities = sorted(self.velocities(truth, begun_us, begun_us + 900_000))
            tail = len(velocities) // 20  # a busy machine makes the robot miss ticks
            self.assertAlmostEqual(velocities[tail], 0.04, delta=0.001, msg="it is carried")
            self.assertAlmostEqual(velocities[-1 - tail], 0.04, delta=0.001, msg="a constant flow has no pulse")

    @staticmethod
    def points(truth):
        """(robot's time, true position) of each complete line."""
        return [tuple(map(float, line.split(","))) for line in truth.read_text().splitlines()[1:-1]]

    def velocities(self, truth, from_us=0, until_us=float("inf")):
        """In m/s, from each tick to the next."""
        during = [(t, x) for t, x in self.points(truth) if from_us <= t <= until_us]
        return [1e6 * (x - x0) / (t - t0) for (t0, x0), (t, x) in zip(during, during[1:]) if t > t0]

    def at_rest(self, station):
        robot = station.robot("sim-1")
        return robot["link"] == "connected" and robot["mode"] == "manual" and robot["sample"]["duty"] == 0

    def test_the_queue_loses_nothing_and_moves_nothing_by_itself_when_the_station_is_killed(self):
        seed = random.randrange(2**32)
        print(f"seed {seed}")
        chance = random.Random(seed)
        with lab(config=None) as place:
            station = place.start_station()
            robots = station.endpoints["robots"]
            place.start_robot(station, "sim-1", "--sensor", "perfect")
            station.wait_for_robot("sim-1")
            asked = 0
            for _ in range(KILLS):
                alive = SignsOfLife(station)
                for profile in chance.choices([DUTY, AUTO], k=2):
                    station.post("/api/v1/experiments", {"robot_id": "sim-1", "profile": profile})
                    asked += 1
                time.sleep(chance.uniform(0.0, 2.5))  # the moment of a kill is the input of this test
                place.kill_station()
                alive.close()
                station = place.start_station(robots=robots)
                station.wait_for_robot("sim-1")
                wait_until(lambda: self.at_rest(station), 60, "the robot at rest")
                alive = SignsOfLife(station)  # somebody is there, and nothing may begin all the same
                self.expect_rest(station, asked)
                alive.close()
            alive = SignsOfLife(station)
            held = [one["experiment_id"] for one in self.all_of(station) if one["held"]]
            left = lambda: [one for one in self.all_of(station) if one["state"] not in ENDED]
            for _ in range(len(left())):
                for one in reversed(left()):  # all at first; later what was held since one before it was aborted
                    if one["held"]:
                        station.post(f"/api/v1/experiments/{one['experiment_id']}/resume")
                before = len(left())
                try:
                    wait_until(lambda: len(left()) < before or before == 0, 120, "the next of the queue")
                except TimeoutError:
                    self.fail(f"stuck: {left()}")
            self.assertEqual(left(), [])
            alive.close()
            states = {one["experiment_id"]: one["state"] for one in self.all_of(station)}
            self.assertTrue(all(states[one] in ("done", "aborted") for one in held), states)

    def all_of(self, station):
        return station.get("/api/v1/experiments?limit=1000")["experiments"]

    def expect_rest(self, station, asked):
        ends = time.monotonic() + 1
        while time.monotonic() < ends:
            robot = station.robot("sim-1")  # a link that breaks moves nothing
            moves = robot["mode"] != "manual" or (robot["sample"] is not None and robot["sample"]["duty"] != 0)
            self.assertFalse(moves, f"nothing moves by itself: {robot}")
            time.sleep(0.05)
        experiments = self.all_of(station)
        self.assertEqual(len(experiments), asked, "none is lost")
        for one in experiments:
            self.assertTrue(one["state"] in ENDED or (one["state"] == "waiting" and one["held"]), one)
            self.assertLessEqual(set(one["run_counts"]), ENDED, "no run is stuck")


if __name__ == "__main__":
    unittest.main()
