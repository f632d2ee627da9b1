#!/usr/bin/env python3
"""Runs every command line that docs/commands.md and each --help show, and checks the exit status that stands there; and
those of the other documents that need neither a station nor what an earlier command of a station has made."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "tests"))

from check_commands import documents, lines_of_code  # noqa: E402

TOOLS = ("model", "bode", "step", "identify", "estimator", "tune", "discretise", "predict", "profile")
ACCOUNT_TOOLS = ("user", "token", "robot")
# What runs by itself, and what of it needs a station or its files all the same.
ALONE = re.compile(r"rheonaut (profile|tune|predict|user|token|certificate)\b|rheonaut-sim (scenarios|play)\b")
NOT_ALONE = re.compile(r"--plant |--run |--design |[A-Z]{4}|…|\[")


def documented():
    """(command, exit status) of each line that begins with `$`."""
    for line in (ROOT / "docs/commands.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("$ "):
            status = re.search(r"# exit status (\d+)", line)
            yield line[2:], int(status.group(1)) if status else 0


def alone():
    """(document, its lines of code blocks that run without a station), in their order."""
    for name, text in documents(ROOT):
        lines = text.splitlines()
        commands = [code for number, code in lines_of_code(text)
                    if ALONE.match(code) and not NOT_ALONE.search(code.split(" #")[0]) and lines[number - 1].startswith(code[:9])]
        if name != "docs/commands.md" and commands:
            yield name, commands


def run(command, folder, text=None):
    environment = dict(os.environ, PATH=f"{os.environ['RHEONAUT_BIN']}:{os.environ['PATH']}")
    return subprocess.run(["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, input=text)


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
                    if status == 0:
                        self.assertEqual(done.stderr, "")
                        self.assertTrue(done.stdout or ">" in command)
                    else:
                        self.assertRegex(done.stderr, r"^rheonaut: .+\n$")

    def test_commands_of_other_documents_run(self):
        found = list(alone())
        self.assertGreaterEqual(len(found), 4)
        for document, commands in found:
            with tempfile.TemporaryDirectory() as folder:
                for command in commands:
                    with self.subTest(document=document, command=command):
                        done = run(command, folder, "correct horse battery\n")
                        self.assertEqual(done.returncode, 0, done.stderr)

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
            for command in ("user add", "token create", "robot enrol", "user", "token", "robot"):
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
