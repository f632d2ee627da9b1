#!/usr/bin/env python3
"""deploy/arm64 leaves no emulator behind when a signal ends it. All that it calls is a stand-in."""
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[1]
STAND_INS = {"dpkg-query": "echo install ok installed", "cmake": ":", "ninja": "echo 'bin/base_test: phony'",
             "nproc": "echo 3", "qemu-aarch64-static": 'touch "$PARTS/$$"; exec sleep 1000'}


class Arm64Test(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="rheonaut-"))).resolve()
        for place in ("deploy", "build/arm64", "bin", "parts"):
            (self.folder / place).mkdir(parents=True)
        for script in ("arm64", "packages"):
            shutil.copy(ROOT / "deploy" / script, self.folder / "deploy")
        (self.folder / "build/arm64/tree.made").touch()
        for name, does in STAND_INS.items():
            (self.folder / "bin" / name).write_text(f"#!/bin/sh\n{does}\n")
            (self.folder / "bin" / name).chmod(0o755)

    def parts(self):
        return [int(path.name) for path in (self.folder / "parts").iterdir()]

    def running(self):
        def runs(pid):
            try:
                return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")")[1].split()[0] not in "ZX"
            except OSError:
                return False
        return [pid for pid in self.parts() if runs(pid)]

    def wait_until(self, condition):
        deadline = time.monotonic() + 60
        while not condition():
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)

    def end_of(self, number):
        """Its exit status, after this signal to it and to all of its process group, as Ctrl-C sends it."""
        environment = {**os.environ, "PATH": f"{self.folder}/bin:{os.environ['PATH']}", "PARTS": str(self.folder / "parts")}
        script = subprocess.Popen([self.folder / "deploy/arm64"], env=environment, start_new_session=True)
        try:
            self.wait_until(lambda: len(self.parts()) == 3)
            os.killpg(script.pid, number)
            return script.wait(timeout=60)
        finally:
            script.kill()

    def test_a_signal_ends_all_parts(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(number):
                try:
                    self.assertEqual(128 + number, self.end_of(number))
                    self.wait_until(lambda: not self.running())
                finally:
                    for pid in self.running():
                        os.kill(pid, signal.SIGKILL)
                    for path in (self.folder / "parts").iterdir():
                        path.unlink()


if __name__ == "__main__":
    unittest.main()
