"""20,000 samples/s from 200 robots, while the station or the robots are killed, or the link is cut, at random; once
more with a disk that is full each time (a small one in memory, in a mount namespace of this program alone), and once with
a disk whose writes and syncs fail and are slow (failing_disk.c), beside two busy loops.

Every sample is stored once, or is a gap and was overwritten in its robot's ring before it could be acknowledged; the
database is whole. A run is under way at three kills of four, and `rheonaut verify` finds every certificate right. Rings
hold 8 s: when several lives of the station in a row are too short for a robot to come back and be stored, they overrun.
RHEONAUT_KILLS says how often (6 if not given; deploy/kill-storm takes 100), RHEONAUT_KILL_SEED when, RHEONAUT_LIVES how
many stores the failing disk gets, each with 6 to 14 kills (1 with RHEONAUT_KILLS if not given).
"""
import contextlib
import errno
import json
import mmap
import os
import pathlib
import random
import shutil
import sqlite3
import struct
import subprocess
import sys
import threading
import time
import unittest

from processes import BIN, FLEET, ApiError, Station, lab, wait_until
from recording_audit import audit, outside_ledger

KILLS = int(os.environ.get("RHEONAUT_KILLS", "6"))
SEED = int(os.environ.get("RHEONAUT_KILL_SEED", "1"))
ROBOTS = int(os.environ.get("RHEONAUT_STORM_ROBOTS", 200))
LONGEST_S = 3  # between two kills
SETTLE_S = 3
LIVES = int(os.environ.get("RHEONAUT_LIVES", "0"))
FAILING_ROBOTS = min(ROBOTS, 60)
SMALL_DISK = "RHEONAUT_SMALL_DISK"  # this program runs in its own mount namespace: the folder of the disk


class Robots:
    """A fleet in a process of its own, until it is told to end."""

    def __init__(self, address, ledger=None, number=ROBOTS):
        self.number = number
        self.process = subprocess.Popen([BIN / "rheonaut-sim", "replay", "--station", address, "--robots", str(number),
                                         "--json", *(["--ledger", ledger] if ledger else [])], stdout=subprocess.PIPE, text=True)
        self.last_line = ""
        self.all_in = threading.Event()
        self.listener = threading.Thread(target=self.listen)
        self.listener.start()
        if not self.all_in.wait(60):
            self.kill()
            raise AssertionError("the robots never were all connected")

    def listen(self):
        """To the end: a fleet whose lines nobody takes stands still once the pipe is full."""
        for line in self.process.stdout:
            self.last_line = line
            if json.loads(line).get("connected") == self.number:
                self.all_in.set()

    def held(self):
        """Samples that are not acknowledged yet, a second ago at most."""
        return json.loads(self.last_line)["held"]

    def end(self):
        """Their summary, once everything made is acknowledged."""
        self.process.terminate()
        self.process.wait(timeout=60)
        self.listener.join()
        self.process.stdout.close()
        return json.loads(self.last_line)

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.listener.join()
        self.process.stdout.close()


def stops_the_swimmer(station):
    with contextlib.suppress(ApiError, OSError):
        return station.post("/api/v1/robots/swimmer/emergency-stop")["state"] == "acknowledged"


def fill(path):
    """Takes the rest of the disk."""
    with contextlib.suppress(OSError), open(path, "ab", buffering=0) as file:
        while True:
            file.write(bytes(1 << 16))


def enter_small_disk():
    """This program once more, with a disk of its own to fill. Returns where that is not possible."""
    if SMALL_DISK in os.environ or subprocess.run(["unshare", "-rm", "true"], stderr=subprocess.DEVNULL).returncode:
        return
    folder = pathlib.Path(os.environ.get("TMPDIR", "/tmp")) / f"rheonaut-disk-{os.getpid()}"
    folder.mkdir()
    size_mb = 1000 + 20 * KILLS  # a station begins runs only with 512 MB to spare
    mount_and_run = 'mount -t tmpfs -o size="$1"m tmpfs "$2" && shift 2 && exec "$@"'
    code = subprocess.run(["unshare", "-rm", "sh", "-c", mount_and_run, "sh", str(size_mb), str(folder), sys.executable,
                           "-B", *sys.argv], env=os.environ | {SMALL_DISK: str(folder)}).returncode
    shutil.rmtree(folder)
    sys.exit(code)


