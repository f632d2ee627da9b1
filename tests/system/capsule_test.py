"""A run of a real station as an .eln archive: saved, computed again, damaged, packed anew by another program."""

import contextlib
import hashlib
import json
import os
import pathlib
import resource
import signal
import sqlite3
import subprocess
import time
import unittest
import warnings
import zipfile

from processes import BIN, PATIENCE_S, child_of, commanded, has_ended, lab, wait_until

VALIDATOR = pathlib.Path(__file__).with_name("validate_crate.mjs")
# A program with the address sanitizer ends, where no memory is left, as any other.
WITHOUT_MEMORY = {"ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":abort_on_error=1"}


class CapsuleTest(unittest.TestCase):
    def record(self, place, station):
        """One second in auto to 0.02 m, on the robot's own estimate."""
        place.start_robot(station, "sim-1", "--seed", "5")
        station.wait_for_robot("sim-1")
        run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "step"})["run_id"]
        commanded(station, "set_mode", mode="auto", setpoint_m=0.02)
        time.sleep(1)  # the input of this test
        commanded(station, "set_mode", mode="manual")
        station.post(f"/api/v1/runs/{run}/end", {})
        return run

    def reproduce(self, place, file, *flags):
        return place.tool("reproduce", file, *flags)

    def validate(self, place, archive, names):
        """By the validator of the package ro-crate, which the cockpit's folder has."""
        metadata = place.folder / "ro-crate-metadata.json"
        metadata.write_bytes(archive.read(next(name for name in names if name.endswith(metadata.name))))
        files = [name.split("/", 1)[1] for name in names]
        checked = subprocess.run(["node", VALIDATOR, metadata, *files], capture_output=True, text=True, timeout=60)
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)
        metadata.write_text(metadata.read_text().replace('"license"', '"licence"'))
        checked = subprocess.run(["node", VALIDATOR, metadata, *files], capture_output=True, text=True, timeout=60)
        self.assertEqual(checked.returncode, 1, "a crate without a licence is not valid")

    def test_an_archive_is_made_checked_and_computed_again(self):
        with lab() as place:
            station = place.start_station()
            run = self.record(place, station)
            file, again = place.folder / "run.eln", place.folder / "again.eln"
            for to in (file, again):
                made = place.tool("capsule", run, "--to", to, "--data", place.data)
                self.assertEqual(made.returncode, 0, made.stderr)
            whole = file.read_bytes()
            self.assertEqual(whole, again.read_bytes(), "the same run gives the same bytes")
            self.assertEqual(sorted(path.name for path in place.folder.glob("*.part")), [])
            place.kill_station()

            found = self.reproduce(place, file)
            self.assertEqual(found.returncode, 0, found.stdout + found.stderr)
            self.assertIn("the archive is as it was written", found.stdout)
            self.assertIn(" 0 within 1e-9, 0 different", found.stdout)
            self.assertIn("plot: Position (m)", found.stdout)

            with zipfile.ZipFile(file) as archive:
                self.assertIsNone(archive.testzip())
                names = archive.namelist()
                self.validate(place, archive, names)
                csv = archive.getinfo(f"run-{run}/samples.csv")
                anew = place.folder / "anew.eln"
                with zipfile.ZipFile(anew, "w", zipfile.ZIP_STORED) as other:
                    for name in names:
                        other.writestr(name, archive.read(name))
            repacked = self.reproduce(place, anew)
            self.assertEqual(repacked.returncode, 0, repacked.stdout + repacked.stderr)
            self.assertIn("packed by another program", repacked.stdout)

            damaged = bytearray(whole)
            damaged[csv.header_offset + 30 + len(csv.filename) + csv.compress_size // 2] ^= 1
            file.write_bytes(damaged)
            found = self.reproduce(place, file)
            self.assertEqual(found.returncode, 1, found.stderr)
            self.assertIn(f"run-{run}/samples.csv", found.stdout)

    def made_by_hand(self, file, value):
        """An archive whose documents, of 60 MB, hold this value again and again: read for seconds."""
        long = b'{"x":[' + b",".join([value] * (60_000_000 // (len(value) + 1))) + b"]}"
        files = {"run.json": long, "metrics.json": long, "report.html": b"", "samples.sqlite": b""}
        crate = {"@graph": [{"@type": "File", "@id": name, "sha256": hashlib.sha256(content).hexdigest()}
                            for name, content in files.items()]}
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name, content in ({"ro-crate-metadata.json": json.dumps(crate).encode()} | files).items():
                archive.writestr(f"run-1/{name}", content)

    def test_an_archive_that_takes_too_long_is_ended_and_nothing_is_left_after_a_kill(self):
        with lab() as place:
            file, scratch = place.folder / "long.eln", place.folder / "tmp"
            scratch.mkdir()
            self.made_by_hand(file, b"1.5")
            command, into = [str(BIN / "rheonaut"), "reproduce", str(file)], os.environ | {"TMPDIR": str(scratch)}
            ended = subprocess.run(command, capture_output=True, text=True, timeout=2 * PATIENCE_S, env=into,
                                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (1, 5)))
            self.assertEqual((ended.returncode, ended.stdout), (1, ""))
            self.assertIn(f"'{file}' was not read to its end: it took more than 1 s of processor time", ended.stderr)
            self.assertEqual(list(scratch.iterdir()), [])
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
                process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=into)
                reader = wait_until(lambda: child_of(process), PATIENCE_S, "its child")
                process.send_signal(number)
                self.assertEqual(process.wait(timeout=PATIENCE_S), -number)
                wait_until(lambda: has_ended(reader), PATIENCE_S, "the end of its child")
                self.assertEqual(list(scratch.iterdir()), [])

    def test_a_strangers_archive_ends_in_words_and_leaves_nothing(self):
        """Two entries of one name, names that climb, bombs, depth, a database with a view, a fifo, control characters."""
        with lab() as place:
            station = place.start_station()
            run = self.record(place, station)
            good = place.folder / "run.eln"
            self.assertEqual(place.tool("capsule", run, "--to", good, "--data", place.data).returncode, 0)
            place.kill_station()
            scratch, bad = place.folder / "tmp", place.folder / "bad.eln"
            scratch.mkdir()
            with zipfile.ZipFile(good) as archive:
                entries = [(name, archive.read(name)) for name in archive.namelist()]
            folder = entries[0][0].split("/")[0]
            forged = place.folder / "forged.sqlite"
            forged.write_bytes(dict(entries)[f"{folder}/samples.sqlite"])
            with contextlib.closing(sqlite3.connect(forged)) as database:
                database.executescript("ALTER TABLE sample RENAME TO s; CREATE VIEW sample AS SELECT * FROM s")

            def packed(change, rehash=()):
                files = change(list(entries))
                for name in rehash:  # as somebody does who knows how
                    at = next(i for i, (entry, _) in enumerate(files) if entry.endswith("ro-crate-metadata.json"))
                    crate = json.loads(files[at][1])
                    for one in crate["@graph"]:
                        if one["@id"] == name:
                            one["sha256"] = hashlib.sha256(dict(files)[f"{folder}/{name}"]).hexdigest()
                    files[at] = (files[at][0], json.dumps(crate).encode())
                with warnings.catch_warnings(), zipfile.ZipFile(bad, "w", zipfile.ZIP_DEFLATED) as archive:
                    warnings.simplefilter("ignore")  # of two entries of one name
                    for name, content in files:
                        archive.writestr(name, content)

            def replaced(name, content):
                return lambda files: [(entry, content if entry.endswith("/" + name) else old) for entry, old in files]

            metrics = next(name for name, _ in entries if name.endswith("metrics.json"))
            depth, name = 50, "k" * 10_000  # of each of 10,000 numbers the place in the document has 500 kB
            unfolding = (f'{{"{name}":' * depth + f"[{'1,' * 10_000}1]" + "}" * depth).encode()
            for change, rehash, said in (
                    (lambda files: [*files, (metrics, b"{}")], (), "it has two entries"),
                    (lambda files: [*files, ("../../climbs", b"")], (), "which is no plain path"),
                    (lambda files: [*files, ("/etc/x", b"")], (), "which is no plain path"),
                    (lambda files: [*files, (f"{folder}/\x1b]0;x\x07", b"")], (), "\\x1B]0;x\\x07"),
                    (lambda files: [*files, *((f"{folder}/{i}", b"") for i in range(1100))], (), "it has more than 1000 entries"),
                    (replaced("samples.sqlite", bytes(400_000_000)), (), "times the archive"),
                    (replaced("metrics.json", b"[" * 200_000), ("metrics.json",), "metrics.json is not a JSON object"),
                    (replaced("metrics.json", unfolding), ("metrics.json",), "bad.eln' was not read to its end: it needed more than 20"),
                    (replaced("samples.sqlite", forged.read_bytes()), ("samples.sqlite",), "cannot read samples.sqlite")):
                packed(change, rehash)
                found = subprocess.run([str(BIN / "rheonaut"), "reproduce", str(bad)], capture_output=True, text=True,
                                       timeout=PATIENCE_S, env=os.environ | {"TMPDIR": str(scratch)} | WITHOUT_MEMORY)
                self.assertIn(found.returncode, (1, 2), found.stdout + found.stderr)
                self.assertIn(said, found.stdout + found.stderr)
                self.assertNotIn("\x1b", found.stdout + found.stderr)
                self.assertEqual(list(scratch.iterdir()), [])
            os.mkfifo(place.folder / "fifo.eln")
            self.assertEqual(self.reproduce(place, place.folder / "fifo.eln").returncode, 1)

    def test_what_is_no_archive_of_a_run_is_refused(self):
        with lab() as place:
            file = place.folder / "no.eln"
            file.write_bytes(b"no archive")
            self.assertEqual(self.reproduce(place, file).returncode, 1)
            with zipfile.ZipFile(file, "w") as archive:
                archive.writestr("run-1/text.txt", "no crate")
            refused = self.reproduce(place, file)
            self.assertEqual(refused.returncode, 2, refused.stdout)
            self.assertIn("ro-crate-metadata.json", refused.stderr)
            self.assertNotEqual(place.tool("capsule", 1, "--to", file, "--data", place.data).returncode, 0)


if __name__ == "__main__":
    unittest.main()
