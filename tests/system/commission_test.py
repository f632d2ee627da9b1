"""`rheonaut robot commission` with a running station: a sound robot, one that is put together wrongly, a stop that is not
confirmed, Ctrl-C. Real processes."""
import json
import os
import pathlib
import pty
import signal
import subprocess
import tempfile
import unittest

import processes
from processes import BIN, commanded, lab, wait_until

SOUND = '[electrode]\npreset = "ds550"\n'
WITH_DEAD_ZONE = SOUND + "[motor]\ndead_zone_duty = 0.08\n"
WRONG = """[motor]
is_reversed = true
[accelerometer]
axis_cosine = 0
[electrode]
preset = "ds550"
noise_mv = 15
"""
ANSWERS = {"free_ahead_m": 0.6, "free_behind_m": 0.6, "direction": "forwards", "moved_m": None, "signed_by": "Ann"}
TRIES = 3  # a machine that stands still has an experiment aborted, as it must be


def begin(place, robot, answers, attempt, terminal=None):
    """A commissioning in the background, and the folder for its record. Without a terminal all is confirmed beforehand."""
    into = place.folder / f"{robot}-{attempt}"
    into.mkdir()
    (into / "answers.json").write_text(json.dumps(answers))
    with open(into / "said", "w") as said, open(into / "record", "w") as out:
        process = subprocess.Popen([str(BIN / "rheonaut"), "robot", "commission", robot, "--data", str(place.data),
                                    "--answers", str(into / "answers.json"), "--into", str(into), "--json",
                                    *([] if terminal else ["--yes"])],
                                   stdin=terminal or subprocess.DEVNULL, stdout=out, stderr=said)
    processes.hurry(process)  # whose signs of life the station waits for
    place.processes.append(process)
    return process, into


def end(process, into):
    """Its record, or None when it did not begin, and what it said."""
    process.wait(timeout=280)
    out, said = (into / "record").read_text(), (into / "said").read_text()
    print(f"--- {into.name}\n{said}", flush=True)
    return json.loads(out) if out else None, said


def verdicts_of(record):
    return {finding["step"]: finding["verdict"] for finding in record["findings"]}


def found_in(record, step):
    return next(finding["found"] for finding in record["findings"] if finding["step"] == step)


def has_stood_still(record):
    """The machine had no time for the simulated robot, which then missed ticks where its duty changed."""
    return any("samples are missing" in finding["found"] for finding in record["findings"])


