#!/usr/bin/env python3
"""Each kind of fault that check_docs.py finds, in a folder made for it."""
import pathlib
import tempfile
import unittest

from check_docs import faults


def found(document):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "tests").mkdir()
        (root / "tests/a_test.cpp").write_text("int before;\nint one;\nint two;\n")
        (root / "README.md").write_text(document)
        return list(faults(root))


class CheckDocs(unittest.TestCase):
    def test_links_and_paths(self):
        self.assertEqual(found("[a](tests/a_test.cpp) and `tests/a_test`\n"), [])
        self.assertEqual(found("\n[a](gone.md)\n"), ["README.md:2: the link to gone.md leads nowhere"])
        self.assertEqual(found("`tests/gone_test`\n"), ["README.md:1: there is no tests/gone_test"])

    def test_anchors(self):
        self.assertEqual(found("# What next\n\n## Robot's `LED`\n## a\n## a\n[a](#what-next) [b](README.md#robots-led) [c](#a-1)\n"), [])
        self.assertEqual(found("# One\n```\n# two\n[x](gone.md)\n```\n[a](#two)\n"),
                         ["README.md:6: this page has no heading for #two"])
        self.assertEqual(found("[a](tests/a_test.cpp#L3)\n"), ["README.md:1: tests/a_test.cpp has no heading for #L3"])

    def test_code_that_names_its_file_stands_there(self):
        self.assertEqual(found("```cpp tests/a_test.cpp\nint one;\nint two;\n```\n"), [])
        self.assertEqual(found("a\n```cpp tests/a_test.cpp\nint one;\nint three;\n```\n"),
                         ["README.md:2: this code does not stand in tests/a_test.cpp"])
        self.assertEqual(found("```cpp tests/b_test.cpp\nint one;\n```\n"),
                         ["README.md:1: there is no tests/b_test.cpp to quote"])
        self.assertEqual(found("```cpp\nint anything;\n```\n```proto set_duty\nwords\n```\n"), [])

    def test_the_stations_events_have_rows(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {"docs/database.md": "## Events\n\n| `gone`, `control_taken` | when |\n\n## End\n",
                               "server/station/a.cpp": 'note(robot, "connected", words);\n'
                                                       'return Change{robot, "control_taken", by};\n'}.items():
                (root / path).parent.mkdir(parents=True)
                (root / path).write_text(text)
            self.assertEqual(list(faults(root)), ["docs/database.md: no row for the event connected of the station",
                                                  "docs/database.md: the station makes no event gone"])

    def test_the_reasons_to_end_a_connection_have_rows(self):
        rows = "### Why a connection ends\n\n| `late` | when |\n| `refusal: detail` | refused |\n| `taken over by …` | when |\n| `gone` | when |\n\nThe robot ends it\n"
        code = {"server/link/robot_session.cpp": 'constexpr auto kFault = "a fault";\n'
                                                 '  if (!has_come) close_reason_ = "late";\n'
                                                 '  close_reason_ = is_odd ? kOdd : "odd";\n'
                                                 '  co_return "silent";\n'
                                                 '  close_reason_ = text(refusal) + ": " + detail;\n',
                "server/station/a.cpp": 'previous->close(fmt::format("taken over by {}", peer));\n',
                "server/api/a.cpp": 'parts.station.end_connection(*id, "revoked");\n'}
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {"docs/protocol.md": rows, **code}.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            found = [fault for fault in faults(root) if "end" in fault]
        self.assertEqual(found, [f"docs/protocol.md: no row for the end of a connection “{reason}”"
                                 for reason in ("a fault", "odd", "revoked", "silent")]
                         + ["docs/protocol.md: no connection ends by “gone”"])

    def test_the_sizing_table_has_measured_figures(self):
        with tempfile.TemporaryDirectory() as folder:
            docs = pathlib.Path(folder) / "docs"
            docs.mkdir()
            (docs / "operations.md").write_text("## Sizing\n\nabout 9 MB\n| 1 | 19 MB |\n| 2 | 2.2 µs |\n| 3 | 7 MB |\n\n## End\n")
            (docs / "performance.md").write_text("19\nMB resident, 12.2 µs and 47 MB\n")
            self.assertEqual(list(faults(pathlib.Path(folder))), ["docs/operations.md: docs/performance.md has no 2.2 µs",
                                                                  "docs/operations.md: docs/performance.md has no 7 MB"])

    def test_decisions_have_numbers_without_doubles_and_unexplained_holes(self):
        with tempfile.TemporaryDirectory() as folder:
            decisions = pathlib.Path(folder) / "docs/decisions"
            decisions.mkdir(parents=True)
            for name in ("0001-a.md", "0002-b.md", "0002-c.md", "0005-d.md"):
                (decisions / name).touch()
            (decisions / "README.md").write_text("Not assigned: 0001, 0003. So be it.\n\n"
                                                 "| [0001](0001-a.md) | a |\n| [0002](0002-b.md) | b |\n"
                                                 "| [0002](0002-c.md) | c |\n")
            self.assertEqual(list(faults(pathlib.Path(folder))), [
                "docs/decisions: the number 0002 is given twice", "docs/decisions: there is no decision 0004",
                "docs/decisions/README.md: 0001 is a decision", "docs/decisions/README.md: no row for 0005-d.md"])


if __name__ == "__main__":
    unittest.main()
