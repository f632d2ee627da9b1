"""What the station tells the supervisor that started it: the socket of systemd's notify protocol is the test's own."""
import os
import pathlib
import signal
import socket
import time
import unittest
from unittest import mock

from processes import lab, wait_until

WATCHDOG_US = 600_000
WAIT_S = 60


class SupervisionTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab())
        path = self.place.folder / "notify"
        self.socket = self.enterContext(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
        self.socket.bind(str(path))
        self.socket.settimeout(WAIT_S)
        self.environment = {"NOTIFY_SOCKET": str(path), "WATCHDOG_USEC": str(WATCHDOG_US)}

    def start(self):
        with mock.patch.dict(os.environ, self.environment):
            self.place.start_unannounced("127.0.0.1:0", "127.0.0.1:0")
        return self.place.station_process

    def next_word(self):
        return self.socket.recv(4096).decode()

    def nothing_said(self, for_s):
        """Whether nothing comes for so long; what was said before is taken away first."""
        self.socket.settimeout(0)
        try:
            while True:
                self.next_word()
        except BlockingIOError:
            pass
        self.socket.settimeout(for_s)
        try:
            self.next_word()
            return False
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(WAIT_S)

    def test_ready_is_said_once_the_page_answers(self):
        self.start()
        words = dict(line.split("=", 1) for line in self.next_word().splitlines())
        self.assertEqual("1", words["READY"])
        page = words["STATUS"].removeprefix("page http://")
        host, port = page.rsplit(":", 1)
        socket.create_connection((host, int(port)), timeout=WAIT_S).close()

    def test_the_loop_shows_that_it_runs_and_a_halted_one_does_not(self):
        process = self.start()
        self.next_word()
        for _ in range(3):
            self.assertEqual("WATCHDOG=1", self.next_word())
        process.send_signal(signal.SIGSTOP)
        stat = pathlib.Path(f"/proc/{process.pid}/stat")
        wait_until(lambda: stat.read_text().rsplit(")", 1)[1].split()[0] == "T", 60, "the station halted")
        self.assertTrue(self.nothing_said(for_s=2 * WATCHDOG_US / 1e6))
        process.send_signal(signal.SIGCONT)
        self.assertEqual("WATCHDOG=1", self.next_word())

    def test_signs_of_life_are_three_in_each_interval(self):
        self.start()
        self.next_word()
        self.next_word()
        times = []
        for _ in range(7):
            self.next_word()
            times.append(time.monotonic())
        gaps = sorted(b - a for a, b in zip(times, times[1:]))
        # The shortest: a machine that stands still makes gaps longer, never shorter than two that come late together.
        self.assertLess(gaps[0], WATCHDOG_US / 1e6 / 2)

    def test_stopping_is_said_before_it_ends(self):
        process = self.start()
        self.next_word()
        process.send_signal(signal.SIGTERM)
        words = [self.next_word()]
        while words[-1] != "STOPPING=1":
            words.append(self.next_word())
        self.assertEqual(0, process.wait(timeout=WAIT_S))

    def test_without_a_watchdog_only_ready_is_said(self):
        del self.environment["WATCHDOG_USEC"]
        self.start()
        self.assertIn("READY=1", self.next_word())
        self.assertTrue(self.nothing_said(for_s=1))


if __name__ == "__main__":
    unittest.main()
