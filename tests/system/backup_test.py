"""A live station is backed up, the backup restored, and the robot goes on with the restored station."""
import contextlib
import fcntl
import os
import pathlib
import resource
import signal
import sqlite3
import subprocess
import time
import unittest

from processes import BIN, PATIENCE_S, child_of, has_ended, lab, wait_until


def tool(*arguments):
    """(exit status, output, error) of `rheonaut` with these arguments."""
    done = subprocess.run([str(BIN / "rheonaut"), *map(str, arguments)], capture_output=True, text=True, timeout=120)
    return done.returncode, done.stdout, done.stderr


def samples(database, run_id):
    """What is read in place without a file made beside it."""
    with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
        return connection.execute("SELECT boot_id, seq, position_m, utc_us FROM run_sample WHERE run_id = ?"
                                  " ORDER BY span, seq", (run_id,)).fetchall()


class BackupTest(unittest.TestCase):
    def record_a_run(self, place, station):
        place.start_robot(station)
        station.wait_for_robot("sim-1")
        run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "kept"})["run_id"]
        seen = station.robot("sim-1")["next_seq"]
        wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 150, 60, "150 samples")
        station.post(f"/api/v1/runs/{run_id}/end")
        return run_id

    def test_a_backup_of_a_live_station_becomes_a_station(self):
        with lab() as place:
            station = place.start_station()
            run_id = self.record_a_run(place, station)
            copy = place.folder / "copy.sqlite"
            status, out, error = tool("backup", "--data", place.data, "--to", copy)
            self.assertEqual((status, error), (0, ""))
            self.assertIn("verified", out)
            self.assertEqual(list((place.data / "backups").iterdir()), [], "it was moved")
            recorded = samples(station.database, run_id)
            self.assertGreater(len(recorded), 150)
            self.assertEqual(samples(copy, run_id), recorded)
            self.assertEqual([path.name for path in place.folder.glob("copy.*")], ["copy.sqlite"])

            status, _, error = tool("restore", "--from", copy, "--data", place.data)
            self.assertEqual(status, 1)
            self.assertIn(f"rheonaut serve (pid {place.station_process.pid}) uses '{place.data}'; stop it first", error)
            ports = station.endpoints
            before = station.get("/api/v1/station")["store_id"]
            self.assertEqual(place.stop_station(), 0)
            status, _, error = tool("restore", "--from", copy, "--data", place.data)
            self.assertEqual(status, 1)
            self.assertIn("station.sqlite' is there", error)

            place.data = place.folder / "restored"
            status, out, error = tool("restore", "--from", copy, "--data", place.data)
            self.assertEqual((status, error), (0, ""))
            self.assertEqual(samples(place.data / "station.sqlite", run_id), recorded)
            restored = place.start_station(http=ports["http"], robots=ports["robots"])
            self.assertNotEqual(restored.get("/api/v1/station")["store_id"], before)
            seen = restored.wait_for_robot("sim-1")["next_seq"]
            wait_until(lambda: restored.robot("sim-1")["durable_next_seq"] > seen + 50, 60, "the robot goes on")
            self.assertEqual(restored.get("/api/v1/recording")["state"], "recording")

    def test_a_command_names_the_program_that_holds_the_folder(self):
        with lab() as place:
            place.start_station()
            place.stop_station()
            (place.data / "rheonaut.lock").write_text("rheonaut backup (pid 4711)\n")
            with open(place.data / "rheonaut.lock") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                for words in (["serve", "--http", "127.0.0.1:0", "--robots", "127.0.0.1:0"], ["user", "list"]):
                    status, _, error = tool(*words, "--data", place.data)
                    self.assertEqual(status, 1)
                    self.assertIn(f"rheonaut backup (pid 4711) uses '{place.data}'", error)
            self.assertEqual(tool("user", "list", "--data", place.data)[0], 0)

    def test_without_a_station_it_copies_by_itself(self):
        with lab() as place:
            station = place.start_station()
            run_id = self.record_a_run(place, station)
            recorded = samples(station.database, run_id)
            place.kill_station()  # its log is still beside the database
            copy = place.folder / "copy.sqlite"
            self.assertEqual(tool("backup", "--data", place.data, "--to", copy)[0], 0)
            self.assertEqual(samples(copy, run_id), recorded)
            status, _, error = tool("backup", "--data", place.data, "--to", copy)
            self.assertEqual(status, 1)
            self.assertIn("is there already", error)
            self.assertIn("there is no", tool("backup", "--data", place.folder / "none", "--to", copy)[2])
            self.assertFalse(pathlib.Path(place.folder / "none").exists())

    def test_copies_for_commands_that_ended_early_are_removed_after_a_day(self):
        with lab() as place:
            place.start_station()
            folder = place.data / "backups"
            folder.mkdir(exist_ok=True)
            recent = f"cli-{int(time.time()) - 3600}-17.sqlite"
            others = {recent, "cli-monday.sqlite", "monday.sqlite"}
            for name in others | {"cli-1600000000-17.sqlite"}:
                (folder / name).write_text("a copy")
            self.assertEqual(tool("backup", "--data", place.data, "--to", place.folder / "copy.sqlite")[0], 0)
            self.assertEqual({path.name for path in folder.iterdir()}, others)

    def test_a_schema_that_no_version_wrote_is_refused(self):
        with lab() as place:
            place.start_station()
            self.assertEqual(place.stop_station(), 0)
            copy, target = place.folder / "copy.sqlite", place.folder / "restored"
            for change in ("CREATE TRIGGER x AFTER INSERT ON run BEGIN DELETE FROM run; END", "CREATE VIEW y AS SELECT 1",
                           "DROP TRIGGER audit_kept", "CREATE TABLE z (a)",
                           "PRAGMA writable_schema = ON; INSERT INTO sqlite_schema VALUES ('trigger', 'sqlite_x', 'run', 0, "
                           "'CREATE TRIGGER sqlite_x AFTER INSERT ON run BEGIN DELETE FROM run; END')"):
                copy.unlink(missing_ok=True)
                self.assertEqual(tool("backup", "--data", place.data, "--to", copy)[0], 0)
                with contextlib.closing(sqlite3.connect(copy)) as database:
                    database.executescript(change)
                status, _, error = tool("restore", "--from", copy, "--data", target)
                self.assertEqual(status, 1)
                self.assertIn("no version of this program wrote its ", error)
                self.assertFalse((target / "station.sqlite").exists())

    def test_a_restore_that_is_ended_leaves_no_draft(self):
        """By a limit; by a signal; the next one takes away what is left where both of its processes were killed."""
        with lab() as place:
            place.start_station()
            self.assertEqual(place.stop_station(), 0)
            copy, target = place.folder / "copy.sqlite", place.folder / "restored"
            self.assertEqual(tool("backup", "--data", place.data, "--to", copy)[0], 0)
            command = [str(BIN / "rheonaut"), "restore", "--from", str(copy), "--data", str(target)]
            limited = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S,
                                     preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)))
            self.assertEqual((limited.returncode, limited.stdout), (1, ""))
            self.assertIn(f"'{copy}' was not read to its end: a file made of it had more than 100000 bytes", limited.stderr)
            self.assertEqual(list(target.glob("station*")), [])
            with contextlib.closing(sqlite3.connect(copy, isolation_level=None)) as holder:
                holder.execute("BEGIN EXCLUSIVE")  # the copy waits for its first page
                for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
                    process = subprocess.Popen(command)
                    wait_until((target / "station.sqlite.part").exists, PATIENCE_S, "the draft")
                    reader = child_of(process)
                    process.send_signal(number)
                    self.assertEqual(process.wait(timeout=PATIENCE_S), -number)
                    wait_until(lambda: has_ended(reader), PATIENCE_S, "the end of its child")
                    self.assertEqual(list(target.glob("station*")), [])
                process = subprocess.Popen(command, start_new_session=True)
                wait_until((target / "station.sqlite.part").exists, PATIENCE_S, "the draft")
                os.killpg(process.pid, signal.SIGKILL)
                process.wait(timeout=PATIENCE_S)
            wait_until(lambda: tool(*command[1:])[0] == 0, PATIENCE_S, "the next restore")
            self.assertEqual([path.name for path in target.glob("station*.part*")], [])

    def test_a_database_of_somebody_else_runs_nothing_when_it_is_verified(self):
        with lab() as place:
            place.start_station()
            self.assertEqual(place.stop_station(), 0)
            copy = place.folder / "copy.sqlite"
            self.assertEqual(tool("backup", "--data", place.data, "--to", copy)[0], 0)
            with contextlib.closing(sqlite3.connect(copy)) as database:
                database.executescript("ALTER TABLE segment RENAME TO s; CREATE VIEW segment AS WITH RECURSIVE n (i) AS"
                                       " (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT s.* FROM s, n")
            status, _, error = tool("verify", "--file", copy)
            self.assertEqual(status, 2, error)
            self.assertIn("cannot read ", error)

    def test_a_reference_is_imported_by_a_child_under_limits(self):
        with lab() as place:
            place.start_station()
            self.assertEqual(place.stop_station(), 0)
            file = place.folder / "camera.csv"
            file.write_text("t_s,position_m\n0,0\n")
            words = ["reference", "import", "--run", "1", "--csv", str(file), "--data", str(place.data)]
            ended = subprocess.run([str(BIN / "rheonaut"), *words], capture_output=True, text=True, timeout=PATIENCE_S,
                                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)))
            self.assertEqual((ended.returncode, ended.stdout), (1, ""))
            self.assertIn(f"'{file}' was not read to its end: a file made of it had more than 1000 bytes", ended.stderr)

    def test_a_damaged_backup_is_refused(self):
        with lab() as place:
            station = place.start_station()
            self.record_a_run(place, station)
            copy = place.folder / "copy.sqlite"
            self.assertEqual(tool("backup", "--data", place.data, "--to", copy)[0], 0)
            with open(copy, "r+b") as file:
                file.truncate(copy.stat().st_size - 4096)
            status, _, error = tool("restore", "--from", copy, "--data", place.folder / "new")
            self.assertEqual(status, 1)
            self.assertIn("truncated", error)
            self.assertFalse((place.folder / "new" / "station.sqlite").exists())


if __name__ == "__main__":
    unittest.main()
