"""A camera beside a run: the simulator's true position, on a clock that nobody knows, is imported by correlation; then the
measures of the run are those of the truth, and identification fits it. Real processes."""
import random
import re
import time
import unittest

from processes import commanded, lab

CLOCK_S, ZERO_M, SD_M = 417.25, -0.8, 0.0005  # what the camera calls 0, on both axes; how exact it is
STEPS = [(0.1, 2.5), (0.05, 1.5)]  # setpoint and seconds


def read_truth(path):
    rows = [line.split(",") for line in path.read_text().splitlines()[1:] if line.count(",") == 1]
    return [(int(t), float(x)) for t, x in rows if x]


class ReferenceTest(unittest.TestCase):
    def record(self, station):
        """A run of steps in auto mode; its number."""
        run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "steps", "fluid": "non_newtonian"})
        time.sleep(0.3)  # these times are the input of this test
        commanded(station, "set_mode", mode="auto", setpoint_m=STEPS[0][0])
        time.sleep(STEPS[0][1])
        for setpoint_m, seconds in STEPS[1:]:
            commanded(station, "set_setpoint", setpoint_m=setpoint_m)
            time.sleep(seconds)
        station.post(f"/api/v1/runs/{run['run_id']}/end", {})
        commanded(station, "set_mode", mode="manual")
        return run["run_id"]

    def write_camera(self, path, truth):
        """30 Hz, noise of 0.5 mm, from before the run until after it."""
        noise = random.Random(4)
        with open(path, "w") as out:
            out.write("t_s,position_m\n")
            after = 1
            for frame in range(10**6):
                at_us = truth[0][0] + frame * 1e6 / 30
                while after < len(truth) and truth[after][0] < at_us:
                    after += 1
                if after == len(truth):
                    return
                (t0, x0), (t1, x1) = truth[after - 1], truth[after]
                seen_m = x0 + (x1 - x0) * (at_us - t0) / (t1 - t0) + ZERO_M + noise.gauss(0, SD_M)
                out.write(f"{at_us / 1e6 - CLOCK_S:.6f},{seen_m:.6f}\n")

    def identify(self, place, run_id, *options):
        """Of the whole run, or of the longest part without a missed tick: a busy machine makes the robot miss some."""
        command = ["identify", "--run", run_id, "--data", place.data, "--structure", "second_order", *options]
        done = place.tool(*command)
        part = re.search(r"the robot skipped .*; choose (--from-s) (\S+) (--to-s) ([\d.]+)", done.stderr)
        return place.tool(*command, *part.groups()) if part else done

    def test_a_camera_shows_the_true_error_and_is_what_is_fitted(self):
        with lab() as place:
            station = place.start_station()
            truth_file = place.folder / "truth.csv"
            place.start_robot(station, "sim-1", "--seed", "11", "--truth", truth_file)
            station.wait_for_robot("sim-1")
            for _ in range(6):  # a busy machine makes the robot miss ticks, and a run in short pieces cannot be fitted
                run_id = self.record(station)
                if self.identify(place, run_id).returncode in (0, 4):
                    break
            truth = read_truth(truth_file)
            camera = place.folder / "camera.csv"
            self.write_camera(camera, truth)
            imported = place.tool("reference", "import", "--run", run_id, "--csv", camera, "--sd-mm", 1e3 * SD_M,
                                  "--data", place.data)
            self.assertEqual(imported.returncode, 0, imported.stderr)
            self.assertIn("clock by correlation", imported.stdout)
            reference = station.get(f"/api/v1/runs/{run_id}/reference")
            first_us = station.get(f"/api/v1/runs/{run_id}/samples?limit=1")["samples"][0]["robot_time_us"]
            error_s = reference["clock_offset_s"] - (CLOCK_S - first_us / 1e6)
            self.assertLess(abs(error_s), max(0.01, 3 * reference["clock_sd_s"]))

            metrics = station.get(f"/api/v1/runs/{run_id}/step-metrics")
            self.assertEqual([step["position_source"] for step in metrics["steps"]], ["outside"] * len(STEPS))
            zero_m = reference["zero_offset_m"] + ZERO_M  # what the robot's own record made of zero
            samples = station.get(f"/api/v1/runs/{run_id}/samples?limit=10000")["samples"]
            made_us = {sample["seq"]: sample["robot_time_us"] for sample in samples}  # a busy machine makes the robot miss ticks
            for step, (setpoint_m, _) in zip(metrics["steps"], STEPS, strict=True):
                self.assertAlmostEqual(step["target_m"], setpoint_m, places=6)
                end = min(range(1, len(truth)), key=lambda row: abs(truth[row][0] - made_us[step["last_seq"]]))
                (t0, x0), (t1, x1) = truth[end - 1], truth[end]
                doubt_m = 0.001 + abs(1e6 * (x1 - x0) / (t1 - t0)) * max(0.01, 3 * reference["clock_sd_s"])  # of one that still swims
                self.assertAlmostEqual(step["steady_state_error_m"], setpoint_m - x1 - zero_m, delta=doubt_m)
            self.assertGreater(metrics["estimate_error"]["samples"], 100)
            self.assertLess(metrics["estimate_error"]["rms_m"], 0.05)

            fitted = self.identify(place, run_id)
            self.assertIn(fitted.returncode, (0, 4), fitted.stderr)
            self.assertTrue(fitted.stdout.startswith("fitted: position_m; position measured from outside (camera.csv)"),
                            fitted.stdout)
            self.assertIn(", 30 Hz, ", fitted.stdout.splitlines()[0])
            of_robot = self.identify(place, run_id, "--channels", "robot")
            self.assertTrue(of_robot.stdout.startswith("fitted: acceleration_m_s2"), of_robot.stdout)


if __name__ == "__main__":
    unittest.main()
