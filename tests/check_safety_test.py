#!/usr/bin/env python3
"""Each kind of fault that check_safety.py finds, in a folder made for it."""
import pathlib
import tempfile
import unittest

from check_safety import faults

ROW = '| 1.1 | it goes on | `robot_fw/a.cpp`: "off at once" | `Stop.Acts`<br>`tests/system/stop_test.py test_all`<br>' \
      '`web/tests/a.ts` "it stops" | 10 ms |\n'
FILES = {
    "docs/safety.md": "## Hazards\n" + ROW + '## The others\n| 1.1 | `server/b.hpp`: "first" |\n'
                      '## The page\n| 1.1 | `web/src/c.tsx`: "one press" | `tests/browser/keys_test.mjs` "a press stops" |\n',
    "robot_fw/a.cpp": "int a;  // SAFETY: off at once\n",
    "server/b.hpp": "// Sends. SAFETY: first\n",
    "tests/CMakeLists.txt": "a_test.cpp\n",
    "tests/a_test.cpp": "TEST(Stop, Acts) {}\nTEST_F(Stop, Waits) {}\n",
    "tests/system/CMakeLists.txt": "foreach(name stop)\n",
    "tests/system/stop_test.py": "class A:\n    def test_all(self):\n",
    "tests/browser/CMakeLists.txt": "browser_stories(browser_stops keys)\n",
    "tests/browser/keys_test.mjs": "  async 'a press stops'() {\n",
    "web/src/c.tsx": "{/* SAFETY: one press */}\n",
    "web/tests/a.ts": "test('it stops', () => {});\n",
}


def found(**changes):
    """The faults of FILES with some changed: a name's __ is /, and _dot_ is a point."""
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for path, text in {**FILES, **{name.replace("__", "/").replace("_dot_", "."): text for name, text in changes.items()}}.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text)
        return list(faults(root))


class CheckSafety(unittest.TestCase):
    def test_a_page_that_agrees_with_the_code(self):
        self.assertEqual(found(), [])

    def test_a_guard_without_a_row(self):
        self.assertEqual(found(robot_fw__c_dot_cpp="// SAFETY: new\n"), ['robot_fw/c.cpp has a guard without a row: "new"'])
        self.assertEqual(found(robot_fw__a_dot_cpp="// SAFETY: off at once\n// SAFETY: off at once\n"),
                         ['robot_fw/a.cpp has a guard without a row: "off at once"'])

    def test_a_guard_that_was_removed_or_reworded(self):
        self.assertEqual(found(server__b_dot_hpp=""), ['server/b.hpp has no guard "first"'])
        self.assertEqual(found(robot_fw__a_dot_cpp="// SAFETY: off\n"), ['robot_fw/a.cpp has a guard without a row: "off"',
                                                                         'robot_fw/a.cpp has no guard "off at once"'])

    def test_a_test_that_was_removed_renamed_or_is_not_run(self):
        self.assertEqual(found(tests__a_test_dot_cpp="// TEST(Stop, Acts) {}\n"), ["row 1.1: no test Stop.Acts"])
        self.assertEqual(found(tests__a_test_dot_cpp="TEST(Stop, DISABLED_Acts) {}\n"), ["row 1.1: no test Stop.Acts"])
        self.assertEqual(found(tests__CMakeLists_dot_txt=""), ["row 1.1: no test Stop.Acts"])
        self.assertEqual(found(tests__system__stop_test_dot_py="    def test_one(self):\n"),
                         ["row 1.1: no test tests/system/stop_test.py test_all"])
        self.assertEqual(found(tests__system__CMakeLists_dot_txt=""), ["row 1.1: no test tests/system/stop_test.py test_all"])
        self.assertEqual(found(web__tests__a_dot_ts="test('it goes on')"), ['row 1.1: no test web/tests/a.ts "it stops"'])

    def test_a_guard_of_the_page_has_a_test(self):
        self.assertEqual(found(web__src__d_dot_css="/* SAFETY: grey */\n"), ['web/src/d.css has a guard without a row: "grey"'])
        self.assertEqual(found(tests__browser__keys_test_dot_mjs="async 'a key stops'() {"),
                         ['row 1.1, `web/src/c.tsx`: "one press": no test tests/browser/keys_test.mjs "a press stops"'])
        self.assertEqual(found(tests__browser__CMakeLists_dot_txt="browser_stories(browser_stops runs)"),
                         ['row 1.1, `web/src/c.tsx`: "one press": no test tests/browser/keys_test.mjs "a press stops"'])
        page = FILES["docs/safety.md"].replace(' | `tests/browser/keys_test.mjs` "a press stops" |', " |")
        self.assertEqual(found(docs__safety_dot_md=page), ['row 1.1 names no test of `web/src/c.tsx`: "one press"'])

    def test_a_story_that_is_named_is_among_its_like(self):
        mixed = "browser_stories(browser_stops keys runs)\nbrowser_stories(browser_others runs)\n"
        self.assertEqual(found(tests__browser__CMakeLists_dot_txt=mixed),
                         ["browser_stops has a story that is named here beside runs, which is not"])

    def test_rows_are_complete_and_stand_once(self):
        page = FILES["docs/safety.md"]
        self.assertEqual(found(docs__safety_dot_md=page + "| 1.2 | 3 ms | 4 mm | 5 | 6 |\n"), ["there is no row 1.2"])
        self.assertEqual(
            found(docs__safety_dot_md=page.replace("## The", "| 1.2 | it goes on |  | `Stop.Waits` | 1 s |\n## The")), ["row 1.2 names no guard"])
        self.assertIn("row 1.2 has no bound", found(docs__safety_dot_md=page.replace("## The", "| 1.2 | x | - | `Stop.Waits` |  |\n## The")))
        self.assertIn("row 1.1 stands there twice", found(docs__safety_dot_md=page.replace("## The", ROW + "## The")))


if __name__ == "__main__":
    unittest.main()
