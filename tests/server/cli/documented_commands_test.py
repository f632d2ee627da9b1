#!/usr/bin/env python3
"""Runs every command line that docs/commands.md and each --help show, and checks the exit status that stands there."""
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parents[3]
TOOLS = ("model", "bode", "step", "identify", "estimator", "tune", "discretise", "predict", "profile")
ACCOUNT_TOOLS = ("user", "token", "robot")


def documented():
    """(command, exit status) of each line that begins with `$`."""
    for line in (ROOT / "docs/commands.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("$ "):
            status = re.search(r"# exit status (\d+)", line)
            yield line[2:], int(status.group(1)) if status else 0


def run(command, folder):
    environment = dict(os.environ, PATH=f"{os.environ['RHEONAUT_BIN']}:{os.environ['PATH']}")
    return subprocess.run(["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True)


class DocumentedCommands(unittest.TestCase):
    def test_run_and_exit_as_written(self):
        commands = list(documented())
        self.assertGreaterEqual(len(commands), 15)
        self.assertEqual({command.split()[1] for command, _ in commands}, {*TOOLS, *ACCOUNT_TOOLS})
        with tempfile.TemporaryDirectory() as folder:
            for command, status in commands:
                with self.subTest(command=command):
                    done = run(command, folder)
                    self.assertEqual(done.returncode, status, done.stderr)
                    self.assertEqual(done.stderr, "")
                    self.assertTrue(done.stdout or ">" in command)

    def test_examples_of_help_work(self):
        with tempfile.TemporaryDirectory() as folder:
            run("rheonaut step --every-s 0.02 --until-s 5 --csv > run.csv", folder)
            for tool in TOOLS:
                with self.subTest(tool=tool):
                    shown = run(f"rheonaut {tool} --help", folder).stdout
                    example = re.search(r"^Example: (rheonaut .*)$", shown, re.M).group(1)
                    self.assertEqual(run(example, folder).returncode, 0, example)

    def test_examples_of_account_tools_work(self):
        with tempfile.TemporaryDirectory() as folder:
            for command in ("user add", "token create", "robot enroll", "user", "token", "robot"):
                with self.subTest(command=command):
                    shown = run(f"rheonaut {command} --help", folder).stdout
                    example = re.search(r"^Example: (rheonaut .*)$", shown, re.M).group(1)
                    done = run(f"{example} <<< 'correct horse battery'", folder)
                    self.assertEqual((done.returncode, done.stderr), (0, ""), example)
                    self.assertTrue(done.stdout)

    def test_errors_are_one_line(self):
        with tempfile.TemporaryDirectory() as folder:
            done = run("rheonaut bode --plant none.json", folder)
            self.assertEqual((done.returncode, done.stdout), (1, ""))
            self.assertRegex(done.stderr, r"^rheonaut: none\.json: [^\n]*\n$")
            self.assertEqual(os.listdir(folder), [])
            for command in ("bode", "--help", "--version", "bode --help", "check-config"):
                full = run(f"rheonaut {command} > /dev/full", folder)
                self.assertEqual(full.returncode, 1, command)
                self.assertRegex(full.stderr, r"^rheonaut: [^\n]*\n$")
            loud = run("rheonaut bode --plant $'no\\x1b[1m\\n.json'", folder)
            self.assertRegex(loud.stderr, r"^rheonaut: no\\x1B\[1m\\x0A\.json: [^\n]*\n$")


if __name__ == "__main__":
    unittest.main()