class FailingDisk:
    """The data folder of this lab on a disk that fails as it is told; stations that are started in it are on it."""

    def __init__(self, place):
        self.path = place.folder / "faults"
        self.path.write_bytes(bytes(20))
        with open(self.path, "r+b") as file:
            self.words = mmap.mmap(file.fileno(), 20)
        self.environment = {"LD_PRELOAD": str(BIN / "failing_disk.so"), "RHEONAUT_DISK_FOLDER": str(place.data),
                            "RHEONAUT_DISK_FAULTS": str(self.path)}
        sanitizers = os.environ.get("ASAN_OPTIONS", "")  # this library comes before theirs
        self.environment["ASAN_OPTIONS"] = sanitizers + ":verify_asan_link_order=0"

    def set(self, write_error=0, sync_error=0, sync_delay_ms=0, percent=100):
        self.words[:16] = struct.pack("4i", write_error, sync_error, sync_delay_ms, percent)

    def failed(self):
        return struct.unpack("5i", self.words[:])[4]


class KillStormTest(unittest.TestCase):
    def setUp(self):
        self.random = random.Random(SEED)
        self.robots = None
        self.runs_begun = 0
        self.addCleanup(lambda: self.robots and self.robots.process.poll() is None and self.robots.kill())

    def wait(self):
        time.sleep(self.random.uniform(0.1, LONGEST_S))  # the moment of a kill is the input of this test

    def begin_run(self, place):
        """Of a robot that is there and has none; one time in four none at all, so that a kill may come before any
        robot is back."""
        if self.runs_begun > 0 and self.random.random() < 0.25:
            return
        pick = self.random.randint(0, ROBOTS)

        def has_begun():
            nonlocal pick
            pick += 1
            with contextlib.suppress(ApiError, OSError):
                station = Station(place.data)
                there = [robot["robot_id"] for robot in station.robots()
                         if robot["link"] == "connected" and robot["robot_id"].startswith("sim-")]
                return there and station.post("/api/v1/runs", {"robot_id": there[pick % len(there)], "name": "storm"})
        wait_until(has_begun, 60, "a run of a robot that is there")
        self.runs_begun += 1

    def check(self, place, summary, causes=("ring_overrun",)):
        """Of samples that are lost for one of these causes only."""
        self.assertEqual(summary["samples_unsettled"], 0, summary)
        station = Station(place.data)
        runs = station.get("/api/v1/runs?limit=1000")["runs"]
        for run in runs:
            if run["state"] == "open":
                station.post(f"/api/v1/runs/{run['run_id']}/end")
        wait_until(lambda: all(station.get(f"/api/v1/runs/{run['run_id']}/certificate")["final"] for run in runs), 120,
                   "the certificates")
        self.assertEqual(place.stop_station(), 0, place.log("station"))
        verified = subprocess.run([BIN / "rheonaut", "verify", "--data", place.data, "--json"], capture_output=True,
                                  text=True)
        self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
        findings = json.loads(verified.stdout)
        self.assertEqual(findings["runs_verified"], len(runs))
        self.assertEqual(len(runs), self.runs_begun)
        faults, stored, lost = audit(place.data / "station.sqlite")
        self.assertEqual(faults[:10], [])
        self.assertEqual(outside_ledger(place.data / "station.sqlite", place.folder / "ledger"), [])
        with contextlib.closing(sqlite3.connect(place.data / "station.sqlite")) as database:
            self.assertLessEqual({cause for cause, in database.execute("SELECT DISTINCT cause FROM gap")}, set(causes))
        self.assertLessEqual(lost, summary["samples_lost"], "what no ring gave up is not lost")
        self.assertGreaterEqual(stored + lost, summary["samples_made"] - summary["samples_held"], "nothing is hidden")
        self.assertGreaterEqual(stored, summary["samples_acknowledged"])
        print(f"seed {SEED}: {KILLS} times, {stored} samples stored, {lost} lost, {summary['samples_resent']} sent again,"
              f" {summary['reconnects']} reconnections, {findings['runs_verified']} runs verified")

    def test_the_station_is_killed(self):
        with lab(config=FLEET) as place:
            ports = place.start_station().endpoints
            self.robots = Robots(ports["robots"], place.folder / "ledger")
            for _ in range(KILLS):
                self.begin_run(place)
                self.wait()
                place.kill_station()
                place.start_station(http=ports["http"], robots=ports["robots"])
            time.sleep(SETTLE_S)
            self.check(place, self.robots.end())

    @unittest.skipIf(SMALL_DISK not in os.environ, "needs a small disk: `unshare -rm` is not possible here")
    def test_the_station_is_killed_while_the_disk_is_full(self):
        filler = pathlib.Path(os.environ[SMALL_DISK]) / "filler"
        with lab(os.environ[SMALL_DISK], FLEET) as place:
            station = place.start_station()
            ports = station.endpoints
            self.robots = Robots(ports["robots"], place.folder / "ledger")
            place.start_robot(station, "swimmer")
            for _ in range(KILLS):
                self.begin_run(place)
                self.wait()
                wait_until((place.data / "rheonaut.reserve").exists, 60, "room that is held for the next start")
                fill(filler)
                self.wait()
                place.kill_station()
                fill(filler)  # what the station gave back when it died
                place.start_unannounced(ports["http"], ports["robots"])
                station = Station(place.data, endpoints=ports)
                wait_until(lambda: stops_the_swimmer(station), 60, "a robot that is stopped on a full disk")
                filler.unlink()
                wait_until(lambda: station.get("/api/v1/recording")["state"] != "failing", 60, "recording again")
            time.sleep(SETTLE_S)
            self.check(place, self.robots.end())

    def disturb(self, disk):
        """Some trouble of the disk, one after the other, for some seconds."""
        for _ in range(self.random.randint(1, 3)):
            disk.set(**self.random.choice([
                {}, {"write_error": errno.EIO}, {"write_error": errno.ENOSPC}, {"sync_error": errno.EIO},
                {"sync_delay_ms": self.random.randint(50, 1500)}, {"write_error": errno.EIO, "percent": 20},
                {"write_error": errno.ENOSPC, "sync_delay_ms": 300, "percent": 50},
                {"sync_error": errno.EIO, "sync_delay_ms": 200, "percent": 50}]))
            self.wait()

    def live_on_a_failing_disk(self, kills):
        self.runs_begun = 0
        with lab(config=FLEET) as place:
            ports = place.start_station().endpoints  # which is then one that says where it is
            place.kill_station()
            disk = FailingDisk(place)

            def start():
                place.start_unannounced(ports["http"], ports["robots"], environment=disk.environment)

            def is_up():
                if place.station_process.poll() is not None:  # a disk that fails in the start may refuse it
                    disk.set()
                    start()
                with contextlib.suppress(ApiError, OSError):
                    return Station(place.data, endpoints=ports).get("/healthz")
            start()
            wait_until(is_up, 60, "a station on this disk")
            self.robots = Robots(ports["robots"], place.folder / "ledger", FAILING_ROBOTS)
            self.begin_run(place)
            for _ in range(kills):
                self.disturb(disk)
                place.kill_station()
                if self.random.random() < 0.5:
                    disk.set()
                start()
                wait_until(is_up, 60, "a station on this disk again")
            disk.set()
            station = Station(place.data, endpoints=ports)
            wait_until(lambda: station.get("/api/v1/recording")["state"] != "failing", 60, "recording again")
            wait_until(lambda: self.robots.held() < 150 * FAILING_ROBOTS, 120, "robots that have sent what they held")
            time.sleep(SETTLE_S)
            print(f"a disk of which {disk.failed()} calls failed, {kills} kills")
            self.assertGreater(disk.failed(), 0, "the disk failed")
            self.check(place, self.robots.end())

    def test_the_station_is_killed_while_the_disk_fails(self):
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
        for loop in busy:
            self.addCleanup(loop.wait)
            self.addCleanup(loop.kill)
        for _ in range(max(LIVES, 1)):
            self.live_on_a_failing_disk(self.random.randint(6, 14) if LIVES else min(KILLS, 4))

    def test_the_robots_are_killed(self):
        with lab(config=FLEET) as place:
            ports = place.start_station().endpoints
            for _ in range(KILLS):
                self.robots = Robots(ports["robots"], place.folder / "ledger")
                self.begin_run(place)
                self.wait()
                self.robots.kill()
            self.robots = Robots(ports["robots"], place.folder / "ledger")
            self.check(place, self.robots.end(), ("ring_overrun", "reboot"))

    def test_the_link_is_cut_within_frames(self):
        with lab(config=FLEET) as place:
            ports = place.start_station().endpoints
            proxy = subprocess.Popen([BIN / "rheonaut-sim", "proxy", "--to", ports["robots"], "--split", "700"],
                                     stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            self.addCleanup(proxy.wait)
            self.addCleanup(proxy.terminate)
            address = proxy.stdout.readline().split()[-1]
            threading.Thread(target=proxy.stdout.read, daemon=True).start()  # or it would wait for its reader
            self.robots = Robots(address, place.folder / "ledger")
            for _ in range(KILLS):
                self.begin_run(place)
                self.wait()
                word = self.random.choice([f"cut {self.random.randint(0, 400)}", "reset"])
                proxy.stdin.write(word + "\n")
                proxy.stdin.flush()
            time.sleep(SETTLE_S)
            self.check(place, self.robots.end())


if __name__ == "__main__":
    enter_small_disk()
    unittest.main()
