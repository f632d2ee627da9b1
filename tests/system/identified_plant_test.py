"""From a recording to a simulated robot: the real `rheonaut identify --json` of golden step responses is the fluid of
`rheonaut-sim`, which then moves as that very model does by `rheonaut step`."""
import csv
import io
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

BIN = pathlib.Path(os.environ["RHEONAUT_BIN"])  # set by CTest
DATA = pathlib.Path(__file__).resolve().parents[1] / "data"
PERIOD_S, DUTY = 0.01, 0.3
STEP_AT_S = 1
TIMES_S = (0.1, 0.5, 1, 2, 5, 10, 30)

SCENARIO = f"""
duration_s = 32
[accelerometer]
preset = "perfect"
[[script]]
at_s = {STEP_AT_S}
command = "set_duty"
duty = {DUTY}
for_s = 31
"""


def golden_responses():
    """(column, values) of each golden recording that a fractional model can be found in."""
    recordings = json.loads((DATA / "identification_dataset.json").read_text())["datasets"]
    columns = {"velocity": "velocity_m_s", "position": "position_m"}
    return [(columns[each["output"]], each["y"]) for each in recordings if each["sigma"] < 1e-3]


class IdentifiedPlant(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="rheonaut-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "step.toml").write_text(SCENARIO)

    def run_program(self, program, *arguments):
        done = subprocess.run([BIN / program, *arguments], cwd=self.folder, capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def identify(self, column, values, *flags):
        """Leaves the answer in model.json, as a person would, and returns it."""
        rows = "".join(f"{k * PERIOD_S:.2f},{DUTY},{value!r}\n" for k, value in enumerate(values))
        (self.folder / "run.csv").write_text(f"t_s,duty,{column}\n{rows}")
        answer = self.run_program("rheonaut", "identify", "--csv", "run.csv", "--json", *flags)
        (self.folder / "model.json").write_text(answer)
        return json.loads(answer)

    def simulated_positions(self):
        """Position by time since the step, in whole ticks."""
        rows = csv.DictReader(io.StringIO(self.run_program("rheonaut-sim", "play", "step.toml", "--model", "model.json")))
        return {round((float(row["t_s"]) - STEP_AT_S) / PERIOD_S): float(row["position_m"]) for row in rows}

    def expect_the_models_own_step(self):
        times = ",".join(map(str, TIMES_S))
        answer = self.run_program("rheonaut", "step", "--plant", "model.json", "--duty", str(DUTY), "--times", times, "--json")
        simulated = self.simulated_positions()
        for time_s, expected_m in zip(TIMES_S, json.loads(answer)["position_m"], strict=True):
            position_m = simulated[round(time_s / PERIOD_S)]
            self.assertAlmostEqual(position_m, expected_m, delta=2e-6 * expected_m, msg=f"at {time_s} s")

    def test_every_structure_moves_as_its_model(self):
        for column, values in golden_responses():
            for structure in ("first_order", "second_order", "fractional"):
                with self.subTest(column=column, structure=structure):
                    self.identify(column, values, "--structure", structure)
                    self.expect_the_models_own_step()

    def test_the_best_model_moves_as_the_recording(self):
        for column, values in golden_responses():
            if column != "position_m":
                continue
            self.identify(column, values)
            simulated = self.simulated_positions()
            for k in range(0, len(values), 10):
                self.assertAlmostEqual(simulated[k], values[k], delta=6e-5, msg=f"at {k * PERIOD_S} s")

    def test_a_dead_time_is_in_the_motion(self):
        column, values = next(each for each in golden_responses() if each[0] == "position_m")
        found = self.identify(column, [0.0] * 8 + values[:-8], "--structure", "fractional", "--dead-time-s", "0.2")
        self.assertAlmostEqual(found["dead_time_s"], 0.08, delta=0.005)
        self.assertEqual(found["parameters"]["dead_time_s"], found["dead_time_s"])
        self.expect_the_models_own_step()

    def test_what_the_simulator_recorded_gives_its_fluid_back(self):
        recording = self.run_program("rheonaut-sim", "play", "figure_5", "--sensor", "perfect")
        (self.folder / "run.csv").write_text(recording)
        answer = self.run_program("rheonaut", "identify", "--csv", "run.csv", "--structure", "fractional", "--json")
        (self.folder / "model.json").write_text(answer)
        found = json.loads(answer)["parameters"]
        for key, value in {"kp": 0.1, "b1": 0.005682, "b2": 0.11031, "alpha": 1.7263, "beta": 0.8682}.items():
            self.assertAlmostEqual(found[key], value, delta=1e-4 * value)
        self.expect_the_models_own_step()


if __name__ == "__main__":
    unittest.main()
