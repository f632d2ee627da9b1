"""Another program opens the database of a running station, with the right to write, and closes it again: the write-ahead log
stays the station's, and what it has acknowledged survives its death."""
import contextlib
import sqlite3
import subprocess
import sys
import unittest

from processes import PATIENCE_S, lab, wait_until
from recording_audit import audit

LOOK = "import sqlite3, sys; file = sqlite3.connect(sys.argv[1]); print(file.execute('SELECT count(*) FROM sample').fetchone()[0]); file.close()"


class OtherProgramTest(unittest.TestCase):
    def look(self, station):
        """As a tool for SQLite does it, in a process of its own; the samples that it counts."""
        done = subprocess.run([sys.executable, "-c", LOOK, station.database], capture_output=True, text=True, check=True)
        return int(done.stdout)

    def wait_for_durable(self, station, count):
        wait_until(lambda: station.robot("sim-1")["durable_next_seq"] >= count, PATIENCE_S, f"{count} samples on disk")
        return station.robot("sim-1")["durable_next_seq"]

    def test_it_takes_no_commit_from_the_station(self):
        with lab() as place:
            station = place.start_station()
            robot = place.start_robot(station)
            station.wait_for_robot("sim-1", PATIENCE_S)
            durable = self.wait_for_durable(station, 100)
            self.assertGreaterEqual(self.look(station), durable)
            durable = self.wait_for_durable(station, durable + 200)
            self.assertGreaterEqual(self.look(station), durable, "it sees what the station has committed since")
            durable = self.wait_for_durable(station, durable + 200)
            robot.kill()
            robot.wait()
            place.kill_station()
            with contextlib.closing(sqlite3.connect(station.database)) as database:
                kept = database.execute("SELECT count(*) FROM sample").fetchone()[0]
            self.assertGreaterEqual(kept, durable, "what robots know as durable is there after kill -9")
            self.assertEqual(audit(station.database)[0], [])


if __name__ == "__main__":
    unittest.main()
