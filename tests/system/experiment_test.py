"""The paper's closed-loop experiment over the real TCP link, with real processes: 40 s of real time."""
import unittest

import processes  # puts deploy/ on the path
from experiment import faults, perform, predict
from processes import lab


class ExperimentTest(unittest.TestCase):
    def test_the_measured_experiment_meets_its_bounds_and_the_prediction(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station, "sim-1", "--sensor", "perfect")
            station.wait_for_robot("sim-1")
            run, measures = perform(station, "sim-1")
            self.assertEqual(faults(run, measures), [])
            self.assertGreaterEqual(run["samples_stored"], 4000)
            predicted = predict(processes.BIN / "rheonaut-sim", -1)
            self.assertAlmostEqual(measures["settling_s"], predicted["settling_s"], delta=0.0101)
            self.assertAlmostEqual(measures["overshoot_percent"], predicted["overshoot_percent"], delta=0.05)

    def test_a_one_way_motor_keeps_its_overshoot(self):
        predicted = predict(processes.BIN / "rheonaut-sim", 0)
        self.assertIsNone(predicted["settling_s"])
        self.assertAlmostEqual(predicted["overshoot_percent"], 3.29, delta=0.2)
        self.assertAlmostEqual(predicted["disturbance_steady_state_error_m"], -0.0028, delta=0.0002)


if __name__ == "__main__":
    unittest.main()
