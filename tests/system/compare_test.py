#!/usr/bin/env python3
"""`deploy/compare --quick` with real stations: each that is installed stores every sample that robots sent it, and stops one.

Rheonaut and the station in Python always run; those in Node and behind mosquitto where they are installed.
"""
import os
import pathlib
import signal
import subprocess
import sys
import unittest

from processes import BIN, ROOT


class Compare(unittest.TestCase):
    def test_each_station_stores_what_was_sent(self):
        running = subprocess.Popen([sys.executable, str(ROOT / "deploy" / "compare"), str(BIN), "--quick"], text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            said, _ = running.communicate(timeout=240)
        finally:
            if running.poll() is None:  # with the stations and robots that it started
                os.killpg(running.pid, signal.SIGKILL)
                running.wait()
        self.assertEqual(running.returncode, 0, said)
        rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in said.splitlines() if line.startswith("| ")]
        recorded = {row[0]: row[-1].split(", ") for row in rows if " µs" in row[1]}
        left_out = {row[0] for row in rows if row[1] == "not installed: left out"}
        self.assertEqual(set(recorded) | left_out, {"Rheonaut", "Node, SQLite", "Python, SQLite", "mosquitto, SQLite"}, said)
        self.assertLessEqual({"Rheonaut", "Python, SQLite"}, set(recorded), said)
        for station, (sent, lost) in recorded.items():
            self.assertGreater(int(sent.replace(",", "")), 0, station)
            self.assertEqual(lost, "0", station)
        stops = {row[0]: row[1] for row in rows if row[-1].endswith(" ms")}
        self.assertEqual(set(stops), set(recorded), said)
        self.assertEqual(pathlib.Path(ROOT / "docs" / "comparison.md").read_text(encoding="utf-8").count("measured: comparison"), 1)


if __name__ == "__main__":
    unittest.main()
