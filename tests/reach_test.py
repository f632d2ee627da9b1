#!/usr/bin/env python3
"""Shows deploy/reach.py changes in a small tree and in this one, and what each of them can reach."""
import pathlib
import re
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "deploy"))
import reach  # noqa: E402

SMALL_TREE = {
    "protocol/frame.hpp": "",
    "server/net/listener.hpp": '#include "protocol/frame.hpp"\n',
    "server/net/listener.cpp": '#include "server/net/listener.hpp"\n',
    "server/net/listener_queue.cpp": '#include "server/net/listener.hpp"\n',  # carries out a part of listener.hpp
    "server/api/routes/page.hpp": '#include "server/net/listener.hpp"\n',
    "server/api/openapi.yaml": "",
    "server/main.cpp": '#include "server/api/routes/page.hpp"\n',
    "sim_robot/world/world.hpp": "",
    "sim_robot/main.cpp": '#include "sim_robot/world/world.hpp"\n',
    "tests/server/CMakeLists.txt": "rheonaut_test(net_test STATION\n  SOURCES\n    net/listener_test.cpp\n  LIBRARIES server)\n"
                                   "rheonaut_test(page_test STATION\n  SOURCES\n    page_test.cpp\n    words.cpp)\n",
    "tests/server/net/listener_test.cpp": '#include "server/net/listener.hpp"\nread("listener_cases.json");\n',
    "tests/server/page_test.cpp": '#include "server/api/routes/page.hpp"\n#include "words.hpp"\n',
    "tests/server/words.hpp": "",
    "tests/server/words.cpp": '#include "words.hpp"\nread("docs/page.md");\n',
    "tests/sim_robot/CMakeLists.txt": "rheonaut_test(world_test\n  SOURCES\n    world_test.cpp)\n",
    "tests/sim_robot/world_test.cpp": '#include "sim_robot/world/world.hpp"\n',
    "tests/fuzz/CMakeLists.txt": "rheonaut_test(corpora_test\n  SOURCES\n    corpora_test.cpp\n    frame_fuzz.cpp)\n",
    "tests/fuzz/corpora_test.cpp": 'replay(TEST_DATA_DIR "/fuzz/" + name);\n',
    "tests/fuzz/frame_fuzz.cpp": '#include "protocol/frame.hpp"\n',
    "tests/system/processes.py": "",
    "tests/system/kill_test.py": "from processes import lab\n",
    "tests/system/proxy_test.py": "import os\nfrom cart import Cart\n",
    "examples/cart.py": "",
    "tests/browser/programs.mjs": "",
    "tests/browser/hands.mjs": "",
    "tests/browser/stories.mjs": "",
    "tests/browser/escape_test.mjs": "import { Bench } from './programs.mjs';\n",
    "tests/browser/fleet_test.mjs": "import { hold } from './hands.mjs';\n",
    "tests/browser/runs_test.mjs": "import { Bench } from './programs.mjs';\n",
    "tests/browser/programs_test.mjs": "import { until } from './programs.mjs';\n",
    "tests/check_docs.py": "",
}
PROCESSES = {"test system_stop", "test system_kill", "program goldens_test"}  # after a change of a program


class ReachTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for name, text in SMALL_TREE.items():
            path = self.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")

    def expect(self, changed, reached):
        lines = set(reach.reached(self.root, changed.split()))
        checks = {f"test {name}" for name in reach.CHECKS}
        self.assertLessEqual(checks, lines, "the checks run after every change")
        if changed.endswith(reach.CPP):
            reached = {*reached, "test format"}
        self.assertEqual(lines - checks, set(reached), changed)

    def test_a_source_reaches_what_includes_its_room_and_the_programs(self):
        station = {"program net_test", "program page_test"} | PROCESSES
        self.expect("server/net/listener.hpp", station)
        self.expect("server/net/listener_queue.cpp", station)
        self.expect("server/net/a_deleted_file.cpp", station)
        self.expect("server/api/routes/page.hpp", station - {"program net_test"})
        self.expect("sim_robot/world/world.hpp",
                    {"program world_test", "test rheonaut_sim_.*", "lx106", "test esp8266_check"} | PROCESSES)

    def test_what_all_stand_on_reaches_all_that_include_it(self):
        self.expect("protocol/robot.proto", {"test docs_not_yet", "program net_test", "program page_test", "program corpora_test", "lx106",
                                             "test esp8266_check", "test golden_frames_by_protoc"} | PROCESSES)

    def test_a_test_reaches_itself_and_its_words_all_that_use_them(self):
        self.expect("tests/server/net/listener_test.cpp", {"program net_test"})
        self.expect("tests/server/words.cpp", {"program page_test"})
        self.expect("tests/server/CMakeLists.txt", {"program net_test", "program page_test"})

    def test_what_a_test_reads_reaches_it(self):
        self.expect("docs/page.md", {"program page_test", "test docs_commands", "test docs_not_yet"})
        self.expect("docs/other.md", {"test docs_commands", "test docs_not_yet"})
        self.expect("tests/data/listener_cases.json", {"program net_test"})
        self.expect("tests/data/fuzz/frame/1", {"program corpora_test"})

    def test_what_the_documents_are_compared_with_reaches_their_checks(self):
        for path in ("server/cli/user.cpp", "sim_robot/cli/options.hpp", "server/api/openapi.yaml", "protocol/robot.proto"):
            self.assertIn("test docs_not_yet", reach.reached(self.root, [path]), path)
            self.assertEqual("/cli/" in path, "test docs_commands" in reach.reached(self.root, [path]), path)

    def test_data_that_nobody_names_reaches_every_program(self):
        self.expect("tests/data/new.json", {"program net_test", "program page_test", "program world_test",
                                            "program corpora_test"})

    def test_a_script_reaches_itself_and_those_that_import_it(self):
        self.expect("tests/system/kill_test.py", {"test system_kill"})
        self.expect("tests/system/processes.py", {"test system_kill"})
        self.expect("tests/browser/programs.mjs", {"story escape", "story runs", "test browser_programs"})
        self.expect("tests/browser/escape_test.mjs", {"story escape"})
        self.expect("tests/browser/hands.mjs", {"story fleet"})
        self.expect("tests/browser/stories.mjs", {"story escape"})
        self.expect("tests/browser/programs_test.mjs", {"test browser_programs"})
        self.expect("examples/cart.py", {"test system_proxy"})

    def test_the_page_reaches_its_own_tests_and_one_story(self):
        self.expect("web/src/api.ts", {"test web_.*", "story escape"})
        self.expect("web/tests/api_test.ts", {"test web_.*"})
        self.expect("server/api/openapi.yaml", {"test web_.*", "test docs_not_yet", "program page_test"} | PROCESSES)

    def test_a_script_of_the_project_reaches_the_test_of_it(self):
        self.expect("tests/check_docs.py", {"test docs_test"})
        self.expect("tests/check_docs_test.py", {"test docs_test"})
        self.expect("tests/check_docs_tables.py", {"test docs_test"})
        self.expect("deploy/tidy", {"test tidy_test"})
        self.expect("tests/tidy_test.py", {"test tidy_test"})

    def test_what_decides_how_it_is_built_reaches_everything(self):
        for path in ("CMakeLists.txt", "cmake/rooms.cmake", "tests/CMakeLists.txt", "deploy/test", ".ci/run"):
            self.assertEqual(reach.reached(self.root, ["docs/other.md", path]), ["everything"], path)


class ThisTreeTest(unittest.TestCase):
    def test_every_test_program_is_known(self):
        said = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("CMakeLists.txt"))
        written = set(re.findall(r"^rheonaut_test\((\w+)", said, re.M))
        tree = reach.Tree(ROOT)
        self.assertLessEqual(written, set(tree.programs))
        self.assertGreaterEqual(len(written), 10)
        for name, units in tree.programs.items():
            self.assertTrue(any(node.split("/")[0] in reach.FOLDERS for node in tree.closure(units)), name)

    def test_every_system_test_of_ctest_is_known(self):
        listing = (ROOT / "tests/system/CMakeLists.txt").read_text(encoding="utf-8")
        written = re.search(r"foreach\(name ([^)]*)\)", listing).group(1).split()
        known = {name for name, _, _ in reach.Tree(ROOT).scripts()}
        self.assertLessEqual({f"system_{name}" for name in written}, known)

    def test_what_runs_after_a_change_of_the_programs_and_of_the_page_is_there(self):
        known = {name for name, _, _ in reach.Tree(ROOT).scripts()}
        self.assertLessEqual({*reach.TOGETHER, f"story {reach.STORY}"}, known)

    def test_every_test_of_a_script_is_one_of_ctest(self):
        listing = (ROOT / "tests/CMakeLists.txt").read_text(encoding="utf-8")
        self.assertLessEqual({*reach.SCRIPTS, *reach.CHECKS, "format"}, set(re.findall(r"add_test\(NAME (\w+)", listing)))
        for script in reach.SCRIPTS.values():
            self.assertTrue([*ROOT.glob(script), *ROOT.glob(script + ".py")], script)


if __name__ == "__main__":
    unittest.main()
