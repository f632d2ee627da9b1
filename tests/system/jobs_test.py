"""Jobs of a real station on a run of a simulated robot: a model found, kept and exported; kill -9 in the middle."""

import json
import sqlite3
import time
import unittest

from processes import commanded, lab, wait_until

DUTIES_S = 2.4
JOBS = 8  # begun at once: the last of them wait when the station is killed


class JobsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """A run is recorded once; each test has a station with a copy of it."""
        place = cls.enterClassContext(lab())
        station = place.start_station()
        place.start_robot(station, "sim-1", "--seed", "3")
        station.wait_for_robot("sim-1")
        for _ in range(10):  # a busy machine makes the robot miss ticks, and a run in short pieces cannot be fitted
            cls.run_id = cls.record(station)
            fitted = place.tool("identify", "--run", cls.run_id, "--data", place.data, "--structure", "first_order", "--cut-at-gaps")
            if fitted.returncode in (0, 4):
                break
        place.stop_station()
        place.close()
        cls.recorded = place.data

    @staticmethod
    def record(station):
        """A run whose duty changes its sign: towards setpoints so far away that the motor has all its power. That needs no
        lease, which a busy machine would let lapse."""
        run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "duties"})["run_id"]
        commanded(station, "set_mode", mode="auto", setpoint_m=0)
        for step in range(int(DUTIES_S / 0.4)):
            commanded(station, "set_setpoint", setpoint_m=(1, -1)[step % 2])
            time.sleep(0.4)  # the input of this test
        commanded(station, "set_mode", mode="manual")
        station.post(f"/api/v1/runs/{run}/end", {})
        return run

    def jobs(self, station):
        return station.get("/api/v1/jobs")["jobs"]

    def test_a_model_is_found_kept_and_read_by_the_tools(self):
        with lab(data=self.recorded) as place:
            place.start_station()
            request = place.folder / "request.json"
            request.write_text(json.dumps({"kind": "identify", "run_id": self.run_id, "structure": "first_order", "cut_at_gaps": True}))
            found = place.tool("job", "begin", request, "--wait", "--data", place.data)
            self.assertEqual(found.returncode, 0, found.stderr)
            fit = json.loads(found.stdout)
            self.assertEqual(fit["channels"], ["acceleration_m_s2"], "the position is an estimate")
            self.assertGreater(fit["parameters"]["kp"], 0)
            kept = place.tool("design", "save", "--job", 1, "--kind", "model", "--name", "found", "--data", place.data)
            self.assertEqual(kept.stdout, "model 1 is kept as 'found'\n", kept.stderr)
            place.kill_station()
            place.start_station()
            exported = place.tool("design", "export", 1, "--data", place.data)
            self.assertEqual(json.loads(exported.stdout), fit, "it was on disk before the answer")
            plant = place.folder / "plant.json"
            plant.write_text(exported.stdout)
            read = place.tool("bode", "--plant", plant, "--json")
            self.assertEqual(read.returncode, 0, read.stderr)
            metrics = place.tool("metrics", self.run_id, "--data", place.data, "--json")
            self.assertGreater(json.loads(metrics.stdout)["figures"]["driven_share"], 0.5, metrics.stderr)

    def test_kill_9_leaves_nothing_half_written_and_nothing_begins_again(self):
        with lab(data=self.recorded) as place:
            station = place.start_station()
            for _ in range(JOBS):
                station.post("/api/v1/jobs", {"kind": "identify", "run_id": self.run_id, "cut_at_gaps": True})
            wait_until(lambda: any(job["state"] == "running" for job in self.jobs(station)), 60, "a running job")
            place.kill_station()
            station = place.start_station(robots=station.endpoints["robots"])
            states = [job["state"] for job in self.jobs(station)]
            self.assertEqual(len(states), JOBS)
            # One may fail: the run of a busy machine can be too poor to be fitted.
            self.assertLessEqual(set(states), {"done", "failed", "interrupted"})
            self.assertIn("interrupted", states)
            with sqlite3.connect(f"file:{place.data}/station.sqlite?mode=ro", uri=True) as database:
                for state, result in database.execute("SELECT state, result FROM job"):
                    self.assertEqual(result is not None, state == "done")
            database.close()
            station.post("/api/v1/jobs", {"kind": "identify", "run_id": self.run_id, "structure": "first_order", "cut_at_gaps": True})
            wait_until(lambda: self.jobs(station)[0]["state"] == "done", 60, "the newest job's end")
            self.assertEqual([job["state"] for job in self.jobs(station)[1:]], states, "none of them has begun again")

    def test_a_cancelled_job_has_no_result_and_the_next_one_is_computed(self):
        with lab(data=self.recorded) as place:
            station = place.start_station()
            for more in ({"time_limit_s": 2}, {}, {"structure": "first_order"}):  # the first keeps the second waiting
                station.post("/api/v1/jobs", {"kind": "identify", "run_id": self.run_id, "cut_at_gaps": True, **more})
            cancelled = place.tool("job", "cancel", 2, "--data", place.data)
            self.assertEqual(cancelled.returncode, 0, cancelled.stderr)
            wait_until(lambda: self.jobs(station)[0]["state"] == "done", 60, "the newest job's end")
            shown = place.tool("job", "show", 2, "--wait", "--data", place.data)
            self.assertEqual((shown.returncode, shown.stdout, shown.stderr), (5, "", "rheonaut: job 2 cancelled\n"))
            self.assertIsNone(station.get("/api/v1/jobs/2")["result"])


if __name__ == "__main__":
    unittest.main()
