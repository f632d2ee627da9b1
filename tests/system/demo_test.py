"""`rheonaut demo`: both programs start, the robot gets to 0.1 m, and nothing stays behind. Real processes."""
import json
import pathlib
import re
import signal
import sqlite3
import subprocess
import tempfile
import unittest
import urllib.request

from processes import BIN, Station, wait_until

WAIT_S = 250


def running_in(folder):
    """Processes whose command line names the folder."""
    found = []
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            if str(folder).encode() in (process / "cmdline").read_bytes():
                found.append(process.name)
        except OSError:
            pass  # it has ended
    return found


class Demo:
    """`rheonaut demo` as a process, in a folder of its own, and what it says."""

    def __init__(self, folder, *flags):
        self.data = folder / "demo"
        self.output, self.errors = folder / "output", folder / "errors"
        with open(self.output, "w") as output, open(self.errors, "w") as errors:
            self.process = subprocess.Popen([str(BIN / "rheonaut"), "demo", "--data", str(self.data), *flags], stdout=output,
                                            stderr=errors, stdin=subprocess.DEVNULL)

    def said(self):
        return self.output.read_text() + self.errors.read_text()

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


class DemoTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """Those that perform the whole experiment begin together, and the other tests run meanwhile."""
        cls.that_stays = cls.started_for_all()
        cls.that_ends = cls.started_for_all("--once", "--json")

    @classmethod
    def started_for_all(cls, *flags):
        demo = Demo(pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory(prefix="rheonaut-"))), *flags)
        cls.addClassCleanup(demo.end)
        return demo

    def start(self, *flags):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="rheonaut-")))
        self.demo = Demo(self.folder, *flags)
        self.data, self.said = self.demo.data, self.demo.said
        self.addCleanup(self.demo.end)
        return self.demo.process

    def test_the_robot_gets_to_the_setpoint_and_the_link_opens_the_page(self):
        demo = self.that_stays
        link = wait_until(lambda: re.search(r"^page: (http\S+)$", demo.said(), re.M), 60, "the link to the page")[1]
        with urllib.request.urlopen(link, timeout=60) as answer:
            self.assertIn(b"<title>", answer.read())
        # A machine that stood still has the experiment aborted, as it must be; then there is no table.
        wait_until(lambda: "The station and the robot stay up" in demo.said(), WAIT_S, "the end of the experiment")
        if ") is aborted" not in demo.said():
            self.assertRegex(demo.said(), r"setpoint 100\.0 mm   seen by the controller +(9\d|10\d)\.\d mm   estimated position +(9\d|10\d)\.\d ± \d+\.\d mm")
            self.assertRegex(demo.said(), r"samples: [34]\d{3} recorded, 0 lost")
        wait_until(lambda: Station(demo.data).robot("sim-1")["link"] == "connected", 60, "the robot is there")
        demo.process.send_signal(signal.SIGINT)
        self.assertEqual(0, demo.process.wait(timeout=60))
        self.assertEqual([], running_in(demo.data))
        with sqlite3.connect(f"file:{demo.data / 'station.sqlite'}?mode=ro", uri=True) as database:
            self.assertEqual(1, database.execute("SELECT count(*) FROM run").fetchone()[0])

    def test_to_a_program_it_gives_one_json_document_and_nothing_else_on_standard_output(self):
        demo = self.that_ends
        status = demo.process.wait(timeout=WAIT_S)
        document = json.loads(demo.output.read_text())
        self.assertEqual(["experiment", "steps", "samples_stored", "samples_lost", "database"], list(document))
        self.assertIn("Experiment of Figure 7", demo.errors.read_text())
        # A machine that stood still has the experiment aborted, as it must be.
        self.assertEqual(0 if document["experiment"]["state"] == "done" else 5, status, demo.said())
        if status == 0:
            self.assertEqual("setpoint", document["steps"][0]["cause"])
            with sqlite3.connect(f"file:{document['database']}?mode=ro", uri=True) as database:
                stored = database.execute("SELECT count(*) FROM run_sample WHERE run_id = 1").fetchone()[0]
            self.assertEqual(stored, document["samples_stored"])
            self.assertEqual(0, document["samples_lost"])
        self.assertEqual([], running_in(demo.data))

    def test_an_experiment_that_is_aborted_is_said_on_standard_error(self):
        process = self.start("--once")
        wait_until(lambda: "setpoint 100.0 mm" in self.said() or process.poll() is not None, 100, "the robot on its way")
        subprocess.run([str(BIN / "rheonaut"), "stop", "--data", str(self.data)], capture_output=True, timeout=60)
        self.assertEqual(5, process.wait(timeout=WAIT_S), self.said())
        self.assertRegex(self.demo.errors.read_text(), r"^rheonaut: experiment 1 \(Figure 7.*\) is aborted: ")
        self.assertNotIn("aborted", self.demo.output.read_text())

    def test_json_is_for_a_demo_that_ends(self):
        folder = self.enterContext(tempfile.TemporaryDirectory(prefix="rheonaut-"))
        refused = subprocess.run([str(BIN / "rheonaut"), "demo", "--json"], cwd=folder, capture_output=True, text=True,
                                 timeout=60)
        self.assertEqual(2, refused.returncode)
        self.assertIn("--once", refused.stderr)

    def test_an_interrupt_in_the_middle_of_the_experiment_ends_it(self):
        for _ in range(5):  # a machine that stood still has the experiment aborted, as it must be
            process = self.start()
            wait_until(lambda: "setpoint 100.0 mm" in self.said() or "stay up" in self.said(), 100, "the robot on its way")
            if "stay up" not in self.said():
                break
            self.demo.end()
        process.send_signal(signal.SIGINT)
        self.assertEqual(0, process.wait(timeout=60), self.said())
        self.assertIn("ended", self.said())
        self.assertEqual([], running_in(self.data))

    def test_nothing_outlives_a_demo_that_is_killed(self):
        process = self.start()
        wait_until(lambda: (self.data / "endpoints.json").exists(), 60, "the station")
        wait_until(lambda: len(running_in(self.data)) >= 2, 60, "its processes")
        process.kill()
        process.wait()
        wait_until(lambda: not running_in(self.data), 60, "the end of what it had started")

    def test_a_second_one_in_the_same_folder_says_who_is_there(self):
        self.start()
        wait_until(lambda: (self.data / "endpoints.json").exists(), 60, "the station")
        second = subprocess.run([str(BIN / "rheonaut"), "demo", "--data", str(self.data), "--once"], capture_output=True,
                                text=True, timeout=60)
        self.assertEqual(1, second.returncode)
        station = json.loads((self.data / "endpoints.json").read_text())
        self.assertIn(f"rheonaut serve (pid {station['pid']}) uses '{self.data}'; stop it", second.stderr)


if __name__ == "__main__":
    unittest.main()
