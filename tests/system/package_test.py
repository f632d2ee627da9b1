"""The Debian package, from apt to purge, in a minimal Debian 12 with systemd. Needs root, debootstrap and an archive.

One story in order: installed on a bare system, the demo, the service under systemd with its watchdog, an upgrade that
migrates, removed, purged. Without root or debootstrap it is skipped (exit status 77).
"""
import json
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import unittest

from debian_tree import DebianTree

BUILD = pathlib.Path(os.environ["RHEONAUT_BUILD"])
ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = re.search(r"project\(rheonaut VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text())[1]
OLDER = "0.8.99"  # the same files under the number of an older release
# Sanitizers read what the service may not see, and trace themselves at their end.
SANITIZED = "[Service]\nEnvironment=ASAN_OPTIONS=detect_leaks=0\n"
# Where root may raise no limit, LimitRTPRIO has no effect; a capability then shows that the rest of the unit permits it.
NO_LIMITS = "[Service]\nPrivateUsers=no\nCapabilityBoundingSet=CAP_SYS_NICE\nAmbientCapabilities=CAP_SYS_NICE\n"


def may_raise_limits():
    """Whether this process has CAP_SYS_RESOURCE."""
    status = pathlib.Path("/proc/self/status").read_text()
    return bool(int(re.search(r"CapEff:\s+(\w+)", status)[1], 16) >> 24 & 1)


def packed(version, folder):
    """The package of this build."""
    subprocess.run(["cpack", "-G", "DEB", "-D", f"CPACK_PACKAGE_VERSION={version}", "-B", str(folder)], cwd=BUILD,
                   check=True, capture_output=True, text=True, env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000"})
    return next(pathlib.Path(folder).glob("*.deb"))


class PackageTest(unittest.TestCase):
    is_booted = False

    def setUp(self):
        if self._testMethodName > "test_5_z" and not self.is_booted:
            self.skipTest("the tree is not booted")

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory(prefix="rheonaut-package-")))
        cls.tree = DebianTree(cls.folder)
        cls.addClassCleanup(cls.tree.close)
        begun = time.monotonic()
        cls.older, cls.package = packed(OLDER, cls.folder / "older"), packed(VERSION, cls.folder / "new")
        print(f"packed twice in {time.monotonic() - begun:.1f} s: {cls.package.stat().st_size / 1e6:.1f} MB")
        begun = time.monotonic()
        try:
            cls.tree.make()
        except subprocess.CalledProcessError as error:
            raise unittest.SkipTest(f"no archive can be reached to make a Debian of: {error.stderr[-300:]}")
        print(f"a minimal Debian 12 in {time.monotonic() - begun:.1f} s")
        for package in (cls.older, cls.package):
            shutil.copy(package, cls.tree.tree / "root")

    def path(self, inside):
        return self.tree.tree / inside.lstrip("/")

    def test_1_it_is_the_same_file_each_time(self):
        again = packed(VERSION, self.folder / "again")
        self.assertEqual(self.package.read_bytes(), again.read_bytes())

    def test_1b_its_programs_are_hardened(self):
        if "CMAKE_BUILD_TYPE:STRING=Release" not in (BUILD / "CMakeCache.txt").read_text():
            self.skipTest("only the release preset is hardened")
        for name in ("rheonaut", "rheonaut-export", "rheonaut-sim"):
            read = ["readelf", "--wide", "--dynamic", "--program-headers", "--dyn-syms", BUILD / "bin" / name]
            found = subprocess.run(read, check=True, capture_output=True, text=True).stdout
            for sign in (r"FLAGS_1.*\bNOW\b.*\bPIE\b", "GNU_RELRO", r"GNU_STACK.*\bRW ", "__stack_chk_fail", "_chk@"):
                self.assertRegex(found, sign, f"{name}: {sign}")

    def test_2_apt_installs_it_on_a_bare_system(self):
        begun = time.monotonic()
        self.tree.run("apt-get", "install", "-y", "-qq", "--no-install-recommends", f"/root/{self.older.name}")
        print(f"installed in {time.monotonic() - begun:.1f} s")
        self.assertIn(VERSION, self.tree.run("rheonaut", "--version").stdout)  # what the program says, not the package
        state = self.path("/var/lib/rheonaut").stat()
        self.assertEqual(0o700, state.st_mode & 0o777)
        self.assertIn(f"rheonaut:x:{state.st_uid}:", self.path("/etc/passwd").read_text())
        checked = self.tree.run("rheonaut", "check-config", "--config", "/etc/rheonaut/rheonaut.toml").stdout
        self.assertIn("/var/lib/rheonaut", checked)
        self.assertIn("rheonaut/remove-data", self.tree.run("debconf-show", "rheonaut").stdout)  # a purge can ask
        for page in ("rheonaut", "rheonaut-serve", "rheonaut-stop", "rheonaut-sim"):
            self.assertTrue(self.path(f"/usr/share/man/man1/{page}.1.gz").exists(), page)
        self.assertIn("_rheonaut", self.path("/usr/share/bash-completion/completions/rheonaut").read_text())
        for name in ("examples/robot.py", "examples/station_link.py", "protocol/robot.proto", "docs/your_own_robot.md"):
            self.assertTrue(self.path(f"/usr/share/doc/rheonaut/{name}").exists(), name)
        self.assertIn("preact", self.path("/usr/share/doc/rheonaut/copyright").read_text())
        # HDF5, and what it pulls, is loaded by the program that writes export files alone.
        self.assertNotIn("hdf5", self.tree.run("ldd", "/usr/bin/rheonaut").stdout)
        self.assertIn("hdf5", self.tree.run("ldd", "/usr/libexec/rheonaut/rheonaut-export").stdout)

    def test_3_the_demo_brings_the_robot_to_its_setpoint(self):
        self.tree.run("useradd", "-m", "anna")
        begun = time.monotonic()
        said = self.tree.run("runuser", "-u", "anna", "--", "sh", "-c", "cd && exec rheonaut demo --once", check=False)
        print(said.stdout)
        print(f"the demo took {time.monotonic() - begun:.1f} s")
        # A machine that stood still has the experiment aborted, as it must be.
        if ") is aborted" not in said.stderr:
            self.assertEqual(0, said.returncode, said.stderr)
            self.assertRegex(said.stdout, r"setpoint 100\.0 mm   seen by the controller +(9\d|10\d)\.\d mm   estimated")
        self.assertTrue(self.path("/home/anna/rheonaut-demo/station.sqlite").exists())

    def test_4_scipy_can_be_installed_beside_it(self):
        said = self.tree.run("apt-get", "install", "-y", "--simulate", "--no-install-recommends", "python3-scipy").stdout
        self.assertIn("Inst python3-scipy", said)
        self.assertNotIn("Remv", said)

    def test_5_the_service_runs_under_systemd_with_few_rights(self):
        self.tree.run("apt-get", "install", "-y", "-qq", "--no-install-recommends", "systemd", "systemd-sysv")
        for unit in ("rheonaut.service", "rheonaut-backup.service", "rheonaut-backup.timer"):
            self.tree.run("systemd-analyze", "verify", "--man=no", f"/lib/systemd/system/{unit}")
        # Of 10; --threshold counts tenths.
        for unit in ("rheonaut.service", "rheonaut-backup.service"):
            exposure = self.tree.run("systemd-analyze", "security", "--offline=true", "--threshold=25",
                                     f"/lib/systemd/system/{unit}").stdout
            print(exposure.splitlines()[-1])
        drop_in = self.path("/etc/systemd/system/rheonaut.service.d")
        drop_in.mkdir(parents=True)
        (drop_in / "sanitized.conf").write_text(SANITIZED)
        try:
            self.tree.boot()
        except TimeoutError as error:  # nothing of the package runs yet
            self.skipTest(f"this machine lets nobody boot the tree: {error}")
        type(self).is_booted = True
        self.tree.wait(self.is_active, "the service")
        pid = self.tree.main_pid("rheonaut.service")
        self.assertNotEqual(0, pathlib.Path(f"/proc/{pid}").stat().st_uid)
        self.assertIn("NoNewPrivs:\t1", pathlib.Path(f"/proc/{pid}/status").read_text())
        self.assertTrue(self.page_answers())

    def test_5b_its_loop_gets_real_time_priority(self):
        self.assertEqual("2", self.shown("LimitRTPRIO"))
        if not may_raise_limits():
            drop_in = self.path("/etc/systemd/system/rheonaut.service.d/no-limits.conf")
            drop_in.write_text(NO_LIMITS)
            self.addCleanup(self.restart)
            self.addCleanup(drop_in.unlink)
            self.restart()
        pid = self.tree.main_pid("rheonaut.service")

        # The mark of a thread that was permitted it, also while the thread is ordinary.
        self.tree.wait(lambda: os.sched_getscheduler(pid) & 0x40000000, "SCHED_RESET_ON_FORK")

    def test_5c_exports_are_written_under_the_rights_of_the_unit(self):
        with subprocess.Popen(["nsenter", "-t", self.tree.init, "-n", str(BUILD / "bin/rheonaut-sim"), "--id", "sim-1",
                               "--station", "127.0.0.1:7070"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as robot:
            try:
                self.tree.wait(lambda: any(one["robot_id"] == "sim-1" for one in self.asked("GET", "robots")["robots"]), "the robot")
                run = self.asked("POST", "runs", {"robot_id": "sim-1", "name": "exported"})["run_id"]
                self.tree.wait(lambda: self.asked("GET", f"runs/{run}")["samples_stored"] > 100, "samples")
                self.asked("POST", f"runs/{run}/end", {})
            finally:
                robot.terminate()
        # HDF5's program, in the unit's namespaces, with its temporary files in the data folder or the unit's /tmp.
        for kind, first in (("mat", "MATLAB"), ("sqlite", "SQLite"), ("mcap", "\\x89MCAP")):
            self.assertIn(first, self.asked("GET", f"runs/{run}/samples.{kind}", first_bytes=20))

    def test_6_a_station_that_stands_still_is_started_again(self):
        pid = self.tree.main_pid("rheonaut.service")
        os.kill(pid, signal.SIGSTOP)
        begun = time.monotonic()
        self.tree.wait(lambda: self.tree.main_pid("rheonaut.service") not in (pid, None) and self.is_active(),
                       "another station")
        print(f"a halted station was replaced after {time.monotonic() - begun:.1f} s")
        self.assertTrue(self.page_answers())
        log = self.tree.inside("journalctl", "-u", "rheonaut.service", "--no-pager").stdout
        self.assertIn("Watchdog timeout", log)

    def test_7_an_upgrade_migrates_and_keeps_a_copy(self):
        self.tree.inside("systemctl", "stop", "rheonaut.service")
        database = self.path("/var/lib/rheonaut/station.sqlite")
        owner = database.parent.stat()
        for leftover in database.parent.glob("station.*"):
            leftover.unlink()
        with sqlite3.connect(database) as old:
            old.executescript((ROOT / "tests/data/recording/version_6.sql").read_text())
            samples = old.execute("SELECT count(*) FROM sample").fetchone()[0]
        os.chown(database, owner.st_uid, owner.st_gid)
        database.chmod(0o600)
        self.tree.inside("dpkg", "-i", f"/root/{self.package.name}")
        self.tree.wait(self.is_active, "the upgraded service")
        self.assertIn(f"Version: {VERSION}", self.tree.inside("dpkg", "-s", "rheonaut").stdout)
        copy = database.with_name("station.sqlite.schema-6")
        for file in (copy, database):
            with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as kept:
                self.assertEqual(samples, kept.execute("SELECT count(*) FROM sample").fetchone()[0])
        self.assertTrue(self.page_answers())

    def test_8_the_daily_backup_is_made(self):
        self.tree.inside("systemctl", "start", "rheonaut-backup.service")
        self.assertEqual(1, len(list(self.path("/var/lib/rheonaut/daily").glob("daily-*.sqlite"))))

    def test_9a_removing_it_ends_the_service_and_leaves_the_recordings(self):
        self.tree.inside("apt-get", "remove", "-y", "-qq", "rheonaut")
        self.assertIsNone(self.tree.main_pid("rheonaut.service"))
        self.assertFalse(self.path("/usr/bin/rheonaut").exists())
        self.assertTrue(self.path("/etc/rheonaut/rheonaut.toml").exists())

    def test_9b_a_purge_that_nobody_answers_keeps_the_recordings(self):
        self.tree.inside("dpkg", "--purge", "rheonaut")
        self.assertTrue(self.path("/var/lib/rheonaut/station.sqlite").exists())
        self.assertFalse(self.path("/etc/rheonaut/rheonaut.toml").exists())

    def test_9c_a_purge_that_somebody_answers_with_yes_removes_them(self):
        self.tree.inside("dpkg", "-i", f"/root/{self.package.name}")
        self.tree.wait(self.is_active, "the service, installed again")
        answer = "rheonaut rheonaut/remove-data boolean true\n"
        self.tree.inside("sh", "-c", f"printf '{answer}' | debconf-set-selections")
        self.tree.inside("dpkg", "--purge", "rheonaut")
        self.assertFalse(self.path("/var/lib/rheonaut").exists())

    def restart(self):
        self.tree.inside("systemctl", "daemon-reload")
        self.tree.inside("systemctl", "restart", "rheonaut.service")

    def shown(self, name):
        return self.tree.inside("systemctl", "show", "-p", name, "--value", "rheonaut.service").stdout.strip()

    def is_active(self):
        return self.tree.inside("systemctl", "is-active", "rheonaut.service", check=False).stdout.strip() == "active"

    def asked(self, method, path, body=None, first_bytes=None):
        """What the API of the service answers: JSON, or the first bytes of a file as Python writes them."""
        token = self.path("/var/lib/rheonaut/rheonaut.token").read_text().strip()
        ask = ("import json, sys, urllib.request as u\n"
               "method, path, body, token = sys.argv[1:]\n"
               "headers = {'Authorization': 'Bearer ' + token, 'Content-Type': 'application/json'}\n"
               "asked = u.Request('http://127.0.0.1:8080/api/v1/' + path, body.encode() or None, headers, method=method)\n"
               f"answer = u.urlopen(asked, timeout=60).read({first_bytes or ''})\n"
               f"print({'answer' if first_bytes else 'answer.decode()'})")
        said = self.tree.in_its_network("/usr/bin/python3", "-c", ask, method, path, json.dumps(body) if body is not None else "",
                                        token).stdout
        return said if first_bytes else json.loads(said)

    def page_answers(self):
        ask = "import urllib.request as u; print(u.urlopen('http://127.0.0.1:8080/', timeout=60).read().decode())"
        return "<title>" in self.tree.in_its_network("/usr/bin/python3", "-c", ask).stdout


if __name__ == "__main__":
    if os.geteuid() != 0 or not shutil.which("debootstrap"):
        print("needs root and debootstrap")
        sys.exit(77)
    unittest.main()
