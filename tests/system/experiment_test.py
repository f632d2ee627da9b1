"""The paper's closed-loop experiment over the real TCP link, with real processes, and with 3 s in place of its 40 s: the whole
of it is performed in virtual time by tests/system/paper_test.cpp."""
import concurrent.futures
import unittest
from unittest import mock

import processes  # puts deploy/ on the path
import experiment
from experiment import Truth, faults, perform, predict, send_model
from processes import lab


class ExperimentTest(unittest.TestCase):
    def test_no_sample_is_lost_the_estimate_is_within_its_doubt_and_the_loop_is_as_predicted(self):
        for tries_left in (2, 1, 0):
            try:
                return self.measure()
            except RuntimeError as left:  # a machine that stands still loses the link, and with it the mode auto
                if tries_left == 0:
                    raise
                print(f"again: {left}")

    @mock.patch.multiple(experiment, DISTURBANCE_AT_S=1.7, DURATION_S=2.9)
    def measure(self):
        with lab() as place:
            station = place.start_station()
            truth = Truth(place.folder / "truth.csv")
            place.start_robot(station, "sim-1", "--seed", "21", "--truth", truth.path)
            # What steers by the true position beside it says what the loop does without the sensor's errors.
            place.start_robot(station, "known-1", "--sensor", "perfect")
            for name in ("sim-1", "known-1"):
                station.wait_for_robot(name)
            model = send_model(station, "sim-1", processes.BIN / "rheonaut")
            self.assertLessEqual(model["fit_error"], 0.005)
            missed_before = self.missed_ticks(station, "sim-1")
            with concurrent.futures.ThreadPoolExecutor() as both:
                estimated = both.submit(perform, station, "sim-1", truth=truth)
                known = both.submit(perform, station, "known-1")
                run, measures, true = estimated.result()
                _, known_measures, _ = known.result()
            # A busy machine makes the robot miss ticks, which it counts; its status comes once a second.
            processes.wait_until(lambda: run["samples_stored"] + self.missed_ticks(station, "sim-1") >= 290,
                                 60, "every sample due is stored or was missed by the robot")
            # Within which bounds the true position stays depends on when the step meets the sensor's noise: tests/system/paper_test.cpp
            # judges it, in virtual time.
            found = [fault for fault in faults(run, measures, true) if not fault.startswith("true")]
            if self.missed_ticks(station, "sim-1") != missed_before:  # it moved on without control: its way says nothing
                found = [fault for fault in found if "samples" in fault]
            self.assertEqual(found, [])
            self.assertGreater(measures["position_sd_m"], 0)
            self.assertEqual(known_measures["position_sd_m"], 0)
            predicted = predict(processes.BIN / "rheonaut-sim", -1)
            # During a tick that it missed the robot moves on without control; the prediction has none.
            missed = self.missed_ticks(station, "known-1")
            self.assertAlmostEqual(known_measures["settling_s"], predicted["settling_s"], delta=0.0101 + 0.01 * missed)
            self.assertAlmostEqual(known_measures["overshoot_percent"], predicted["overshoot_percent"],
                                   delta=0.05 + 0.05 * missed)

    def missed_ticks(self, station, robot_id):
        status = processes.wait_until(lambda: station.robot(robot_id)["status"], 60, "a status")
        return status["missed_ticks"]

    def test_a_one_way_motor_has_a_controller_that_hardly_overshoots(self):
        predicted = predict(processes.BIN / "rheonaut-sim", 0)
        self.assertAlmostEqual(predicted["settling_s"], 1.77, delta=0.02)
        self.assertAlmostEqual(predicted["overshoot_percent"], 0.71, delta=0.02)
        self.assertAlmostEqual(predicted["disturbance_steady_state_error_m"], -0.00042, delta=0.00002)


if __name__ == "__main__":
    unittest.main()
