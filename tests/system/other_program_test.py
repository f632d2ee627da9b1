"""Another program opens the database of a running station, with the right to write, and closes it again: the write-ahead log
stays the station's, and what it has acknowledged survives its death. Or somebody takes the files away from under it."""
import contextlib
import os
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import unittest

from processes import PATIENCE_S, lab, wait_until
from recording_audit import audit

LOOK = "import sqlite3, sys; file = sqlite3.connect(sys.argv[1]); print(file.execute('SELECT count(*) FROM sample').fetchone()[0]); file.close()"


def samples_in(path):
    with contextlib.closing(sqlite3.connect(path)) as database:
        return database.execute("SELECT count(*) FROM sample").fetchone()[0]


def remove(path):
    path.unlink()


def rename(path):
    path.rename(f"{path}.elsewhere")


def replace(path):
    shutil.copy(path, f"{path}.copy")
    os.replace(f"{path}.copy", path)


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
            self.assertGreaterEqual(samples_in(station.database), durable, "what robots know as durable is there after kill -9")
            self.assertEqual(audit(station.database)[0], [])

    def end(self, place, how):
        if how == "killed":
            place.kill_station()
        else:
            place.stop_station()

    def test_the_database_is_taken_away(self):
        for take, how in (remove, "killed"), (replace, "killed"), (rename, "stopped"):
            with self.subTest(taken=take.__name__, then=how), lab() as place:
                station = place.start_station()
                place.start_robot(station)
                station.wait_for_robot("sim-1", PATIENCE_S)
                self.wait_for_durable(station, 200)
                take(pathlib.Path(station.database))
                recording = wait_until(lambda: station.get("/api/v1/recording")["state"] == "failing" and
                                       station.get("/api/v1/recording"), PATIENCE_S, "a station that has noticed")
                self.assertIn("removed, renamed or replaced", recording["problem"])
                self.assertIn("station.kept", recording["problem"])
                acknowledged = station.robot("sim-1")["durable_next_seq"]
                seen = station.robot("sim-1")["next_seq"]
                wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 300, PATIENCE_S, "live values go on")
                self.assertEqual(station.robot("sim-1")["durable_next_seq"], acknowledged, "nothing is acknowledged")
                station.post("/api/v1/robots/sim-1/emergency-stop")
                wait_until(lambda: station.robot("sim-1")["mode"] == "emergency", PATIENCE_S, "a robot that is stopped")
                self.end(place, how)
                place.start_station()
                self.assertIn("station.kept-1", place.log("station"), "the next start names what is there")
                self.assertGreaterEqual(samples_in(place.data / "station.kept-1" / "station.sqlite"), acknowledged)

    def test_the_log_or_its_index_is_taken_away(self):
        for ending, take, how in (("-wal", remove, "killed"), ("-wal", replace, "stopped"), ("-shm", rename, "killed")):
            with self.subTest(file=ending, taken=take.__name__, then=how), lab() as place:
                station = place.start_station()
                place.start_robot(station)
                station.wait_for_robot("sim-1", PATIENCE_S)
                durable = self.wait_for_durable(station, 200)
                take(pathlib.Path(f"{station.database}{ending}"))
                durable = self.wait_for_durable(station, durable + 300)
                self.assertIn(f"{ending} was removed, renamed or replaced", place.log("station"))
                durable = self.wait_for_durable(station, durable + 300)
                self.end(place, how)
                self.assertGreaterEqual(samples_in(station.database), durable)
                self.assertEqual(audit(station.database)[0], [])
                place.start_station()
                self.assertFalse((place.data / "station.kept-1").exists(), "nothing is missing in the database")


if __name__ == "__main__":
    unittest.main()
