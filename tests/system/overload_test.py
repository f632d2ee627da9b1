"""A station that gets less of the processor than its robots need: nothing is hidden, nothing grows without bound,
and it recovers by itself.

First it is measured what the station needs for 20,000 samples/s. Then it gets at most half of that, and half as much
again and again until rings overrun, by being halted (SIGSTOP) for most of each 0.2 s. RHEONAUT_OVERLOAD_S says how long
it goes on so (20 if not given)."""
import json
import os
import pathlib
import signal
import subprocess
import threading
import time
import unittest

from kill_storm_test import ROBOTS, Robots
from processes import BIN, FLEET, lab, wait_until
from recording_audit import audit

OVERLOAD_S = float(os.environ.get("RHEONAUT_OVERLOAD_S", "20"))
PERIOD_S = 0.2
PATIENCE = 12  # seconds with one share of the time until it is halved: rings hold 8
MEASURE_S = 3
MOST_MB = 700  # of a build with sanitizers, whose freed memory counts
MOST_LOG_MB = 128  # of the write-ahead log; a hundred robots hardly write as much, thousands do


def cpu_s(process):
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def peak_mb(process):
    status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def log_mb(place):
    log = place.data / "station.sqlite-wal"
    return log.stat().st_size / (1 << 20) if log.exists() else 0


class Halted:
    """A process that runs for a fraction of the time only."""

    def __init__(self, process, fraction):
        self.process, self.fraction = process, fraction
        self.over = threading.Event()
        self.thread = threading.Thread(target=self._halt_and_go)

    def _halt_and_go(self):
        while not self.over.is_set():
            self.process.send_signal(signal.SIGSTOP)
            self.over.wait(PERIOD_S * (1 - self.fraction))
            self.process.send_signal(signal.SIGCONT)
            self.over.wait(PERIOD_S * self.fraction)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.over.set()
        self.thread.join()
        self.process.send_signal(signal.SIGCONT)


class OverloadTest(unittest.TestCase):
    def test_what_is_sent_is_stored_or_counted_as_lost_at_twice_the_capacity(self):
        with lab(config=FLEET) as place:
            station = place.start_station()
            robots = Robots(station.endpoints["robots"])
            self.addCleanup(lambda: robots.process.poll() is None and robots.kill())
            before_s = cpu_s(place.station_process)
            time.sleep(MEASURE_S)  # the measurement itself
            needed = (cpu_s(place.station_process) - before_s) / MEASURE_S
            longest_log = 0
            # Its loop and its disk thread may run beside each other: a fraction f of the time is up to 2 f cores.
            with Halted(place.station_process, fraction=min(needed / 4, 0.9)) as halted:
                for number, line in enumerate(robots.process.stdout, 1):  # one a second
                    longest_log = max(longest_log, log_mb(place))
                    if json.loads(line)["lost"] > 0:
                        break
                    if number % PATIENCE == 0:
                        halted.fraction /= 2
                end = time.monotonic() + OVERLOAD_S
                while time.monotonic() < end:
                    longest_log = max(longest_log, log_mb(place))
                    time.sleep(0.1)
            peak = peak_mb(place.station_process)

            def has_recovered():
                nonlocal longest_log
                longest_log = max(longest_log, log_mb(place))
                return all(robot["link"] == "connected" and robot["next_seq"] - robot["durable_next_seq"] < 300
                           for robot in station.robots())
            wait_until(has_recovered, 60, "all robots, with what they sent on disk")
            summary = robots.end()
            self.assertEqual(place.stop_station(), 0, place.log("station"))

            self.assertGreater(summary["samples_lost"], 0, "the rings overran: it was more than the station could do")
            self.assertEqual(summary["samples_unsettled"], 0, summary)
            faults, stored, lost = audit(place.data / "station.sqlite")
            self.assertEqual(faults[:10], [])
            # The audit has seen each number once, stored or lost. The summary counts what was made until the robots were
            # told to end; while they settle they make some more.
            self.assertGreaterEqual(stored + lost, summary["samples_made"] - summary["samples_held"])
            self.assertLessEqual(lost, summary["samples_lost"])
            self.assertGreaterEqual(stored, summary["samples_acknowledged"])
            verified = subprocess.run([BIN / "rheonaut", "verify", "--data", place.data], capture_output=True, text=True)
            self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
            self.assertLess(peak, MOST_MB)
            self.assertLessEqual(longest_log, MOST_LOG_MB)
            print(f"{ROBOTS} robots, {needed:.2f} cores needed, {halted.fraction:.3f} of the time given: {stored} samples"
                  f" stored, {lost} lost, {peak:.0f} MB, log of {longest_log:.0f} MB")


if __name__ == "__main__":
    unittest.main()
