"""`rheonaut doctor` against real folders and stations, each broken in one way that it has to name."""
import contextlib
import ctypes
import fcntl
import http.server
import json
import os
import re
import resource
import shutil
import signal
import socket
import sqlite3
import ssl
import subprocess
import threading
import time
import unittest

from processes import BIN, lab, wait_until

NEXT_YEAR_US = 365 * 86_400_000_000


def doctor(place, *flags, **more):
    """The exit code, and the findings by topic: a topic may have several."""
    done = subprocess.run([str(BIN / "rheonaut"), "doctor", "--data", str(place.data), "--json", *map(str, flags)],
                          capture_output=True, text=True, timeout=120, **more)
    answer = json.loads(done.stdout)
    findings = {}
    for finding in answer["findings"]:
        findings.setdefault(finding["topic"], []).append(finding)
    assert answer["healthy"] == (done.returncode == 0), done.stdout
    return done.returncode, findings


class DoctorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """A station that ran, without a robot and then with one, and ended in order. The tests have copies of its folder."""
        place = cls.enterClassContext(lab())
        cls.ended = {}
        for robot in (False, True):
            station = place.start_station()
            if robot and place.start_robot(station):
                wait_until(lambda: station.get("/api/v1/recording")["counters"]["samples_written"] > 0, 60, "samples")
            place.stop_station()
            cls.ended[robot] = shutil.copytree(place.data, place.folder / f"ended-{robot}")
        place.close()

    def stopped(self, robot=False):
        return lab(data=self.ended[robot])

    def expect(self, findings, topic, grade, words):
        found = findings.get(topic, [])
        named = [finding for finding in found if finding["grade"] == grade and words in finding["what"]]
        self.assertTrue(named, f"no {grade} of {topic} with '{words}' in {json.dumps(found, indent=1)}")
        self.assertTrue(named[0]["action"], "says what to do")

    def expect_problem(self, place, topic, words, *flags, **more):
        code, findings = doctor(place, *flags, **more)
        self.expect(findings, topic, "problem", words)
        self.assertEqual(code, 1)

    def expect_note(self, place, topic, words, *flags):
        code, findings = doctor(place, *flags)
        self.expect(findings, topic, "note", words)
        self.assertEqual(code, 0, json.dumps(findings, indent=1))

    def write_config(self, place, text):
        path = place.folder / "doctor.toml"
        path.write_text(text)
        return path

    def test_finds_nothing_wrong_with_a_station_and_its_robot(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            wait_until(lambda: station.get("/api/v1/recording")["counters"]["samples_written"] > 0, 60, "samples")
            code, findings = doctor(place)
            self.assertEqual(code, 0, json.dumps(findings, indent=1))
            self.assertIn("1 are connected", findings["robots"][0]["what"])
            self.assertIn(f"(pid {place.station_process.pid}) listens", findings["http port"][0]["what"])
            text = place.tool("doctor", "--data", place.data).stdout
            self.assertTrue(text.endswith("nothing is wrong\n"), text)
            self.assertEqual(place.stop_station(), 0)
            code, findings = doctor(place)
            self.assertEqual(code, 0, json.dumps(findings, indent=1))
            self.assertEqual([path.name for path in place.data.glob(".doctor*")], [])

    def test_does_not_disturb_the_database_beside_it(self):
        with self.stopped() as place:
            before = {path.name: path.read_bytes() for path in place.data.glob("station*")}
            doctor(place)
            self.assertEqual({path.name: path.read_bytes() for path in place.data.glob("station*")}, before)

    def test_no_folder(self):
        with lab() as place:
            self.expect_problem(place, "data", "there is no data folder")

    def test_a_wrong_configuration(self):
        with self.stopped() as place:
            config = self.write_config(place, "[log]\nlevel = \"loud\"\n")
            self.expect_problem(place, "config", "log.level = 'loud'", "--config", config)

    def test_little_room(self):
        with lab(config="[recording]\nlow_space_mb = 90000000\ncritical_space_mb = 0\n") as place:
            place.start_station()
            config = place.folder / "rheonaut.toml"
            self.expect_problem(place, "space", "fewer than low_space_mb", "--config", config)
            self.expect_problem(place, "recording", "low_space", "--config", config)
            config = self.write_config(place, "[recording]\nlow_space_mb = 90000000\ncritical_space_mb = 80000000\n")
            self.expect_problem(place, "space", "no run and no backup", "--config", config)

    def test_a_station_that_was_killed(self):
        with lab() as place:
            place.start_station()
            place.kill_station()
            self.expect_problem(place, "station", "left by one that was killed")

    def test_a_station_that_hangs(self):
        with lab() as place:
            place.start_station()
            place.station_process.send_signal(signal.SIGSTOP)
            try:
                self.expect_problem(place, "station", "does not answer")
            finally:
                place.station_process.send_signal(signal.SIGCONT)

    def test_a_station_that_answers_its_health_and_nothing_else(self):
        released = threading.Event()

        class Busy(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                if self.path != "/healthz":
                    released.wait(600)
                self.send_response(200)
                self.send_header("Content-Length", "0")
                self.end_headers()
            def log_message(self, *_):
                pass

        with self.stopped() as place, open(place.data / "rheonaut.lock") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Busy)
            server.daemon_threads = True
            threading.Thread(target=server.serve_forever, daemon=True).start()
            address = f"127.0.0.1:{server.server_port}"
            (place.data / "endpoints.json").write_text(
                json.dumps({"http": address, "robots": address, "pid": os.getpid()}))
            try:
                self.expect_note(place, "station", f"the station on {address} has not answered within 5 s")
            finally:
                released.set()
                server.shutdown()
                server.server_close()

    def test_a_station_of_another_version(self):
        class Old(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                body = json.dumps({"version": "0.0.1", "state": "recording", "problem": None, "robots": []}).encode()
                self.send_response(200)
                self.send_header("Content-Type", "application/json")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)
            def log_message(self, *_):
                pass

        with self.stopped() as place, open(place.data / "rheonaut.lock") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Old)
            threading.Thread(target=server.serve_forever, daemon=True).start()
            address = f"127.0.0.1:{server.server_port}"
            (place.data / "endpoints.json").write_text(
                json.dumps({"http": address, "robots": address, "pid": os.getpid()}))
            self.expect_problem(place, "station", "the station that runs is version 0.0.1")
            server.shutdown()
            server.server_close()

    def test_a_port_that_another_program_has(self):
        with self.stopped() as place, socket.create_server(("127.0.0.1", 0)) as other:
            port = other.getsockname()[1]
            for what in ("http", "robots"):
                config = self.write_config(place, f"[{what}]\nlisten = \"127.0.0.1:{port}\"\n")
                self.expect_problem(place, f"{what} port", f"(pid {os.getpid()}) listens on port {port}", "--config", config)
            config = self.write_config(place, f"[http]\nlisten = \"127.0.0.2:{port}\"\n")
            _, findings = doctor(place, "--config", config)
            self.assertEqual([one["what"] for one in findings["http port"]], [f"127.0.0.2:{port} is free"])
            config = self.write_config(place, f"[http]\nlisten = \"0.0.0.0:{port}\"\n")  # overlaps every address
            self.expect_problem(place, "http port", f"listens on port {port}", "--config", config)

    def test_secrets_that_others_can_read(self):
        with self.stopped() as place:
            place.tool("certificate", "--data", place.data)
            for name in ("rheonaut.token", "tls/station.key", "tls/lab-ca.key", "station.sqlite"):
                path = place.data / name
                path.chmod(0o644)
                self.expect_problem(place, "permissions", f"{name} (mode 0644)")
                path.chmod(0o600)
            place.data.chmod(0o777)
            self.expect_problem(place, "permissions", "other users may write into")
            place.data.chmod(0o700)
            self.assertEqual(doctor(place)[0], 0)

    @unittest.skipUnless(os.geteuid() == 0, "only root can give files away")
    def test_a_file_of_another_user(self):
        with self.stopped() as place:
            os.chown(place.data / "rheonaut.token", 1, 1)
            self.expect_problem(place, "permissions", "rheonaut.token belongs to")

    def test_a_certificate_that_expires_or_is_not_this_one(self):
        with self.stopped() as place:
            config = self.write_config(place, "[tls]\nmode = \"on\"\n")
            self.expect_problem(place, "certificate", "is not there, and a port speaks TLS", "--config", config)
            place.tool("certificate", "--data", place.data)
            self.assertEqual(doctor(place, "--config", config)[0], 0)
            tls = place.data / "tls"
            shutil.copy(tls / "station.key", place.folder / "right.key")
            shutil.copy(tls / "lab-ca.key", tls / "station.key")
            self.expect_problem(place, "certificate", "is not the key of", "--config", config)
            shutil.copy(place.folder / "right.key", tls / "station.key")
            self.replace_certificate(place, 12)
            self.expect_problem(place, "certificate", "it expires in 11 days", "--config", config)
            self.age_certificate(tls / "station.crt")
            self.expect_problem(place, "certificate", "it has expired", "--config", config)
            self.expect_note(place, "certificate", "it has expired")  # no port of it speaks TLS
            (tls / "station.crt").write_text("no certificate")
            self.expect_problem(place, "certificate", "station.crt", "--config", config)

    def test_a_certificate_that_is_not_for_every_name(self):
        def named(listen, name):
            return self.write_config(place, f'[tls]\nmode = "on"\n[http]\nlisten = "{listen}:0"\nhosts = ["{name}"]\n')

        with self.stopped() as place:
            place.tool("certificate", "--data", place.data)
            _, findings = doctor(place, "--config", named("0.0.0.0", "page.lab.example"))
            self.expect(findings, "certificate", "problem", "not for page.lab.example")
            # On loopback only a proxy can answer to that name.
            config = named("127.0.0.1", "page.lab.example")
            self.expect_note(place, "certificate", "not for page.lab.example", "--config", config)
            self.replace_certificate(place, 90, "DNS:localhost,DNS:*.Lab.example")
            for name, is_covered in (("page.lab.example", True), ("lab.example", False), ("a.page.lab.example", False)):
                _, findings = doctor(place, "--config", named("0.0.0.0", name))
                found = [one for one in findings["certificate"] if "not for" in one["what"]]
                self.assertEqual([], found) if is_covered else self.assertEqual(1, len(found), name)

    def replace_certificate(self, place, days, names="DNS:localhost"):
        tls = place.data / "tls"
        subprocess.run(["openssl", "req", "-x509", "-key", tls / "station.key", "-days", str(days), "-subj", "/CN=lab",
                        "-addext", f"subjectAltName={names}", "-out", tls / "station.crt"], check=True,
                       capture_output=True)

    def age_certificate(self, path):
        """Both of its times become ten years earlier; its signature is then wrong, which the doctor does not judge."""
        der = ssl.PEM_cert_to_DER_cert(path.read_text())
        aged = re.sub(rb"\x17\x0d(\d\d)(\d{10}Z)", lambda m: b"\x17\x0d%02d%s" % (int(m[1]) - 10, m[2]), der)
        self.assertNotEqual(aged, der)
        path.write_text(ssl.DER_cert_to_PEM_cert(aged))

    def test_a_damaged_database(self):
        with self.stopped() as place:
            with open(place.data / "station.sqlite", "r+b") as file:
                file.seek(8 * 4096)
                file.write(b"\xff" * 4096 * 20)
            self.expect_problem(place, "database", "is damaged")

    def test_a_database_of_another_program_or_version(self):
        with self.stopped() as place:
            database = place.data / "station.sqlite"
            whole = database.read_bytes()
            with contextlib.closing(sqlite3.connect(database)) as opened:
                version = opened.execute("PRAGMA user_version").fetchone()[0]
                opened.execute(f"PRAGMA user_version = {version - 1}")
            self.expect_note(place, "database", f"this program uses schema {version}")
            with contextlib.closing(sqlite3.connect(database)) as opened:
                opened.execute("PRAGMA user_version = 9999")
            self.expect_problem(place, "database", "9999")
            database.write_bytes(b"no database" * 1000)
            self.expect_problem(place, "database", "not")
            database.write_bytes(whole)
            self.assertEqual(doctor(place)[0], 0)

    def test_commits_that_were_lost(self):
        with self.stopped() as place:
            path = place.data / "station.head.json"
            head = json.loads(path.read_text())
            head["losses"] = [{"noticed_at_us": 1, "problem": "the database has lost commits 7 to 9"}]
            path.write_text(json.dumps(head))
            self.expect_problem(place, "database", "lost commits 7 to 9")

    def test_a_clock_behind_what_was_recorded(self):
        with self.stopped(robot=True) as place:
            with contextlib.closing(sqlite3.connect(place.data / "station.sqlite")) as database:
                database.execute("UPDATE boot SET connected_at_us = connected_at_us + ?", (NEXT_YEAR_US,))
                database.commit()
            self.expect_problem(place, "clock", "behind what was recorded last")

    def test_no_robot_ever_and_none_connected(self):
        with lab() as place:
            station = place.start_station()
            self.expect_note(place, "robots", "no robot has ever connected")
            robot = place.start_robot(station)
            wait_until(lambda: station.get("/api/v1/recording")["counters"]["samples_written"] > 0, 60, "samples")
            robot.terminate()
            robot.wait(30)
            wait_until(lambda: station.get("/api/v1/robots/sim-1")["link"] == "disconnected", 60, "the end of the link")
            self.expect_note(place, "robots", "none is connected")

    def test_robots_with_different_firmware(self):
        with lab() as place:
            station = place.start_station()
            for robot in ("sim-1", "sim-2"):
                place.start_robot(station, robot)
            wait_until(lambda: len([r for r in station.get("/api/v1/robots")["robots"] if r["link"] == "connected"]) == 2, 60,
                       "two robots")
            place.stop_station()
            with contextlib.closing(sqlite3.connect(place.data / "station.sqlite")) as database:
                database.execute("UPDATE boot SET firmware_version = '0.0.7' WHERE robot_id = 'sim-2'")
                database.commit()
            self.expect_note(place, "firmware", "0.0.7 (sim-2)")

    def refuse(self, place, cause, detail="for a reason"):
        with contextlib.closing(sqlite3.connect(place.data / "station.sqlite")) as database:
            columns = [row[1] for row in database.execute("PRAGMA table_info(event)")]
            row = dict(zip(columns, database.execute("SELECT * FROM event LIMIT 1").fetchone()))
            row.update(event_row=None, boot_key=None, event_seq=None, kind="connection_refused", cause=cause,
                       detail=detail, received_at_us=int(time.time() * 1e6))
            marks = ",".join("?" * len(columns))
            database.execute(f"INSERT INTO event VALUES ({marks})", [row[column] for column in columns])
            database.commit()

    def test_a_robot_that_was_refused(self):
        with self.stopped(robot=True) as place:
            self.refuse(place, "version", "it speaks version 0")
            self.refuse(place, "wrong_token")
            code, findings = doctor(place)
            self.expect(findings, "robots", "problem", "version: it speaks version 0")
            version, token = sorted((f for f in findings["robots"] if f["grade"] == "problem"),
                                    key=lambda f: "wrong_token" in f["what"])
            self.assertIn("flash the robot", version["action"])
            remedy = token["action"]
            self.assertLess(remedy.index("back into the robot"), remedy.index("robot revoke"), remedy)
            self.assertLess(remedy.index("robot revoke"), remedy.index("robot enrol"), remedy)
            self.assertIn("gives up the samples", remedy)
            self.assertEqual(code, 1)

    def test_one_refusal_as_already_connected_is_that_of_a_reset(self):
        with self.stopped(robot=True) as place:
            self.refuse(place, "already_connected")
            self.expect_note(place, "robots", "was refused once in the last day, already_connected")
            self.refuse(place, "already_connected")
            self.expect_problem(place, "robots", "was refused 2 times in the last day, already_connected")

    def test_a_database_that_another_program_holds_is_not_called_damaged(self):
        with self.stopped() as place, contextlib.closing(sqlite3.connect(place.data / "station.sqlite")) as other:
            other.execute("PRAGMA locking_mode = EXCLUSIVE")
            other.execute("BEGIN IMMEDIATE")
            other.execute("UPDATE meta SET value = value")
            other.commit()
            code, findings = doctor(place)
            found = [finding for finding in findings["database"] if finding["grade"] == "problem"]
            self.assertEqual(["end the program"], [finding["action"][:15] for finding in found], found)
            self.assertNotIn("damage", found[0]["what"] + found[0]["action"])
            self.assertEqual(code, 1)

    def test_limits_that_are_too_tight(self):
        with self.stopped() as place:
            for limit, most, said in ((resource.RLIMIT_NOFILE, 500, "500 open files are allowed"),
                                      (resource.RLIMIT_FSIZE, 5_000_000, "a file may grow to 5 MB only")):
                self.expect_problem(place, "limits", said, preexec_fn=lambda: resource.setrlimit(limit, (most, most)))

    def test_a_loop_without_real_time_priority(self):
        soft, hard = resource.getrlimit(resource.RLIMIT_RTPRIO)
        with lab() as place:
            def start():  # what this thread starts may not ask for it
                ctypes.CDLL(None).prctl(24, 23, 0, 0, 0)  # PR_CAPBSET_DROP, CAP_SYS_NICE: for root
                resource.setrlimit(resource.RLIMIT_RTPRIO, (0, hard))
                place.start_station()
            thread = threading.Thread(target=start)
            thread.start()
            thread.join()
            resource.setrlimit(resource.RLIMIT_RTPRIO, (soft, hard))
            self.expect_note(place, "real time", "without real-time priority")

    def test_a_loop_that_may_have_real_time_priority(self):
        with lab() as place:
            place.start_station()
            try:
                os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            except PermissionError:
                self.skipTest("the system does not permit real-time priority")
            wait_until(lambda: "may have real-time priority" in place.log("station"), 60, "the station asks")
            _, findings = doctor(place)
            self.assertEqual(["ok"], [finding["grade"] for finding in findings["real time"]])


if __name__ == "__main__":
    unittest.main()
