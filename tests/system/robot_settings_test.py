"""`rheonaut robot parameters`, `controller` and `fluid` with a real station and a simulated robot: each line of docs/commands.md
runs, and what it says is what the robot has in force."""
import json
import os
import pathlib
import re
import subprocess
import unittest

from processes import BIN, ROOT, lab, wait_until

LINE = re.compile(r"^    (rheonaut robot (?:parameters|controller|fluid) .*?)(?:\s+# exit status (\d+))?$", re.M)


class RobotSettingsTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab())
        self.station = self.place.start_station()
        self.place.start_robot(self.station, "sim-1", "--sensor", "perfect")
        self.station.wait_for_robot("sim-1")

    def run_line(self, line):
        environment = dict(os.environ, PATH=f"{BIN}:{os.environ['PATH']}")
        return subprocess.run(["bash", "-c", line.replace("--data lab", f"--data {self.place.data}")], text=True,
                              cwd=self.place.folder, env=environment, capture_output=True)

    def parameters(self):
        told = self.station.get("/api/v1/robots/sim-1/parameters")
        self.assertTrue(told["is_current"])
        return {one["name"]: one for one in told["parameters"]}

    def test_documented_lines_run(self):
        self.run_line("rheonaut tune --crossover-rad-s 3 --phase-margin-deg 90 --json > c.json")
        self.run_line("rheonaut discretise --controller c.json --json > d.json")
        self.run_line("rheonaut estimator --plant newtonian --json > model.json")
        for number in (1, 2):
            kept = self.run_line(f"rheonaut design save c.json --kind controller --name c{number} --data lab")
            self.assertEqual(kept.returncode, 0, kept.stderr)
        lines = LINE.findall((ROOT / "docs/commands.md").read_text(encoding="utf-8"))
        self.assertGreaterEqual(len(lines), 13)
        for line, status in lines:
            with self.subTest(line=line):
                done = self.run_line(line)
                self.assertEqual(done.returncode, int(status or 0), done.stderr)

    def test_a_model_of_its_own_is_in_force_until_the_fluid_changes(self):
        self.run_line("rheonaut estimator --plant newtonian --json > model.json")
        done = self.run_line("rheonaut robot fluid sim-1 --set water --model model.json --data lab")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("sent to this robot alone", done.stdout)
        model = json.loads((pathlib.Path(self.place.folder) / "model.json").read_text())
        held = self.parameters()
        for number, gain in enumerate(model["model_gain_m_s"], 1):
            self.assertAlmostEqual(held[f"model_gain_{number}_m_s"]["value"], gain, places=6)
        self.assertEqual(held["model_confirmed"]["value"], 1)
        self.assertEqual(self.run_line("rheonaut robot fluid sim-1 --set non_newtonian --data lab").returncode, 0)
        wait_until(lambda: self.station.robot("sim-1")["model"]["state"] == "assumed", 30, "it is taken back")
        wait_until(lambda: self.parameters()["model_confirmed"]["value"] == 0, 30, "the robot says so")

    def test_a_parameter_is_set_and_a_bound_needs_confirm(self):
        done = self.run_line("rheonaut robot parameters sim-1 --set duty_slew_per_s=5.1 --data lab")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("verified", done.stdout)
        self.assertEqual(self.parameters()["duty_slew_per_s"]["value"], 5.1)
        bound = "rheonaut robot parameters sim-1 --set position_limit_max_m=0.2 --data lab"
        done = self.run_line(bound)
        self.assertEqual(done.returncode, 1)
        self.assertIn("bounds motion", done.stderr)
        self.assertEqual(self.run_line(bound + " --confirm").returncode, 0)
        self.assertEqual([one["name"] for one in self.station.robot("sim-1")["changed_limits"]], ["position_limit_max_m"])
        for wrong, status in (("=5", 2), ("duty_slew_per_s", 2), ("duty_slew_per_s=fast", 2), ("no_such=1", 1),
                              ("duty_slew_per_s=-7", 1)):
            done = self.run_line(f"rheonaut robot parameters sim-1 --set {wrong} --data lab")
            self.assertEqual((done.returncode, done.stderr.count("\n")), (status, 1), wrong)

    def test_a_controller_goes_to_the_robot_and_back(self):
        shown = lambda: json.loads(self.run_line("rheonaut robot controller sim-1 --json --data lab").stdout)["controller"]
        before = shown()
        self.run_line("rheonaut tune --crossover-rad-s 3 --phase-margin-deg 90 --json > c.json")
        self.run_line("rheonaut discretise --controller c.json --json > d.json")
        done = self.run_line("rheonaut robot controller sim-1 --set d.json --json --data lab")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["state"], "verified")
        made = json.loads((pathlib.Path(self.place.folder) / "d.json").read_text())
        now = shown()
        self.assertAlmostEqual(now["kp"] / made["dc_gain"], 1, places=6)
        self.assertEqual((now["duty_min"], now["duty_max"]), (before["duty_min"], before["duty_max"]))
        again = self.run_line("rheonaut robot controller sim-1 --set c.json --json --data lab")  # discretised alike
        self.assertEqual(json.loads(again.stdout)["arguments"]["controller"]["checksum"], now["checksum"])
        narrow = self.run_line("rheonaut robot controller sim-1 --set d.json --duty-max 0.5 --data lab")
        self.assertEqual(narrow.returncode, 0, narrow.stderr)
        wider = self.run_line("rheonaut robot controller sim-1 --set d.json --duty-max 0.6 --data lab")
        self.assertIn("wider", wider.stderr)
        restored = self.run_line("rheonaut robot controller sim-1 --restore --confirm --data lab")
        self.assertEqual(restored.returncode, 0, restored.stderr)
        self.assertEqual(shown(), now)


if __name__ == "__main__":
    unittest.main()
