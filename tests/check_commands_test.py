#!/usr/bin/env python3
"""What check_commands.py finds, with programs and documents made for it."""
import os
import pathlib
import tempfile
import unittest

import check_commands

PROGRAM = """#!/bin/sh
case "$*" in
  "user add --help") printf 'Arguments:\\n  name  The user\\n\\n'; echo "  --role TEXT REQUIRED   viewer or operator"; echo "  -f,--force" ;;
  "user --help") echo "Subcommands:"; echo "  add        Add one" ;;
  *) echo "Options:"; echo "  --version   Print it"; echo "Subcommands:"; echo "  user       Users" ;;
esac
"""


def found(document):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name in ("deploy", "examples"):
            (root / name).mkdir()
        for path, text in {"rheonaut": PROGRAM, "rheonaut-sim": PROGRAM, "deploy/demo": "#!/bin/sh\n# --once\n",
                           "examples/cart.py": "# --station\n"}.items():
            (root / path).write_text(text)
            (root / path).chmod(0o755)
        (root / "README.md").write_text(document)
        os.environ["RHEONAUT_BIN"] = folder
        check_commands.help_of.cache_clear()
        return list(check_commands.faults(root))


class CheckCommands(unittest.TestCase):
    def test_commands_that_parse(self):
        for line in ("rheonaut user add anna --role viewer -f", "X=1 build/release/bin/rheonaut user add a > b.json",
                     "cat a | rheonaut user --help", "rheonaut-sim --version water", "deploy/demo --once   # --twice",
                     "rheonaut user add \\\n  --role a", "curl --no-such rheonaut", "examples/cart.py --station a:1"):
            self.assertEqual(found(f"```sh\n{line}\n```\n"), [], line)
        self.assertEqual(found("```json\nrheonaut --no\n```\n```cpp a.cpp\nrheonaut --no\n```\n"), [])

    def test_commands_that_do_not(self):
        for line, fault in (("rheonaut usr add anna", "rheonaut has no command usr"),
                            ("rheonaut user remove anna", "rheonaut user has no command remove"),
                            ("rheonaut-sim pause", "rheonaut-sim has no command pause"),
                            ("a && rheonaut user add anna --rule viewer", "rheonaut user add has no option --rule"),
                            ("$(rheonaut-sim --statoin x)", "rheonaut-sim has no option --statoin"),
                            ("deploy/demo --twice", "deploy/demo has no option --twice"),
                            ("deploy/demos --once", "there is no deploy/demos"),
                            ("examples/cart.py --statoin a:1", "examples/cart.py has no option --statoin")):
            self.assertEqual(found(f"one\n```\n{line}\n```\n"), [f"README.md:3: {fault}"])
        self.assertEqual(found("run `rheonaut user add --no`\n"), ["README.md:1: rheonaut user add has no option --no"])


if __name__ == "__main__":
    unittest.main()
