#!/usr/bin/env python3
"""What check_messages.py finds, in a folder made for it."""
import pathlib
import tempfile
import unittest

from check_messages import faults

SOURCE = 'fail("robot \'{}\' is away; "\n     "wait {} s", name);\nenum { motor_on };\n'


def found(first_column):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "server").mkdir()
        (root / "server/a.cpp").write_text(SOURCE)
        (root / "docs").mkdir()
        (root / "docs/troubleshooting.md").write_text(f"| message | cause |\n|---|---|\n| {first_column} | `no message` |\n")
        return list(faults(root))


class CheckMessages(unittest.TestCase):
    def test_messages_of_the_sources_pass(self):
        for column in ("`robot '…' is away; wait … s`", "`is away`, `motor_on`", "the light is off"):
            self.assertEqual(found(column), [], column)

    def test_others_are_named_with_their_line(self):
        for message in ("robot '…' is gone", "wait … s … is away", "motor_off"):
            self.assertEqual(found(f"`{message}`"), [f"docs/troubleshooting.md:3: no program says '{message}'"])


if __name__ == "__main__":
    unittest.main()
