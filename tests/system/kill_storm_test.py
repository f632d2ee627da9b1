"""20,000 samples/s from 200 robots, while the station or the robots are killed, or the link is cut, at random.

Every sample is stored once, or is a gap and was overwritten in its robot's ring before it could be acknowledged; the
database is whole. Rings hold 8 s: when several lives of the station in a row are too short for a robot to come back and
be stored, they overrun. RHEONAUT_KILLS says how often (6 if not given; deploy/kill-storm takes 100), RHEONAUT_KILL_SEED
when.
"""
import json
import os
import random
import subprocess
import threading
import time
import unittest

from processes import BIN, lab
from recording_audit import audit

KILLS = int(os.environ.get("RHEONAUT_KILLS", "6"))
SEED = int(os.environ.get("RHEONAUT_KILL_SEED", "1"))
ROBOTS = 200
LONGEST_S = 3  # between two kills
SETTLE_S = 3


class Robots:
    """A fleet in a process of its own, until it is told to end."""

    def __init__(self, address, prefix="sim"):
        self.process = subprocess.Popen([BIN / "rheonaut-sim", "replay", "--station", address, "--robots", str(ROBOTS),
                                         "--id", prefix, "--json"], stdout=subprocess.PIPE, text=True)
        for line in self.process.stdout:  # until all are in, once
            if json.loads(line)["connected"] == ROBOTS:
                return
        raise AssertionError("the robots never were all connected")

    def end(self):
        """Their summary, once everything made is acknowledged."""
        self.process.terminate()
        return json.loads(self.process.communicate(timeout=60)[0].splitlines()[-1])

    def kill(self):
        self.process.kill()
        self.process.communicate()


class KillStormTest(unittest.TestCase):
    def setUp(self):
        self.random = random.Random(SEED)
        self.robots = None
        self.addCleanup(lambda: self.robots and self.robots.process.poll() is None and self.robots.kill())

    def wait(self):
        time.sleep(self.random.uniform(0.1, LONGEST_S))  # the moment of a kill is the input of this test

    def check(self, place, summary):
        self.assertEqual(place.stop_station(timeout_s=60), 0, place.log("station"))
        faults, stored, lost = audit(place.data / "station.sqlite")
        self.assertEqual(faults[:10], [])
        self.assertEqual(summary["samples_unsettled"], 0, summary)
        self.assertLessEqual(lost, summary["samples_lost"], "what no ring gave up is not lost")
        self.assertGreaterEqual(stored + lost, summary["samples_made"] - summary["samples_held"], "nothing is hidden")
        self.assertGreaterEqual(stored, summary["samples_acknowledged"])
        print(f"seed {SEED}: {KILLS} times, {stored} samples stored, {lost} lost, {summary['samples_resent']} sent again,"
              f" {summary['reconnects']} reconnections")

    def test_the_station_is_killed(self):
        with lab() as place:
            ports = place.start_station().endpoints
            self.robots = Robots(ports["robots"])
            for _ in range(KILLS):
                self.wait()
                place.kill_station()
                place.start_station(http=ports["http"], robots=ports["robots"])
            time.sleep(SETTLE_S)
            self.check(place, self.robots.end())

    def test_the_robots_are_killed(self):
        with lab() as place:
            ports = place.start_station().endpoints
            for _ in range(KILLS):
                self.robots = Robots(ports["robots"])
                self.wait()
                self.robots.kill()
            self.robots = Robots(ports["robots"])
            self.check(place, self.robots.end())

    def test_the_link_is_cut_within_frames(self):
        with lab() as place:
            ports = place.start_station().endpoints
            proxy = subprocess.Popen([BIN / "rheonaut-sim", "proxy", "--to", ports["robots"], "--split", "700"],
                                     stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            self.addCleanup(proxy.wait)
            self.addCleanup(proxy.terminate)
            address = proxy.stdout.readline().split()[-1]
            threading.Thread(target=proxy.stdout.read, daemon=True).start()  # or it would wait for its reader
            self.robots = Robots(address)
            for _ in range(KILLS):
                self.wait()
                word = self.random.choice([f"cut {self.random.randint(0, 400)}", "reset"])
                proxy.stdin.write(word + "\n")
                proxy.stdin.flush()
            time.sleep(SETTLE_S)
            self.check(place, self.robots.end())


if __name__ == "__main__":
    unittest.main()
