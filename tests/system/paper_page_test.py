"""docs/paper.md and the drawings of docs/images/paper are what the programs print; every test that the page names exists.

After an intended change, `deploy/paper` writes them again, or this test with RHEONAUT_RENEW_GOLDENS=1 in its environment.
"""
import difflib
import os
import re
import unittest

from processes import BIN, ROOT

from paper_page import DRAWINGS, PAGE, covered, files, tests_of_the_project, wrapped  # noqa: E402  (of deploy/)
from paper_programs import Programs  # noqa: E402

NUMBER = re.compile(r"\d+(?:\.\d+)?")
MOST_PX = 1.0  # by which a point of a drawing may move on another machine
RENEWS = "RHEONAUT_RENEW_GOLDENS" in os.environ


def difference(then, now):
    return "\n".join(difflib.unified_diff(then.splitlines(), now.splitlines(), "committed", "now", lineterm="", n=0))


class PaperPageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.files = files(Programs(BIN))

    def committed(self, name):
        if RENEWS:
            (ROOT / name).write_text(self.files[name], encoding="utf-8")
        self.assertTrue((ROOT / name).is_file(), f"{name} is missing: deploy/paper makes it")
        return (ROOT / name).read_text(encoding="utf-8")

    def test_the_page_is_what_the_programs_print(self):
        then, now = self.committed(PAGE), self.files[PAGE]
        if then != now:
            self.fail(f"{PAGE} is not what the programs print now; deploy/paper renews it:\n{difference(then, now)}")

    def test_the_drawings_are_what_the_programs_print(self):
        drawings = [name for name in self.files if name.startswith(DRAWINGS)]
        self.assertEqual(len(drawings), 6)
        for name in drawings:
            with self.subTest(name):
                then, now = self.committed(name), self.files[name]
                self.assertEqual(NUMBER.sub("#", then), NUMBER.sub("#", now), f"deploy/paper renews {name}")
                apart = max(abs(float(a) - float(b)) for a, b in zip(NUMBER.findall(then), NUMBER.findall(now)))
                self.assertLess(apart, MOST_PX, f"pixels in {name}; deploy/paper renews it")

    def test_no_other_drawing_is_there(self):
        there = {path.relative_to(ROOT).as_posix() for path in (ROOT / DRAWINGS).iterdir()}
        self.assertEqual(there, set(self.files) - {PAGE})

    def test_every_drawing_has_axes_with_units(self):
        for name, text in self.files.items():
            if name != PAGE:
                self.assertRegex(text, r"<text[^>]*>(time \(s\)|frequency \(rad/s\)|position \(m\))</text></svg>", name)

    def test_what_does_not_hold_has_its_proof(self):
        page = self.files[PAGE]
        broken = re.findall(r"^\| (\d+) \|.*\*\*no\*\* \|$", page, re.M)
        proved = re.findall(r"\(Row (\d+)\.\)", " ".join(page.split()))
        self.assertGreaterEqual(len(broken), 8)
        self.assertLessEqual(set(proved), set(broken))
        self.assertGreaterEqual(len(proved), 8)


class CoveredTest(unittest.TestCase):
    def test_ranges_and_lists(self):
        self.assertEqual(covered(["(8) to (10)", "(2), Table 1"]), {"(8)", "(9)", "(10)", "(2)", "Table 1"})
        self.assertEqual(covered(["Figures 1 to 3, A1", "Figure A2"]), {"Figure 1", "Figure 2", "Figure 3", "Figure A1", "Figure A2"})

    def test_a_test_is_found_by_its_name(self):
        self.assertEqual(tests_of_the_project()["Figure9.DisturbanceIsRejectedWithTwentyPercentOvershoot"],
                         "tests/control/figure_9_test.cpp")
        self.assertNotIn("Figure9.IsNoTest", tests_of_the_project())

    def test_long_lines_are_wrapped_between_words(self):
        self.assertEqual(max(map(len, wrapped("word " * 100).splitlines())), 119)


if __name__ == "__main__":
    unittest.main()
