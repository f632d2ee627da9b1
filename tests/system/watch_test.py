"""`rheonaut watch` with a running station: one table, JSON lines, and a real terminal of 60 columns that is restored."""
import contextlib
import fcntl
import json
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import time
import unittest

from processes import BIN, lab, wait_until


class WatchTest(unittest.TestCase):
    def watch(self, place, *words):
        return subprocess.run([str(BIN / "rheonaut"), "watch", *words, "--data", str(place.data)], capture_output=True,
                              text=True, timeout=120, stdin=subprocess.DEVNULL)

    def test_one_table_shows_the_estimate_and_what_is_stale(self):
        with lab() as place:
            missing = self.watch(place, "--once")
            self.assertEqual((missing.returncode, missing.stdout), (1, ""))
            station = place.start_station()
            robot = place.start_robot(station, "sim-1")
            station.wait_for_robot("sim-1")
            fresh = wait_until(lambda: re.search(r"(?m)^sim-1 +manual +-?\d+\.\d ± \d+\.\d +-?\d+ % +0\.\d s",
                                                 self.watch(place, "--once").stdout), 60, "fresh values")
            self.assertNotIn("\x1b", fresh.string)
            other = self.watch(place, "sim-1", "nobody", "--once")
            self.assertEqual((other.returncode, other.stdout), (1, ""))
            self.assertIn("the station knows no robot 'nobody'", other.stderr)
            line = json.loads(self.watch(place, "sim-1", "--once", "--json").stdout)
            self.assertEqual(line["robot_id"], "sim-1")
            self.assertGreater(line["position_sd_m"], 0)
            station.post("/api/v1/robots/sim-1/emergency-stop")
            wait_until(lambda: "STOPPED: operator" in self.watch(place, "--once").stdout, 60, "the stop")
            robot.send_signal(signal.SIGSTOP)
            try:
                wait_until(lambda: re.search(r"(?m)^sim-1 +\(emergency\) +\(-?\d+\.\d ± \d+\.\d\) +\(0 %\) +(LOST )?\d",
                                             self.watch(place, "--once").stdout), 60, "old values in brackets")
                self.assertTrue(json.loads(self.watch(place, "--once", "--json").stdout)["is_stale"])
            finally:
                robot.send_signal(signal.SIGCONT)

    def test_a_terminal_is_drawn_within_its_width_and_is_as_before_at_the_end(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station, "sim-1")
            station.wait_for_robot("sim-1")
            for end in (lambda process, terminal: process.send_signal(signal.SIGINT),
                        lambda process, terminal: os.write(terminal, b"q")):
                terminal, inner = pty.openpty()
                fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 20, 60, 0, 0))
                before = termios.tcgetattr(inner)
                process = subprocess.Popen([str(BIN / "rheonaut"), "watch", "--data", str(place.data)], stdin=inner,
                                           stdout=inner, stderr=subprocess.DEVNULL)
                try:
                    shown = self.read_until(terminal, lambda text: text.count("sim-1") >= 3)
                    self.assertNotEqual(termios.tcgetattr(inner)[3] & termios.ECHO, termios.ECHO)
                    end(process, terminal)
                    shown += self.read_until(terminal, lambda text: "\x1b[?1049l" in text)
                    self.assertEqual(process.wait(timeout=60), 0)
                    self.assertEqual(termios.tcgetattr(inner), before)
                    self.assertTrue(shown.startswith("\x1b[?1049h\x1b[?25l"))
                    self.assertTrue(shown.rstrip().endswith("\x1b[?25h\x1b[?1049l"))
                    for line in re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "\n", shown).splitlines():
                        self.assertLessEqual(len(line), 60, line)
                finally:
                    process.kill()
                    process.wait()
                    os.close(terminal)
                    os.close(inner)

    @contextlib.contextmanager
    def on_a_terminal(self, place, *words, **environment):
        """`rheonaut watch` on a terminal of its own, which is yielded."""
        terminal, inner = pty.openpty()
        fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 20, 100, 0, 0))
        process = subprocess.Popen([str(BIN / "rheonaut"), "watch", "--data", str(place.data), *words], stdin=inner,
                                   stdout=inner, stderr=subprocess.DEVNULL,
                                   env={**os.environ, "NO_COLOR": "", **environment})
        try:
            yield terminal
        finally:
            process.kill()
            process.wait()
            os.close(terminal)
            os.close(inner)

    def test_colours_mark_a_stop_and_old_values_unless_NO_COLOR_is_set_and_silence_is_said(self):
        with lab() as place:
            station = place.start_station()
            robot = place.start_robot(station, "sim-1")
            station.wait_for_robot("sim-1")
            station.post("/api/v1/robots/sim-1/emergency-stop")
            with self.on_a_terminal(place) as terminal:
                self.read_until(terminal, lambda text: re.search("\x1b\\[1;31msim-1 .*STOPPED: operator.*\x1b\\[0m", text))
                robot.send_signal(signal.SIGSTOP)
                self.read_until(terminal, lambda text: re.search("\x1b\\[2msim-1 ", text))
                robot.send_signal(signal.SIGCONT)
            with self.on_a_terminal(place, NO_COLOR="1") as terminal:
                shown = self.read_until(terminal, lambda text: text.count("STOPPED: operator") >= 2)
                self.assertNotRegex(shown, "\x1b\\[[0-9;]*m")
                place.kill_station()
                shown = self.read_until(terminal, lambda text: text.count("NO ANSWER: ") >= 2)
                self.assertIn("STOPPED: operator", shown.rpartition("\x1b[H")[2] + shown, "the last values stay")
                self.assertNotRegex(shown, "\x1b\\[[0-9;]*m")

    def read_until(self, terminal, is_enough):
        text, deadline = b"", time.monotonic() + 60
        while not is_enough(text.decode(errors="replace")):
            self.assertLess(time.monotonic(), deadline, text)
            if select.select([terminal], [], [], 1)[0]:
                text += os.read(terminal, 65536)
        return text.decode(errors="replace")


if __name__ == "__main__":
    unittest.main()
