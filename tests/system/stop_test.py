"""`rheonaut stop` with a running station and simulated robots: confirmed, not confirmed, and no station to ask."""
import concurrent.futures
import json
import signal
import subprocess
import time
import unittest

from processes import BIN, lab, swimming, wait_until


class StopTest(unittest.TestCase):
    def stop(self, place, *words):
        """Without an input: a stop asks nothing."""
        done = subprocess.run([str(BIN / "rheonaut"), "stop", *words, "--data", str(place.data)], capture_output=True,
                              text=True, timeout=120, stdin=subprocess.DEVNULL)
        return done

    def stop_with(self, place, status, *words):
        """Two more times at most: a machine that stands still may keep a robot from confirming in time."""
        for _ in range(3):
            done = self.stop(place, *words)
            if done.returncode == status:
                return done
        raise AssertionError(done)

    def moving(self, place, *robots):
        station = place.start_station()
        processes = {}
        for robot in robots:
            processes[robot] = place.start_robot(station, robot)
            station.wait_for_robot(robot)
            swimming(station, robot)
        return station, processes

    def assert_latched(self, station, robot):
        def latched():
            seen = station.robot(robot)
            return seen["mode"] == "emergency" and seen["emergency_id"] and seen["sample"]["duty"] == 0.0
        wait_until(latched, 60, f"emergency of {robot} in telemetry, with duty 0")

    def test_one_robot_and_then_all(self):
        with lab() as place:
            station, _ = self.moving(place, "sim-1", "sim-2")
            begun = time.monotonic()
            one = self.stop_with(place, 0, "sim-1", "--json")
            took_ms = (time.monotonic() - begun) * 1000
            self.assertEqual(one.stderr, "")
            answer = json.loads(one.stdout)
            self.assertEqual((answer["confirmed"], answer["not_confirmed"]), (1, 0))
            robot = answer["robots"][0]
            self.assertEqual((robot["robot_id"], robot["confirmed"]), ("sim-1", True))
            self.assertIn(robot["state"], ("acknowledged", "verified"))
            self.assertGreater(robot["acknowledged_after_us"], 0)
            print(f"from exec to the confirmation: {took_ms:.0f} ms", flush=True)
            self.assert_latched(station, "sim-1")
            self.assertEqual(station.robot("sim-2")["mode"], "auto", "the other robot swims on")

            everyone = self.stop_with(place, 0)
            self.assertEqual(everyone.stderr, "")
            for line in ("sim-1", "sim-2"):
                self.assertRegex(everyone.stdout, rf"(?m)^{line}  stopped: the robot confirmed after \d+\.\d ms$")
            self.assertRegex(everyone.stdout, r"(?m)^2 of 2 robots confirmed; the station answered after \d+ ms$")
            self.assert_latched(station, "sim-2")
            self.stop_with(place, 0, "--all")

    def test_a_silent_robot_is_not_confirmed_and_holds_up_no_other(self):
        with lab(config=None) as place:
            station, processes = self.moving(place, "sim-1", "sim-2")
            processes["sim-1"].send_signal(signal.SIGSTOP)
            try:
                for words in (("sim-1", "sim-2"), ("--all",)):
                    said = wait_until(lambda: "1 of 2 robots" in (done := self.stop_with(place, 5, *words)).stdout
                                      and done.stdout, 60, "sim-2 confirms")
                    self.assertRegex(said, r"(?m)^sim-1  NOT CONFIRMED$")
                    self.assertRegex(said, r"(?m)^sim-1: it ")
                    self.assertRegex(said, r"(?m)^sim-2  stopped: the robot confirmed after ")
                wait_until(lambda: station.robot("sim-1")["link"] == "disconnected", 60, "the link is lost")
                wait_until(lambda: "it is not connected; the stop is kept" in self.stop(place, "sim-1").stdout, 60, "why")
                words = ("sim-1", "sim-9", "sim-2", "--json")
                said = wait_until(lambda: (answer := json.loads(self.stop_with(place, 5, *words).stdout))["confirmed"]
                                  and answer, 60, "a name that is not known keeps no other from stopping")
                robots = {robot["robot_id"]: robot for robot in said["robots"]}
                self.assertTrue(robots["sim-2"]["confirmed"])
                self.assertFalse(robots["sim-9"]["confirmed"])
                self.assertIn("sim-9", robots["sim-9"]["detail"])
            finally:
                processes["sim-1"].send_signal(signal.SIGCONT)
            self.assert_latched(station, "sim-1")

    def test_without_an_answer_of_the_station_it_ends_and_says_what_is_known(self):
        with lab() as place:
            missing = self.stop(place)
            self.assertEqual((missing.returncode, missing.stdout), (1, ""))
            station, _ = self.moving(place, "sim-1")
            place.station_process.send_signal(signal.SIGSTOP)
            try:
                with concurrent.futures.ThreadPoolExecutor() as both:
                    answers = both.map(lambda words: self.stop(place, words), ("sim-1", "--all"))
                for hung in answers:
                    self.assertEqual((hung.returncode, hung.stdout), (1, ""))
                    self.assertRegex(hung.stderr, r"^rheonaut: IT IS NOT KNOWN whether .* has not answered within 7 s\n$")
            finally:
                place.station_process.send_signal(signal.SIGCONT)
            # The request had arrived: the robot is stopped once the station runs again.
            self.assert_latched(station, "sim-1")
            place.kill_station()
            dead = self.stop(place, "sim-1")
            self.assertEqual((dead.returncode, dead.stdout), (1, ""))
            self.assertRegex(dead.stderr, r"^rheonaut: NOTHING WAS STOPPED by this command: switch the robots off by hand; "
                                          r"the station on \S+ does not answer: nothing listens there\n$")


if __name__ == "__main__":
    unittest.main()
