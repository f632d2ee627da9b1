#!/usr/bin/env python3
"""What check_not_yet.py finds, with programs, an interface and documents made for it."""
import os
import pathlib
import tempfile
import unittest

import check_commands
import check_not_yet

PROGRAM = """#!/bin/sh
case "$*" in
  "user add --help") printf 'Arguments:\\n  name  The user\\n\\n  -h,--help   Print\\n'; echo "  --role TEXT REQUIRED   viewer or operator" ;;
  "user --help") echo "  -h,--help   Print"; echo "  add        Add one" ;;
  "--help") echo "  -h,--help   Print"; echo "  user       Users" ;;
esac
"""
OPENAPI = """paths:
  /api/v1/robots/{id}:
    get:
      summary: One
components:
  schemas:
    Robot:
      description: One
      properties:
        supply_mv: { type: number, default: 0 }
        sample:
          type: object
          properties:
            cause: { enum: [worn_out, wet,
                            dry] }
"""
PROTO = """message Status {
  optional float motor_current_a = 3;
}
enum StopCause {
  STOP_CAUSE_NONE = 0;  // {}
  STOP_CAUSE_MAIN_SWITCH = 1;
}
"""


def found(text, document="CHANGELOG.md"):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for path, content in {"server/api/openapi.yaml": OPENAPI, "protocol/robot.proto": PROTO, "docs/security.md": "",
                              "rheonaut": PROGRAM, "rheonaut-sim": PROGRAM, document: text}.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(content)
        for name in ("rheonaut", "rheonaut-sim"):
            (root / name).chmod(0o755)
        os.environ["RHEONAUT_BIN"] = folder
        check_commands.help_of.cache_clear()
        return list(check_not_yet.faults(root))


class CheckNotYet(unittest.TestCase):
    def test_what_is_missing_may_be_named(self):
        self.assertEqual([], found("### Not yet\n\n`GET /api/v1/pumps`, `POST /api/v1/robots/{id}`, `rheonaut usr`,\n"
                                   "`rheonaut user add --age`, `--twice`, `supply_w`, `PostgreSQL`,\n"
                                   "`rheonaut user remove`, `rheonaut-sim pause`, `rheonaut-sim --seed 3 user remove`,\n"
                                   "`type`, `description`, `default`, `get`, `name`, `switch`, `current_a`, `Robot`\n"))

    def test_what_exists_may_not(self):
        for name, what in (("GET /api/v1/robots/<id>", "a route of openapi.yaml"),
                           ("/api/v1/robots/{robot_id}", "a route of openapi.yaml"),
                           ("rheonaut user add --role", "a command"), ("user", "a command"),
                           ("--role", "an option of rheonaut user add"), ("supply_mv", "a member or value of openapi.yaml"),
                           ("sample", "a member or value of openapi.yaml"), ("cause", "a member or value of openapi.yaml"),
                           ("worn_out", "a member or value of openapi.yaml"), ("dry", "a member or value of openapi.yaml"),
                           ("rheonaut user add anna", "a command"), ("rheonaut-sim --help water", "a command"),
                           ("motor_current_a", "a field or value of robot.proto"),
                           ("main_switch", "a field or value of robot.proto"),
                           ("STOP_CAUSE_MAIN_SWITCH", "a field or value of robot.proto")):
            self.assertEqual([f"CHANGELOG.md:2: {name} is not missing: it is {what}"], found(f"## Not yet\nnot `{name}`\n"))

    def test_which_lines_are_a_list(self):
        self.assertEqual([], found("`user`\n## Not yet\nnothing\n## Now\n`user` is not yet old\n"))
        self.assertEqual(2, len(found("Not yet available: one,\n`user` and\n`user`.\n\nBut `user`.\n", "docs/a.md")))
        self.assertEqual(1, len(found("- **Not yet**: `user`\n", "README.md")))

    def test_security_says_of_no_test_that_it_has_not_been_run(self):
        for words in ("which has not been run in a release build yet", "not yet run", "has never been run"):
            self.assertEqual(1, len(found(f"| attack | guard | `tests/a`, {words} |\n", "docs/security.md")), words)
        self.assertEqual([], found("the station does not run as root\n", "docs/security.md"))


if __name__ == "__main__":
    unittest.main()
