"""deploy/demo on a terminal and without one: the order of what it says, the key, Ctrl-C at each step, a build that fails.

The station and the robot are the real programs; what installs and builds is a stand-in, in a copy of deploy/."""
import fcntl
import os
import pathlib
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import termios
import unittest

from processes import BIN, ROOT, Station, wait_until

WAIT_S = 100
# Each says what it was called with, and goes on when the test lets it.
STAND_IN = """#!/bin/sh
echo "$(basename "$0") $*" >>"$STAND_INS/calls"
case "$(basename "$0") $*" in
  "sudo -n"*) [ ! -e "$STAND_INS/sudo.asks-each-time" ]; exit ;;
  sudo*apt-get*) trap "" TERM; "$@"; exit ;;  # no signal of a user reaches what belongs to root
  sudo*) exec "$@" ;;
  "id -u") echo 1000; exit ;;
  dpkg-query*zsh*) [ -e "$STAND_INS/installed" ] && echo "install ok installed"; exit 0 ;;
  dpkg-query*) echo "install ok installed"; exit 0 ;;
  apt-get*install*) echo "Setting up zsh"; touch "$STAND_INS/installed"; stops_at=apt ;;
  "cmake --build"*) echo "[1/4] Building one"; stops_at=build ;;
  *) exit 0 ;;
esac
while [ -e "$STAND_INS/$stops_at.stops" ]; do sleep 0.05; done
[ ! -e "$STAND_INS/$stops_at.fails" ] || { echo "[2/4] Building two"; echo "two.cpp:1: error: no"; exit 1; }
"""


class Output:
    """A running deploy/demo, and all that it has said so far."""

    def __init__(self, process, descriptor):
        self.process, self.descriptor, self.text = process, descriptor, ""

    def read(self):
        try:
            while select.select([self.descriptor], [], [], 0)[0]:
                new = os.read(self.descriptor, 65536).decode(errors="replace")
                if not new:
                    break
                self.text += new.replace("\r\n", "\n")
        except OSError:
            pass  # a terminal whose program has ended
        return self.text

    def wait_for(self, words):
        def is_there():
            if words in self.read():
                return True
            if self.process.poll() is not None and words not in self.read():
                raise AssertionError(f"it ended with {self.process.returncode} before it said {words!r}:\n{self.text}")
            return False
        try:
            wait_until(is_there, WAIT_S, words)
        except TimeoutError as error:
            raise AssertionError(f"{error}; it said:\n{self.text}") from None

    def press(self, keys):
        os.write(self.descriptor, keys)

    def end(self):
        """The exit status, once it has ended."""
        wait_until(lambda: self.read() is not None and self.process.poll() is not None, WAIT_S, "the end of deploy/demo")
        self.read()
        return self.process.returncode


class DemoScriptTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="rheonaut-"))).resolve()
        shutil.copytree(ROOT / "deploy", self.folder / "deploy", ignore=shutil.ignore_patterns("__pycache__"))
        (self.folder / "build/release").mkdir(parents=True)
        (self.folder / "build/release/bin").symlink_to(BIN)
        self.stand_ins = self.folder / "stand-ins"
        self.stand_ins.mkdir()
        (self.stand_ins / "installed").touch()
        for name in ("cmake", "apt-get", "dpkg-query", "sudo", "id"):
            (self.stand_ins / name).write_text(STAND_IN)
            (self.stand_ins / name).chmod(0o755)
        self.log = self.folder / "build/demo.log"
        self.environment = {**os.environ, "PATH": f"{self.stand_ins}:{os.environ['PATH']}", "STAND_INS": str(self.stand_ins),
                            "TERM": "dumb", "PYTHONDONTWRITEBYTECODE": "1"}

    def impatient(self, script, seconds_in, now):
        """Its wait in the copy of this script has another length."""
        path = self.folder / "deploy" / script
        text = path.read_text()
        self.assertIn(seconds_in, text)
        path.write_text(text.replace(seconds_in, now))

    def let(self, *names):
        for name in names:
            (self.stand_ins / name).touch()

    def go_on(self, name):
        (self.stand_ins / f"{name}.stops").unlink()

    def on_a_terminal(self, *arguments):
        ours, its = pty.openpty()
        self.addCleanup(os.close, ours)
        demo = self.start(arguments, its, its, lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0))
        os.close(its)
        return Output(demo, ours)

    def without_a_terminal(self, *arguments):
        ours, its = os.pipe()
        self.addCleanup(os.close, ours)
        demo = self.start(arguments, subprocess.DEVNULL, its)
        os.close(its)
        return Output(demo, ours)

    def start(self, arguments, stdin, output, prepare=None):
        demo = subprocess.Popen([self.folder / "deploy/demo", *arguments], stdin=stdin, stdout=output, stderr=output,
                                env=self.environment, start_new_session=True, preexec_fn=prepare)

        def end():
            for pid in self.running():
                os.kill(pid, signal.SIGKILL)
            demo.wait()
        self.addCleanup(end)
        return demo

    def running(self):
        """What the script has started, and itself: all of it has its environment."""
        found = []
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                is_ended = re.search(r"^State:\s+[ZX]", (process / "status").read_text(), re.M)
                if f"STAND_INS={self.stand_ins}".encode() in (process / "environ").read_bytes() and not is_ended:
                    found.append(int(process.name))
            except OSError:
                pass  # it has ended
        return found

    def station(self):
        return Station(next((self.folder / "demo-data").iterdir()))

    def in_order(self, text, *words):
        place = 0
        for word in words:
            self.assertIn(word, text[place:], f"{words} in:\n{text}")
            place = text.index(word, place) + len(word)

    def programs(self, station):
        """In place of the real station, a shell script."""
        folder = self.folder / "build/release/bin"
        folder.unlink()
        folder.mkdir()
        (folder / "rheonaut").write_text("#!/bin/sh\n" + station)
        (folder / "rheonaut").chmod(0o755)
        (folder / "rheonaut-sim").symlink_to(BIN / "rheonaut-sim")

    def experiment_that(self, does):
        """In place of the real one, which takes 45 s and has tests of its own."""
        (self.folder / "deploy/experiment.py").write_text(does)

    def test_the_plan_comes_first_then_the_page_and_a_key_begins_the_experiment(self):
        self.let("build.stops")
        demo = self.on_a_terminal()
        demo.wait_for("25 %, 1 of 4")
        self.in_order(demo.read(), "in four steps", "1 packages", "2 build", "3 station", "4 experiment",
                      "begins when you press Enter", f"in {self.log}", "25 %, 1 of 4")
        demo.press(b"\n\n")  # too early: it must not count
        self.go_on("build")
        demo.wait_for("press Enter to begin. ")
        said = demo.read()
        self.in_order(said, "25 %", "done in", "page: http://", "press Enter to begin. ")
        self.assertIn("\r  2 build", said)
        self.assertNotIn("Building one", said)
        self.assertIn("Building one", self.log.read_text())
        station = self.station()
        station.wait_for_robot("sim-1")
        self.assertEqual([], station.get("/api/v1/runs")["runs"])
        self.assertNotIn("  4 experiment\n", demo.read())
        demo.press(b"\n")
        demo.wait_for("setpoint  100.0 mm")  # it is on its way
        self.assertEqual(1, len(station.get("/api/v1/runs")["runs"]))
        demo.press(b"\x03")
        self.assertEqual(130, demo.end())
        self.assertEqual([], self.running())

    def test_without_a_terminal_it_begins_by_itself_and_stays_up(self):
        self.experiment_that("print('an experiment')\n")
        demo = self.without_a_terminal()
        demo.wait_for("Ctrl-C ends both")
        said = demo.read()
        self.in_order(said, "in four steps", "  2 build        ...\n", "  2 build        done in", "page: http://",
                      "There is no terminal to press Enter on: it begins by itself.", "an experiment", "recorded in",
                      "page: http://", "Ctrl-C ends both")
        self.assertNotIn("\r", said)
        self.assertNotIn("begins when you press Enter", said)
        links = re.findall(r"page: (\S+)", said)
        self.assertEqual(2, len(set(links)), "a link that was used opens nothing")
        demo.process.send_signal(signal.SIGTERM)
        self.assertEqual(143, demo.end())
        self.assertEqual([], self.running())

    def test_once_asks_for_no_key_and_ends(self):
        self.experiment_that("import sys\nprint('an experiment')\nsys.exit(1)\n")
        demo = self.on_a_terminal("--once")
        self.assertEqual(1, demo.end(), demo.text)
        self.in_order(demo.text, "page: http://", "an experiment", "recorded in")
        self.assertNotIn("press Enter", demo.text)
        self.assertEqual([], self.running())

    def test_section_5_begins_with_a_key_and_ends(self):
        (self.folder / "deploy/paper_demo.py").write_text("print('Section 5 is performed')\n")
        demo = self.on_a_terminal("--paper")
        demo.wait_for("press Enter to begin. ")
        demo.press(b"\n")
        self.assertEqual(0, demo.end(), demo.text)
        self.in_order(demo.text, "4 experiments", "6 minutes", "page: http://", "press Enter", "Section 5 is performed")
        self.assertEqual([], self.running())

    def test_ctrl_c_at_each_step_ends_everything(self):
        self.experiment_that("import time\nprint('an experiment', flush=True)\ntime.sleep(1000)\n")
        for step, words in (("apt", "Setting up zsh"), ("build", "1 of 4"), ("key", "press Enter to begin. "),
                            ("experiment", "an experiment")):
            with self.subTest(step):
                (self.stand_ins / "installed").unlink(missing_ok=step != "apt")
                self.let(f"{step}.stops")
                demo = self.on_a_terminal()
                demo.wait_for("press Enter to begin. " if step == "experiment" else words)
                if step == "experiment":
                    demo.press(b"\n")
                    demo.wait_for(words)
                demo.press(b"\x03")
                self.assertEqual(130, demo.end(), demo.text)
                wait_until(lambda: not self.running(), WAIT_S, f"the end of all: {self.running()}")
                self.go_on(step)

    def test_sigterm_ends_an_experiment_in_its_midst(self):
        for name, arguments in (("experiment", ["--once"]), ("paper_demo", ["--paper"])):
            with self.subTest(name):
                (self.folder / f"deploy/{name}.py").write_text(
                    "import subprocess\nsubprocess.run(['sh', '-c', 'echo an experiment; sleep 1000; echo'])\n")
                demo = self.without_a_terminal(*arguments)
                demo.wait_for("an experiment")
                demo.process.send_signal(signal.SIGTERM)
                self.assertEqual(143, demo.end(), demo.text)
                self.assertEqual([], self.running())

    def test_ctrl_d_begins_nothing(self):
        self.experiment_that("print('an experiment')\n")
        demo = self.on_a_terminal()
        demo.wait_for("press Enter to begin. ")
        demo.press(b"\x04")
        os.kill(self.station().endpoints["pid"], signal.SIGKILL)  # which it looks at only as long as it waits for the key
        self.assertEqual(1, demo.end(), demo.text)
        self.assertIn("demo: the station has ended", demo.text)
        self.assertNotIn("4 experiment\n", demo.text)

    def test_a_station_that_does_not_start_is_named(self):
        self.programs(station="echo 'reading the disk'; exec sleep 1000\n")
        self.impatient("demo", "seq 150", "seq 10")  # looks, ten a second
        demo = self.without_a_terminal()
        self.assertEqual(1, demo.end(), demo.text)
        self.in_order(demo.text, "reading the disk", "demo: the station did not start within 15 s")
        self.assertNotIn("Traceback", demo.text)
        self.assertEqual([], self.running())

    def test_a_page_without_a_link_begins_no_experiment(self):
        self.experiment_that("print('an experiment')\n")
        self.programs(station="""echo secret >"$3/rheonaut.token"
echo '{"http": "127.0.0.1:1", "robots": "127.0.0.1:1"}' >"$3/endpoints.json"
exec sleep 1000
""")
        demo = self.without_a_terminal()
        self.assertEqual(1, demo.end(), demo.text)
        self.assertIn("demo: the station gave no link to its page: ", demo.text)
        self.assertNotIn("an experiment", demo.text)
        self.assertEqual([], self.running())

    def test_a_station_that_hangs_is_killed(self):
        self.impatient("demo", "wait_for_end 10", "wait_for_end 1")
        demo = self.on_a_terminal()
        demo.wait_for("press Enter to begin. ")
        os.kill(self.station().endpoints["pid"], signal.SIGSTOP)
        demo.press(b"\x03")
        self.assertEqual(130, demo.end(), demo.text)
        self.assertEqual([], self.running())

    def test_apt_that_no_signal_reaches_is_named_and_left(self):
        self.impatient("steps", "wait_for_end 10", "wait_for_end 1")
        (self.stand_ins / "installed").unlink()
        self.let("apt.stops")
        demo = self.without_a_terminal()
        wait_until(lambda: "Setting up" in self.log.read_text() if self.log.exists() else False, WAIT_S, "apt")
        demo.process.send_signal(signal.SIGTERM)
        self.assertEqual(143, demo.end(), demo.text)
        self.in_order(demo.text, "demo: sudo (process ", ") did not end and goes on\n", "demo: apt-get (process ")
        self.assertNotEqual([], self.running())
        self.go_on("apt")
        wait_until(lambda: not self.running(), WAIT_S, "the end of apt")

    def test_a_sudo_that_asks_each_time_is_not_written_over(self):
        (self.stand_ins / "installed").unlink()
        self.let("sudo.asks-each-time", "build.fails")
        demo = self.on_a_terminal()
        self.assertEqual(1, demo.end(), demo.text)
        self.in_order(demo.text, "sudo may ask for your password.", "Setting up zsh\n", "  2 build")
        self.assertNotIn("\r  1 packages", demo.text)

    def test_a_second_signal_breaks_off_no_ending(self):
        demo = self.on_a_terminal()
        demo.wait_for("press Enter to begin. ")
        station = self.station().endpoints["pid"]
        os.kill(station, signal.SIGSTOP)
        demo.press(b"\x03")
        wait_until(lambda: set(self.running()) == {demo.process.pid, station}, WAIT_S, "the end of the robot")
        demo.process.send_signal(signal.SIGTERM)
        os.kill(station, signal.SIGCONT)
        self.assertEqual(130, demo.end(), demo.text)
        self.assertEqual([], self.running())

    def test_sigterm_ends_a_build(self):
        self.let("build.stops")
        demo = self.without_a_terminal()
        wait_until(lambda: "[1/4]" in self.log.read_text() if self.log.exists() else False, WAIT_S, "the build")
        demo.process.send_signal(signal.SIGTERM)
        self.assertEqual(143, demo.end())
        self.assertEqual([], self.running())

    def test_missing_packages_are_named_before_they_are_installed(self):
        (self.stand_ins / "installed").unlink()
        self.let("apt.stops")
        demo = self.without_a_terminal("--once")
        demo.wait_for("  1 packages     ...\n")
        self.in_order(demo.read(), "apt installs these 1", "zsh", "2 build", "  1 packages     ...\n")
        self.go_on("apt")
        demo.wait_for("  1 packages     done in")
        demo.wait_for("  2 build        done in")
        calls = (self.stand_ins / "calls").read_text()
        self.in_order(calls, "apt-get -o Acquire::Retries=5 install", "cmake --build --preset release")

    def test_a_first_build_that_fails_shows_the_end_of_its_log(self):
        (self.folder / "build/release/bin").unlink()
        self.let("build.fails")
        for start in (self.on_a_terminal, self.without_a_terminal):
            demo = start()
            self.assertEqual(1, demo.end(), demo.text)
            self.in_order(demo.text, "8 minutes or more", "failed after", f"The end of {self.log}", "two.cpp:1: error: no",
                          f"all that it printed is in {self.log}")
            self.assertNotIn("3 station      page", demo.text)
            self.assertEqual([], self.running())
            self.assertFalse((self.folder / "demo-data").exists())


if __name__ == "__main__":
    unittest.main()
