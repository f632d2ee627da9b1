#!/usr/bin/env python3
"""Tests of second_try.py: what is tried twice, what is kept of it, and that no test of a guard ever is."""
import contextlib
import io
import os
import pathlib
import sys
import tempfile
import unittest

import second_try

PASSES_AT = """
import pathlib
tries = pathlib.Path(__file__).with_suffix(".tries")
number = len(tries.read_text()) + 1 if tries.exists() else 1
tries.write_text("x" * number)
print("this is try", number)
raise SystemExit(0 if number >= {passes_at} else 3)
"""


class SecondTryTest(unittest.TestCase):
    def setUp(self):
        self.root = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory())).resolve()
        (self.root / "docs").mkdir()
        (self.root / "docs/safety.md").write_text("| `tests/system/guard_test.py test_a_stop` | `tests/browser/escape_test.mjs` \"x\" |")
        (self.root / "tests/system").mkdir(parents=True)
        self.kept = self.root / "kept"

    def run_script(self, name, passes_at):
        script = self.root / "tests/system" / name
        script.write_text(PASSES_AT.format(passes_at=passes_at))
        with self.assert_prints() as printed:
            status = second_try.tried(self.root, self.kept, name.removesuffix("_test.py"), [sys.executable, str(script)])
        return status, len(script.with_suffix(".tries").read_text()), printed.getvalue()

    @contextlib.contextmanager
    def assert_prints(self):
        """What the wrapper and its children print."""
        text = io.StringIO()
        with tempfile.TemporaryFile("w+") as file:
            sys.stdout.flush()
            before = os.dup(1)
            os.dup2(file.fileno(), 1)
            try:
                yield text
            finally:
                sys.stdout.flush()
                os.dup2(before, 1)
                os.close(before)
                file.seek(0)
                text.write(file.read())

    def test_one_that_passes_runs_once_and_leaves_no_file(self):
        status, tries, _ = self.run_script("calm_test.py", passes_at=1)
        self.assertEqual((status, tries), (0, 1))
        self.assertFalse(self.kept.exists())

    def test_one_that_fails_once_passes_and_its_failure_is_kept_and_printed(self):
        status, tries, printed = self.run_script("hasty_test.py", passes_at=2)
        self.assertEqual((status, tries), (0, 2))
        self.assertEqual((self.kept / "hasty.txt").read_text(), "this is try 1\n")
        self.assertIn("this is try 1\nsecond try: hasty ended with 3, and runs once more\n", printed)

    def test_one_that_fails_twice_fails_and_is_not_tried_a_third_time(self):
        status, tries, _ = self.run_script("broken_test.py", passes_at=3)
        self.assertEqual((status, tries), (3, 2))
        self.assertTrue((self.kept / "broken.txt").exists())

    def test_the_test_of_a_guard_is_never_tried_twice(self):
        status, tries, _ = self.run_script("guard_test.py", passes_at=2)
        self.assertEqual((status, tries), (3, 1))
        self.assertFalse(self.kept.exists())

    def test_it_reads_the_names_of_the_guards_from_the_document_itself(self):
        named = second_try.guards(second_try.ROOT)
        self.assertIn("tests/system/emergency_stop_test.py", named)
        self.assertIn("tests/browser/escape_test.mjs", named)
        self.assertTrue(all((second_try.ROOT / path).exists() for path in named), named)
        self.assertTrue(second_try.is_guard(second_try.ROOT, ["python3", "-B", "tests/system/emergency_stop_test.py", "-v"]))
        self.assertTrue(second_try.is_guard(second_try.ROOT, ["node", "tests/browser/stories.mjs", "cockpit", "escape"]))
        self.assertFalse(second_try.is_guard(second_try.ROOT, ["node", "tests/browser/stories.mjs", "cockpit"]))


if __name__ == "__main__":
    unittest.main()
