"""Attacks on a real station by a program beside it: a robot is stopped all the while, over open and new connections."""
import http.client
import json
import os
import re
import resource
import socket
import subprocess
import sys
import threading
import time
import unittest

from hostile_clients import ATTACKS
from processes import ROOT, lab, wait_until

STOP = "/api/v1/robots/sim-1/emergency-stop"
LONGEST_S = 2.0  # of one stop here, in a build with sanitizers; tests/bench/stop_bench --hostile measures them


class Standstill:
    """How long this machine has kept a program from running that wanted to, at most."""
    LOOK_S = 0.02

    def __init__(self):
        self.longest_s = 0
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.watch)

    def watch(self):
        while not self.over.is_set():
            begun = time.monotonic()
            time.sleep(self.LOOK_S)
            self.longest_s = max(self.longest_s, time.monotonic() - begun - self.LOOK_S)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.over.set()
        self.thread.join()


class HostileTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab())
        self.station = self.place.start_station()
        self.place.start_robot(self.station, "sim-1")
        self.station.wait_for_robot("sim-1")
        host, port = self.station.endpoints["http"].rsplit(":", 1)
        self.operator = http.client.HTTPConnection(host, int(port), timeout=60)
        self.addCleanup(self.operator.close)
        self.stop_on_the_open_connection()

    def attack(self, *names):
        """Starts these, and waits until they are in full swing."""
        program = [sys.executable, "-B", str(ROOT / "tests/system/hostile_clients.py"),
                   self.station.endpoints["http"], self.station.endpoints["robots"], self.station.token, *names]
        process = subprocess.Popen(program, stdout=subprocess.PIPE, text=True)

        def end():
            process.kill()
            process.wait()
            process.stdout.close()
        self.addCleanup(end)
        begun = {process.stdout.readline().strip() for _ in names}
        self.assertEqual(begun, set(names))

    def stop_on_the_open_connection(self):
        headers = {"Authorization": f"Bearer {self.station.token}", "Content-Length": "0"}
        self.operator.request("POST", STOP, headers=headers)
        self.expect_stopped(json.loads(self.operator.getresponse().read()))

    def stop_on_a_new_connection(self):
        self.expect_stopped(self.station.post(STOP))

    def expect_stopped(self, record):
        self.assertIn(record["state"], ("acknowledged", "verified"), record)

    def expect_stops(self, seconds):
        end = time.monotonic() + seconds
        slowest = 0
        with Standstill() as machine:
            while time.monotonic() < end:
                for stop in (self.stop_on_the_open_connection, self.stop_on_a_new_connection):
                    begun = time.monotonic()
                    stop()
                    slowest = max(slowest, time.monotonic() - begun)
                time.sleep(0.1)
        # A stop passes this program, the station and the robot, there and back: each may have stood still so long.
        self.assertLess(slowest, LONGEST_S + 5 * machine.longest_s)
        print(f"slowest stop {1000 * slowest:.0f} ms, the machine stood still for {1000 * machine.longest_s:.0f} ms",
              file=sys.stderr)

    def metric(self, name):
        def answered():  # a question may give its place to another one
            status, _, body = self.station.request("GET", "/metrics")
            return body if status == 200 else None
        text = wait_until(answered, 60, "the metrics")
        return int(re.search(rf"^rheonaut_{name} (\d+)$", text.decode(), re.M).group(1))

    def test_slowloris(self):
        self.attack("slowloris")
        self.expect_stops(3)
        wait_until(lambda: self.metric("http_connections") >= 100, 60, "a hundred drips")
        self.expect_stops(9)  # all of them are ended once, and come again
        said = [line for line in self.place.log("station").splitlines() if "emergency stop" not in line]
        self.assertLess(len(said), 40, "they fill no log")

    def test_a_thousand_idle_connections_on_each_port(self):
        self.attack("idle")
        self.expect_stops(3)
        self.assertLessEqual(self.metric("http_connections"), 256 + 16 + 512)
        wait_until(lambda: self.metric("http_connections_replaced_total") >= 700, 60, "the port replaces them")
        self.place.start_robot(self.station, "sim-2")
        self.station.wait_for_robot("sim-2")
        wait_until(lambda: self.metric("robot_connections") >= 500, 60, "the robots' port holds them, too")

    def test_bad_logins(self):
        self.attack("logins")
        self.expect_stops(3)

    def test_oversized_and_deeply_nested_json(self):
        self.attack("json")
        self.expect_stops(3)

    def test_giant_and_broken_frames(self):
        begun = time.monotonic()
        self.attack("frames")
        self.expect_stops(3)
        lines = [line for line in self.place.log("station").splitlines() if "was not let in" in line]
        self.assertTrue(lines)
        self.assertLess(len(lines), max(15, time.monotonic() - begun + 2), "one a second at most")

    def test_questions_that_wait(self):
        self.attack("polls")
        wait_until(lambda: self.metric("http_connections") >= 250, 60, "they take all places")
        self.expect_stops(3)
        status, _, _ = self.station.request("GET", "/healthz")
        self.assertEqual(status, 200)
        self.assertGreater(self.metric("http_connections_replaced_total"), 0)

    def test_questions_about_what_has_ended_on_a_busy_computer(self):
        """Each is a question to the database's reader, which is slower than those who ask and are ended."""
        self.attack("polls")
        path = "/api/v1/experiments/1/abort"  # of the one that they ask for
        wait_until(lambda: self.station.request("POST", path, {})[0] in (200, 409), 60, "its end")
        for _ in range(2):
            loop = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            self.addCleanup(loop.wait)
            self.addCleanup(loop.kill)
        self.expect_stops(3)

    def test_without_a_descriptor_left(self):
        resource.prlimit(self.place.station_process.pid, resource.RLIMIT_NOFILE, (64, 64))
        host, port = self.station.endpoints["http"].rsplit(":", 1)
        for _ in range(100):
            self.addCleanup(socket.create_connection((host, int(port))).close)
        self.expect_stops(3)
        status, _, _ = self.station.request("GET", "/healthz")
        self.assertEqual(status, 200)

    def test_without_any_descriptor(self):
        """Nothing can be opened, not even by what looks at the database now and then."""
        station = self.place.station_process.pid
        opened = len(os.listdir(f"/proc/{station}/fd"))
        resource.prlimit(station, resource.RLIMIT_NOFILE, (opened, opened))

        def has_failed():
            self.stop_on_the_open_connection()
            return "the head of the database is not written" in self.place.log("station")
        wait_until(has_failed, 60, "the next look at the database")
        self.stop_on_the_open_connection()

    def test_pages_that_never_read(self):
        self.attack("silent_pages")
        self.expect_stops(3)

    def test_everything_at_once(self):
        self.attack(*ATTACKS)
        self.expect_stops(6)
        self.assertEqual(self.station.robot("sim-1")["link"], "connected")
        self.assertEqual(self.place.stop_station(), 0, "and it ends in order")


if __name__ == "__main__":
    unittest.main()
