#!/usr/bin/env python3
"""Runs a test in real time, and once more if it fails; never one that docs/safety.md names as the test of a guard.

Usage: second_try.py FOLDER NAME COMMAND...
The output of a failed first try is kept in FOLDER/NAME.txt, whatever the second try says: such a file is a fault to be
mended, and deploy/test prints its name. The exit status is that of the last try.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def guards(root):
    """Paths of the scripts that docs/safety.md names as tests."""
    return set(re.findall(r"`(tests/[\w/]+_test\.(?:py|mjs))", (root / "docs/safety.md").read_text(encoding="utf-8")))


def is_guard(root, command):
    """Whether one of the words is a script that tests a guard, or the name of such a story of the browser."""
    named = {pathlib.PurePath(path).name for path in guards(root)}
    return any(named & {pathlib.PurePath(word).name, f"{word}_test.mjs"} for word in command)


def tried(root, kept, name, command):
    """The exit status of the last try."""
    if is_guard(root, command):
        return subprocess.run(command, check=False).returncode
    first = subprocess.run(command, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    sys.stdout.buffer.write(first.stdout)
    sys.stdout.flush()
    if first.returncode == 0:
        return 0
    kept.mkdir(parents=True, exist_ok=True)
    (kept / f"{name}.txt").write_bytes(first.stdout)
    print(f"second try: {name} ended with {first.returncode}, and runs once more", flush=True)
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    sys.exit(tried(ROOT, pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3:]))
