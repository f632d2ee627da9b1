"""Export files of a real station: the program that writes them is killed, stopped, missing, or out of disk, and the
station goes on. The libraries of the formats are in that program alone."""
import contextlib
import json
import os
import pathlib
import sqlite3
import struct
import subprocess
import unittest

from processes import BIN, commanded, lab, wait_until

FOREIGN = ("matio", "hdf5", "curl", "ldap")


def libraries(program):
    return subprocess.run(["ldd", program], capture_output=True, text=True, check=True, timeout=60).stdout.lower()


def is_alive(pid):
    """Neither gone nor a zombie."""
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def priority_of(pid):
    return os.getpriority(os.PRIO_PROCESS, pid)


def as_binary32(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def read_mcap(path):
    script = pathlib.Path(__file__).with_name("read_mcap.mjs")
    read = subprocess.run(["node", script, path], capture_output=True, text=True, check=True, timeout=60)
    return json.loads(read.stdout)


class ExportTest(unittest.TestCase):
    def install(self, place):
        """The station's program alone in a folder of its own, where export() is what it starts."""
        folder = place.folder / "bin"
        folder.mkdir()
        for name in ("rheonaut", "rheonaut-sim"):
            try:
                os.link(BIN / name, folder / name)
            except OSError:  # on another disk
                (folder / name).write_bytes((BIN / name).read_bytes())
                (folder / name).chmod(0o755)
        place.bin = folder
        return folder

    def program(self, place, text):
        path = place.bin / "rheonaut-export"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)

    def record(self, place, station):
        place.start_robot(station)
        station.wait_for_robot("sim-1")
        commanded(station, "set_mode", mode="manual")
        run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "exported"})["run_id"]
        wait_until(lambda: station.get(f"/api/v1/runs/{run}")["samples_stored"] > 200, 60, "samples")
        return run

    def refusal(self, station, run, name="samples.mat"):
        status, _, content = station.request("GET", f"/api/v1/runs/{run}/{name}", timeout_s=90)
        self.assertEqual(status, 503, content[:200])
        return json.loads(content)["detail"]

    def test_the_stations_program_has_no_library_of_a_format(self):
        found = libraries(BIN / "rheonaut")
        for name in FOREIGN:
            self.assertNotIn(name, found)
        self.assertIn("matio", libraries(BIN / "rheonaut-export"), "so the names above are those that ldd gives")

    def test_whatever_becomes_of_the_program_the_station_goes_on(self):
        with lab() as place:
            self.install(place)
            station = place.start_station()
            run = self.record(place, station)
            real = BIN / "rheonaut-export"
            self.assertIn("neither", self.refusal(station, run))

            self.program(place, "kill -9 $$")
            self.assertIn("signal 9", self.refusal(station, run))

            self.program(place, f"ulimit -f 8; exec {real} \"$@\"")  # 4 kB of file: as a disk that is full
            self.assertIn("File too large", self.refusal(station, run))
            self.assertIn("full", self.refusal(station, run, "samples.sqlite"))

            installed = place.folder / "libexec" / "rheonaut"
            installed.mkdir(parents=True)
            (place.bin / "rheonaut-export").rename(installed / "rheonaut-export")
            self.assertIn("File too large", self.refusal(station, run), "it is found where a package puts it")
            self.program(place, f"exec {real} \"$@\"")
            status, _, content = station.request("GET", f"/api/v1/runs/{run}/samples.mat", timeout_s=90)
            self.assertEqual((status, content[:10]), (200, b"MATLAB 5.0"))

            before = station.get(f"/api/v1/runs/{run}")["samples_stored"]
            wait_until(lambda: station.get(f"/api/v1/runs/{run}")["samples_stored"] > before, 60, "samples")
            self.assertEqual(station.get(f"/api/v1/runs/{run}")["samples_lost"], 0)
            self.assertEqual(list((place.data / ".exports").iterdir()), [], "nothing is left of what failed")

    def test_every_format_takes_a_name_of_every_script(self):
        names = ("\U0001f41f fish", "\u05e9\u05dc\u05d5\u05dd \U0001f41f", "\U0001f41f" * 50, "\u202eevil", "a\"b<c>'d'/..\\e")
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            for name in names:
                run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": name, "notes": "\U0001f41f" * 64})["run_id"]
                wait_until(lambda run=run: station.get(f"/api/v1/runs/{run}")["samples_stored"] > 20, 60, "samples")
                station.post(f"/api/v1/runs/{run}/end", {})
                files = {ending: place.folder / f"{run}.{ending}" for ending in ("csv", "mat", "sqlite", "mcap", "html", "eln")}
                for ending, to in files.items():
                    what = {"html": ["report", run], "eln": ["capsule", run]}.get(ending, ["export", "--run", run, "--format", ending])
                    done = place.tool(*what, "--to", to, "--data", place.data)
                    self.assertEqual((done.returncode, to.exists()), (0, True), f"{ending} of {name!r}: {done.stderr}")
                self.assertTrue(files["mat"].read_bytes().startswith(b"MATLAB 5.0"))
                with contextlib.closing(sqlite3.connect(files["sqlite"])) as database:
                    self.assertEqual(database.execute("SELECT name, notes FROM run").fetchone(), (name, "\U0001f41f" * 64))
                self.assertEqual(read_mcap(files["mcap"])["metadata"]["rheonaut.run"]["name"], name)
                reproduced = place.tool("reproduce", files["eln"])
                self.assertEqual(reproduced.returncode, 0, reproduced.stdout + reproduced.stderr)
                status, headers, _ = station.request("GET", f"/api/v1/runs/{run}/samples.csv")
                self.assertEqual((status, headers["Content-Disposition"]), (200, f'attachment; filename="run-{run}.csv"'))
            too_long = station.request("POST", "/api/v1/runs", {"robot_id": "sim-1", "name": "\U0001f41f" * 51})
            self.assertEqual(too_long[0], 422)

    def test_a_cancelled_job_and_a_killed_station_end_the_program(self):
        with lab() as place:
            self.install(place)
            station = place.start_station()
            run = self.record(place, station)
            pid_file = place.folder / "pid"
            self.program(place, f"echo progress 1 4; echo $$ > {pid_file}; kill -STOP $$")

            def started():
                return pid_file.exists() and pid_file.read_text().strip()

            job = station.post("/api/v1/jobs", {"kind": "export", "run_id": run, "format": "mat"})["job_id"]
            pid = int(wait_until(started, 60, "the program"))
            wait_until(lambda: (station.get(f"/api/v1/jobs/{job}")["progress"] or {}).get("share") == 0.25, 60, "share")
            station.post(f"/api/v1/jobs/{job}/cancel", {})
            wait_until(lambda: not is_alive(pid), 60, "the end of the program")

            # The real program, which waits for a database that never comes.
            pid_file.unlink()
            fifo = place.folder / "database"
            os.mkfifo(fifo)
            self.program(place, f"echo $$ > {pid_file}; shift; exec {BIN / 'rheonaut-export'} {fifo} \"$@\"")
            station.post("/api/v1/jobs", {"kind": "export", "run_id": run, "format": "mat"})
            pid = int(wait_until(started, 60, "the program"))
            wait_until(lambda: pathlib.Path(f"/proc/{pid}/comm").read_text() == "rheonaut-export\n"
                       and "State:\tS" in pathlib.Path(f"/proc/{pid}/status").read_text(), 60, "the wait")
            self.assertEqual(priority_of(pid), 10)
            self.assertEqual(pathlib.Path(f"/proc/{pid}/oom_score_adj").read_text(), "1000\n")
            place.kill_station()
            wait_until(lambda: not is_alive(pid), 60, "the end of the program")


    def test_an_mcap_file_says_what_the_sqlite_file_says(self):
        """Read by @mcap/core: every value of every row, and nothing else."""
        with lab() as place:
            station = place.start_station()
            run = self.record(place, station)
            station.post("/api/v1/robots/sim-1/markers", {"text": 'a "marker", ü'})
            commanded(station, "set_mode", mode="auto", setpoint_m=0.02)
            stored = station.get(f"/api/v1/runs/{run}")["samples_stored"]
            wait_until(lambda: station.get(f"/api/v1/runs/{run}")["samples_stored"] > stored + 100, 60, "samples")
            station.post(f"/api/v1/runs/{run}/end", {})
            files = {}
            for kind in ("sqlite", "mcap"):
                files[kind] = place.folder / f"run.{kind}"
                status, _, content = station.request("GET", f"/api/v1/runs/{run}/samples.{kind}", timeout_s=90)
                self.assertEqual(status, 200, content[:200])
                files[kind].write_bytes(content)
            by_tool = place.folder / "tool.mcap"
            made = place.tool("export", "--run", run, "--format", "mcap", "--to", by_tool, "--data", place.data)
            self.assertEqual(made.returncode, 0, made.stderr)
            self.assertEqual(by_tool.read_bytes(), files["mcap"].read_bytes(), "the same run gives the same bytes")
            read = read_mcap(files["mcap"])
            with contextlib.closing(sqlite3.connect(files["sqlite"])) as rows:
                rows.row_factory = sqlite3.Row
                self.compare(read["channels"], rows)
                name, = rows.execute("SELECT sha256 FROM run_certificate").fetchone()
            self.assertEqual(read["metadata"]["rheonaut.run"]["certificate_sha256"], name)
            self.assertEqual(read["metadata"]["rheonaut.run"]["name"], "exported")
            whole = files["mcap"].read_bytes()
            files["mcap"].write_bytes(whole.replace(b'"gap_before":0', b'"gap_before":1', 1))
            with self.assertRaises(subprocess.CalledProcessError, msg="the CRC of the chunk finds a damage"):
                read_mcap(files["mcap"])

    def compare(self, channels, rows):
        tables = {"/telemetry": "sample", "/event": "event", "/command": "command", "/gap": "gap", "/marker": "marker"}
        self.assertEqual(set(channels), set(tables))
        for topic, table in tables.items():
            channel = channels[topic]
            self.assertEqual((channel["encoding"], channel["schema_encoding"]), ("json", "jsonschema"))
            expected = [dict(row) for row in rows.execute(f"SELECT * FROM {table}")]
            messages = channel["messages"]
            self.assertEqual(len(messages), len(expected), topic)
            key = {"sample": "seq", "event": "event_row", "command": "command_id"}.get(table)
            found = [(message, json.loads(message["text"])) for message in messages]
            if key:
                expected.sort(key=lambda row: row[key])
                found.sort(key=lambda pair: pair[1][key])
            for row, (message, values) in zip(expected, found):
                self.compare_row(row, message, values, channel["schema"]["properties"], table == "sample")
        self.assertGreater(len(channels["/telemetry"]["messages"]), 300)
        self.assertEqual(json.loads(channels["/marker"]["messages"][0]["text"])["text"], 'a "marker", ü')
        self.assertGreater(len(channels["/command"]["messages"]), 0)

    def compare_row(self, row, message, values, properties, is_sample):
        # A binary32 is its shortest decimal; t_s counts exact microseconds.
        values = {name: as_binary32(value) if properties[name]["type"] == "number" and name != "t_s" else value
                  for name, value in values.items()}
        if is_sample:
            self.assertEqual(int(message["log_time"]), 1000 * row["utc_us"])
            self.assertEqual(int(message["publish_time"]), 1000 * row["robot_time_us"])
            self.assertEqual(message["sequence"], row["seq"])
        self.assertEqual(values, {name: value for name, value in row.items() if value is not None})
        for name, value in values.items():
            allowed = {"string": str, "integer": int, "number": (int, float)}[properties[name]["type"]]
            self.assertIsInstance(value, allowed, name)


if __name__ == "__main__":
    unittest.main()
