"""Runs of a real station and a simulated robot side by side: traces, impedance, reports, and the files of jobs."""

import csv
import io
import json
import time
import unittest

from processes import commanded, lab, wait_until

SETPOINT_M = 0.05


class ComparisonTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """Two runs are recorded once; each test has a station with a copy of them."""
        place = cls.enterClassContext(lab())
        station = place.start_station()
        place.start_robot(station, "sim-1", "--seed", "3")
        station.wait_for_robot("sim-1")
        cls.first, cls.second = [cls.record(station, f"repeat {n}", 0.2 + 0.2 * n) for n in range(2)]
        place.stop_station()
        place.close()
        cls.recorded = place.data

    @staticmethod
    def record(station, name, before_s):
        """A step after so long at rest, and back to rest."""
        commanded(station, "set_mode", mode="manual")
        commanded(station, "zero_position")
        # Samples of before may still be on their way, and would be the first of the run.
        wait_until(lambda: station.robot("sim-1")["mode"] == "manual", 60, "manual in telemetry")
        run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": name})["run_id"]
        time.sleep(before_s)  # these times are the input of this test
        commanded(station, "set_mode", mode="auto", setpoint_m=SETPOINT_M)
        time.sleep(1.2)
        station.post(f"/api/v1/runs/{run}/end", {})
        return run

    def test_repeats_are_compared_and_reported(self):
        first, second = self.first, self.second
        with lab(data=self.recorded) as place:
            place.start_station()
            asked = place.tool("compare", first, second, "--at", "step", "--json", "--data", place.data)
            self.assertEqual(asked.returncode, 0, asked.stderr)
            compared = json.loads(asked.stdout)
            at_s = [run["aligned_at_s"] for run in compared["runs"]]
            self.assertTrue(all(one > 0 for one in at_s), "each rested before its step")
            begin = compared["time_s"].index(0)
            for run in compared["runs"]:
                self.assertEqual(run["position_source"], "estimate")
                self.assertLess(abs(run["traces"]["position_m"][begin]), 0.01, "at the step it is where it was")
                self.assertGreater(run["traces"]["duty"][begin + 1], 0.5, "and the motor begins")
            end = begin + 100
            self.assertLess(abs(compared["runs"][1]["differences"]["position_m"][end]), 0.01)
            table = place.tool("compare", first, second, "--at", "step", "--data", place.data)
            self.assertIn("differences from run 1, every 0.01 s", table.stdout)
            rows = list(csv.reader(io.StringIO(place.tool("compare", first, second, "--at", "step", "--csv", "--data",
                                                          place.data).stdout)))
            self.assertEqual(len(rows), 1 + len(compared["time_s"]))
            self.assertIn(f"run_{second}_difference_position_m", rows[0])
            refused = place.tool("compare", first, second, "--at", "disturbance", "--data", place.data)
            self.assertEqual(refused.returncode, 1)
            self.assertIn("run 1 ('repeat 0') has no disturbance 1, none", refused.stderr)
            mapped = place.tool("impedance-map", first, second, "--bin-mm", 10, "--data", place.data)
            self.assertIn("warning: positions are the robot's own estimate", mapped.stdout, mapped.stderr)
            report = place.folder / "two.html"
            made = place.tool("report", first, second, "--at", "step", "--to", report, "--data", place.data)
            self.assertEqual((made.returncode, made.stdout), (0, f"{report}\n"), made.stderr)
            self.assertIn("Aligned at step 1; differences are from run 1.", report.read_text())
            self.assertEqual(place.tool("report", 9, "--to", report, "--data", place.data).returncode, 1)
            self.assertIn("Aligned at", report.read_text(), "a refusal replaces nothing")

    def test_the_file_of_a_job_survives_kill_9_and_half_a_file_does_not(self):
        first = self.first
        with lab(data=self.recorded) as place:
            station = place.start_station()
            request = place.folder / "request.json"
            request.write_text(json.dumps({"kind": "export", "run_id": first, "format": "csv"}))
            made = place.tool("job", "begin", request, "--wait", "--data", place.data)
            self.assertEqual(made.returncode, 0, made.stderr)
            size_bytes = json.loads(made.stdout)["size_bytes"]
            kept = place.data / "job-files"
            (kept / "job-2.part").write_text("half")
            (kept / "job-2-1767225600.csv").write_text("whole, but its job is not done")
            for _ in range(3):
                station.post("/api/v1/jobs", {"kind": "report", "runs": [1, 2]})
            place.kill_station()
            station = place.start_station(robots=station.endpoints["robots"])
            saved = place.folder / "saved.csv"
            again = place.tool("job", "file", 1, "--to", saved, "--data", place.data)
            self.assertEqual(again.returncode, 0, again.stderr)
            self.assertEqual(saved.stat().st_size, size_bytes)
            _, _, direct = station.request("GET", f"/api/v1/runs/{first}/samples.csv")
            self.assertEqual(saved.read_bytes(), direct)
            jobs = {job["job_id"]: job["state"] for job in station.get("/api/v1/jobs")["jobs"]}
            self.assertLessEqual(set(jobs.values()), {"done", "interrupted"})
            files = {int(path.name.split("-")[1]): path.name for path in kept.iterdir()}
            self.assertEqual(set(files), {job for job, state in jobs.items() if state == "done"}, files)
            self.assertFalse([name for name in files.values() if ".part" in name])
            begun = station.post("/api/v1/jobs", {"kind": "report", "runs": [1, 2]})["job_id"]
            wait_until(lambda: station.get(f"/api/v1/jobs/{begun}")["state"] == "done", 60, "the report's end")
            status, headers, body = station.request("GET", f"/api/v1/jobs/{begun}/file")
            self.assertEqual((status, headers["Content-Type"]), (200, "text/html; charset=utf-8"))
            self.assertTrue(body.endswith(b"</html>\n"))


if __name__ == "__main__":
    unittest.main()
