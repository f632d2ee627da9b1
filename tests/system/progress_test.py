"""What long work and the log write on a terminal: progress on standard error, colours; nothing of either elsewhere."""
import os
import pty
import re
import select
import subprocess
import tempfile
import threading
import time
import unittest

from processes import BIN, lab

# Takes longer than a second: a search from many starts over a recording with noise.
SLOW = ("identify", "--structure", "fractional")


def on_a_terminal(words, is_enough=lambda text: False, **environment):
    """Exit status, standard output, and what a terminal as standard error has got; ended when that is enough."""
    terminal, inner = pty.openpty()
    process = subprocess.Popen([str(BIN / "rheonaut"), *map(str, words)], stdin=subprocess.DEVNULL, stderr=inner,
                               stdout=subprocess.PIPE, text=True, env={**os.environ, "NO_COLOR": "", **environment})
    os.close(inner)
    out = []
    reader = threading.Thread(target=lambda: out.append(process.stdout.read()))
    reader.start()
    shown, is_ended, deadline = b"", False, time.monotonic() + 120
    try:
        while time.monotonic() < deadline:
            if not is_ended and is_enough(shown.decode(errors="replace")):
                process.terminate()
                is_ended = True
            if not select.select([terminal], [], [], 0.2)[0]:
                continue
            try:
                shown += os.read(terminal, 65536)
            except OSError:  # nobody has the other end any more
                break
        status = process.wait(timeout=60)
    finally:
        process.kill()
        reader.join()
        process.stdout.close()
        os.close(terminal)
    return status, out[0], shown.decode(errors="replace")


class ProgressTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.csv = os.path.join(cls.folder.name, "run.csv")
        rows = subprocess.run([str(BIN / "rheonaut"), "step", "--every-s", "0.01", "--until-s", "60", "--csv"], capture_output=True, text=True, timeout=120,
                              check=True).stdout
        with open(cls.csv, "w", encoding="utf-8") as file:
            file.write(rows)

    def test_long_work_shows_one_line_that_is_gone_at_the_end(self):
        _, out, shown = on_a_terminal((*SLOW, "--csv", self.csv))
        lines = shown.split("\r\x1b[K")
        self.assertGreaterEqual(len(lines), 3, shown)
        for line in lines[1:-1]:
            self.assertRegex(line, r"^identify: (fractional: start \d of \d, iteration \d+, sse \S+, )?\d+ s$")
        self.assertIn("iteration", shown)
        self.assertEqual((lines[0], lines[-1]), ("", ""))
        self.assertNotIn("\n", shown)
        for line in lines:
            self.assertLess(len(line), 80)
        seconds = [int(re.search(r"(\d+) s$", line).group(1)) for line in lines[1:-1]]
        self.assertLessEqual(len(lines) - 2, 4 * (seconds[-1] + 1) + 1, "four times a second at most")
        self.assertNotIn("\x1b", out)

    def test_nothing_is_shown_with_json_or_where_nobody_watches(self):
        status, out, shown = on_a_terminal((*SLOW, "--csv", self.csv, "--json"))
        self.assertEqual(shown, "", (status, out))
        done = subprocess.run([str(BIN / "rheonaut"), *SLOW, "--csv", self.csv], capture_output=True, text=True,
                              timeout=120)
        self.assertEqual(done.stderr, "")
        self.assertNotIn("\x1b", done.stdout)

    def test_the_log_has_colours_on_a_terminal_only_and_not_with_NO_COLOR(self):
        with lab() as place:
            words = ("serve", "--data", place.data, "--http", "127.0.0.1:0", "--robots", "127.0.0.1:0")
            for environment, has_colours in (({"TERM": "xterm"}, True), ({"TERM": "xterm", "NO_COLOR": "1"}, False)):
                _, _, shown = on_a_terminal(words, lambda text: "ready: page" in text, **environment)
                self.assertIn("ready: page", shown)
                self.assertEqual(re.search("\x1b\\[[0-9;]*m", shown) is not None, has_colours, shown)


if __name__ == "__main__":
    unittest.main()