class CommissionTest(unittest.TestCase):
    """One station for all: two robots are commissioned to the end while others have their accidents."""

    @classmethod
    def setUpClass(cls):
        cls.place = cls.enterClassContext(lab())
        cls.station = cls.place.start_station()
        cls.robots = {robot: cls.start_robot(robot, scenario) for robot, scenario in
                      (("sound", WITH_DEAD_ZONE), ("wrong", WRONG), ("silent", SOUND), ("interrupted", SOUND), ("asked", SOUND), ("full", SOUND))}
        for name, value in (("position_limit_max_m", 0.3), ("position_limit_min_m", -0.3)):
            commanded(cls.station, "set_parameter", "sound", name=name, value=value, confirm=True)
        cls.answers = {"sound": ANSWERS | {"set_dead_zone": "yes"}, "wrong": ANSWERS | {"direction": "backwards"}}
        cls.begun = {robot: begin(cls.place, robot, answers, 0) for robot, answers in cls.answers.items()}

    @classmethod
    def start_robot(cls, robot, scenario):
        (cls.place.folder / f"{robot}.toml").write_text(scenario)
        process = cls.place.start_robot(cls.station, robot, "--seed", "3", "--scenario",
                                        cls.place.folder / f"{robot}.toml")
        cls.station.wait_for_robot(robot)
        return process

    def reset(self, robot):
        latch = self.station.robot(robot)["emergency_id"]
        if latch:
            commanded(self.station, "clear_emergency", robot, emergency_id=latch)

    def to_its_end(self, robot):
        """The record of the one that began with the class, or of another try."""
        for attempt in range(1, TRIES + 1):
            process, into = self.begun[robot]
            record, said = end(process, into)
            if record and "it ended before its end" not in (record["unsigned_because"] or "") and not has_stood_still(record):
                return record, process.returncode, into
            self.reset(robot)
            for name, value in (("dead_zone_duty", 0), ("doubtful_duty", 0.05)):
                commanded(self.station, "set_parameter", robot, name=name, value=value)
            self.begun[robot] = begin(self.place, robot, self.answers[robot], attempt)
        raise AssertionError(said)

    def test_the_sound_robot_is_signed_off(self):
        record, status, into = self.to_its_end("sound")
        # What a busy machine may make worse: the time of a stop, and the doubts about a short fit.
        busy = {"stop_latency", "motor_constant"}
        verdicts = verdicts_of(record)
        self.assertEqual({step for step, verdict in verdicts.items() if verdict != "pass"} - busy, set())
        self.assertLessEqual({verdicts[step] for step in busy}, {"pass", "attention"})
        gain = next(f["figures"]["gain_m_s"] for f in record["findings"] if f["step"] == "motor_constant")
        self.assertAlmostEqual(gain, 0.1, delta=0.015)  # of equation (29)
        self.assertIn("doubtful_duty was set to 0.100 and dead_zone_duty to 0.060", found_in(record, "dead_zone"))
        parameters = self.station.get("/api/v1/robots/sound/parameters")["parameters"]
        values = {one["name"]: round(one["value"], 6) for one in parameters}
        self.assertEqual((values["dead_zone_duty"], values["doubtful_duty"]), (0.06, 0.1))
        self.assertEqual((status, record["signed_by"], record["not_marked"]), (0, "Ann", None))
        self.assertIn("--yes", record["confirmed_by"])
        self.assertIn("direction", record["answers_given_beforehand"])
        self.assertIn("zero its position", record["findings"][-1]["what_to_do"])
        folder, = into.glob("commission-sound-*")
        self.assertEqual(str(folder), record["folder"])
        subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=folder, check=True)
        self.assertIn(record["sha256"], (folder / "SHA256SUMS").read_text())
        stored = json.loads((folder / "record.json").read_text())
        self.assertEqual({name: record[name] for name in stored}, stored)
        for run in stored["runs"]:
            digest = self.station.get(f"/api/v1/runs/{run['run_id']}/certificate")
            self.assertEqual(digest["sha256"], run["sha256"])
        markers = [marker["text"] for marker in self.station.get("/api/v1/robots/sound/markers")["markers"]]
        self.assertTrue(any(record["sha256"] in text for text in markers), markers)
        self.assertIsNone(self.station.robot("sound")["control"])

    def test_the_wrong_robot_has_each_of_its_faults_named(self):
        record, status, _ = self.to_its_end("wrong")
        self.assertIn("the motor is reversed", found_in(record, "motor_direction"))
        self.assertIn("its axis lies across the tube", found_in(record, "imu_axis"))
        self.assertIn("noisy", found_in(record, "electrode"))
        self.assertEqual((status, record["signed_by"], record["outcome"]), (5, None, "not_passed"))
        self.assertEqual(record["unsigned_because"],
                         "failed: electrode, motor_direction, imu_axis; not done: dead_zone, motor_constant")
        self.assertEqual(self.station.robot("wrong")["mode"], "manual")

    def test_a_stop_that_is_not_confirmed_ends_it_before_the_motor_runs(self):
        ours, theirs = pty.openpty()
        self.addCleanup(os.close, ours)
        process, into = begin(self.place, "silent", ANSWERS, 0, theirs)
        os.close(theirs)
        wait_until(lambda: "Begin with 10 emergency stops?" in (into / "said").read_text(), 60, "the first question")
        self.robots["silent"].send_signal(signal.SIGSTOP)
        try:
            os.write(ours, b"yes\n")
            record, said = end(process, into)
        finally:
            self.robots["silent"].send_signal(signal.SIGCONT)
        self.assertEqual(process.returncode, 5)
        self.assertIn("THE STOP IS NOT CONFIRMED", said)
        self.assertNotIn("THE MOTOR RUNS NOW", said)
        self.assertEqual((record["runs"], record["signed_by"]), ([], None))
        self.assertEqual(verdicts_of(record)["stop_latency"], "fail")
        self.assertIn("0 of 1 stops confirmed; stop 1 is not confirmed", found_in(record, "stop_latency"))
        self.assertIn("NOT CONFIRMED", record["unsigned_because"])
        commands = self.station.get("/api/v1/robots/silent/commands?limit=1000")["commands"]
        self.assertEqual([], [one for one in commands if one["kind"] in ("set_duty", "set_duty_schedule", "set_mode")])
        wait_until(lambda: self.station.robot("silent")["mode"] == "emergency", 60, "the stop that was kept")

    def test_ctrl_c_stops_the_robot_while_its_motor_runs_and_keeps_what_was_found(self):
        for attempt in range(TRIES):
            process, into = begin(self.place, "interrupted", ANSWERS, attempt)
            wait_until(lambda: process.poll() is not None or self.station.robot("interrupted")["sample"]["duty"], 120,
                       "a push")
            if process.poll() is None:
                break
            self.reset("interrupted")
        process.send_signal(signal.SIGINT)
        record, said = end(process, into)
        self.assertEqual(process.returncode, 5)
        self.assertLess(said.index("Ended: interrupted by a signal"),
                        said.index("The robot is stopped: it confirmed after"))
        self.assertIn("THE MOTOR RUNS NOW", said)
        self.assertNotIn("Watch it", said)
        experiments = self.station.get("/api/v1/experiments?robot_id=interrupted")["experiments"]
        self.assertEqual([(one["name"], one["state"]) for one in experiments][:2],
                         [("Commissioning: pushes", "aborted"), ("Commissioning: at rest", "done")])
        self.assertEqual(len(record["runs"]), 1)
        self.assertIsNone(self.station.robot("interrupted")["control"])
        self.assertIn("interrupted by a signal", record["unsigned_because"])
        self.assertEqual(verdicts_of(record)["imu_noise"], "pass")
        self.assertEqual(verdicts_of(record)["free_travel"], "not_done")
        wait_until(lambda: (now := self.station.robot("interrupted"))["mode"] == "emergency"
                   and now["sample"]["duty"] == 0, 60, "the stop in telemetry")
        refused = self.place.tool("robot", "commission", "interrupted", "--data", self.place.data, "--yes", "--answers",
                                  into / "answers.json", "--into", into)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("the robot is in emergency", refused.stderr)

    def test_a_person_is_asked_on_the_terminal_and_may_say_no(self):
        without = self.place.tool("robot", "commission", "asked", "--data", self.place.data, "--into", self.place.folder)
        self.assertEqual(without.returncode, 2)
        self.assertIn("no answer to free_ahead_m", without.stderr)
        said, status, _ = self.typed("0.1\n0.1\n", None)
        self.assertIn("are needed ahead and behind", said)
        self.assertEqual(status, 1)
        self.assertIsNone(self.station.robot("asked")["control"])
        # What was typed before a question of safety does not answer it.
        said, status, _ = self.typed("far\n0.6\n0.6\nyes\n", "no\n")
        self.assertIn("A number of metres", said)
        self.assertIn("the person did not go on", said)
        self.assertNotIn("stop_latency: ", said)
        self.assertEqual(status, 5)
        self.assertIsNone(self.station.robot("asked")["control"])

    def test_a_record_that_cannot_be_written_is_printed(self):
        said, status, printed = self.typed("0.6\n0.6\n", "no\n", "full", keeps_folder=False)
        self.assertEqual(status, 5)
        self.assertIn("could not be written", said)
        record = json.loads(printed)
        self.assertEqual(verdicts_of(record)["versions"], "pass")
        self.assertIn("it could not be written", record["unsigned_because"])

    def typed(self, first, then, robot="asked", keeps_folder=True):
        """What a commissioning on a terminal says, its exit status, and its output; `then` answers the first confirmation."""
        ours, theirs = pty.openpty()
        self.addCleanup(os.close, ours)
        into = pathlib.Path(tempfile.mkdtemp(dir=self.place.folder))
        with open(self.place.folder / f"{into.name}.said", "w+") as said:
            process = subprocess.Popen([str(BIN / "rheonaut"), "robot", "commission", robot, "--data",
                                        str(self.place.data), "--into", str(into)], stdin=theirs,
                                       stdout=subprocess.PIPE, stderr=said, text=True)
            self.place.processes.append(process)
            os.close(theirs)
            os.write(ours, first.encode())
            if then:
                wait_until(lambda: "Begin with 10" in pathlib.Path(said.name).read_text(), 60, "the first confirmation")
                if not keeps_folder:
                    into.rmdir()
                os.write(ours, then.encode())
            printed = process.communicate(timeout=120)[0]
            return pathlib.Path(said.name).read_text(), process.returncode, printed


if __name__ == "__main__":
    unittest.main()
