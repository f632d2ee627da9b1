#!/usr/bin/env python3
"""Shows deploy/tidy a small tree: names that are wrong, a header that does not include what it needs, and files that are
compiled in a group."""
import importlib.machinery
import importlib.util
import json
import pathlib
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[1]
loader = importlib.machinery.SourceFileLoader("tidy", str(ROOT / "deploy/tidy"))
tidy = importlib.util.module_from_spec(importlib.util.spec_from_loader("tidy", loader))
loader.exec_module(tidy)


class TidyTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        tidy.ROOT = self.root = pathlib.Path(folder.name).resolve()
        self.addCleanup(setattr, tidy, "ROOT", ROOT)
        self.write(".clang-tidy", (ROOT / ".clang-tidy").read_text(encoding="utf-8"))
        self.group = self.write("build/unity_0_cxx.cxx", f'#include "{self.root}/base/good.cpp"\n'
                                                         f'#include "{self.root}/base/bad.cpp"\n')
        self.write("base/length.hpp", "#pragma once\nint length_mm();\n")
        self.write("base/good.cpp", '#include "base/length.hpp"\nint length_mm() { return 1; }\n')
        self.write("base/bad.cpp", "// A name that is wrong.\nint LengthMm() { return 1; }\n")
        command = f"/usr/bin/clang++-19 -Xclang -include-pch -Xclang a.pch -Xclang -include -Xclang a.hxx -I{self.root} -o a.o -c {self.group}"
        self.write("build/compile_commands.json",
                   json.dumps([{"directory": str(self.root), "command": command, "file": str(self.group)}]))
        self.commands = tidy.commands_of(self.root / "build")

    def write(self, name, text):
        path = self.root / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def findings(self, *files):
        for entry in self.commands.values():
            for each in ("command", "unit_command"):
                entry[each] = tidy.PRECOMPILED.sub("", entry[each])  # which this tree does not have
        return "\n".join(tidy.findings(files, self.commands))

    def test_a_file_of_a_group_is_looked_at_by_itself(self):
        self.assertEqual(set(self.commands), {"base/good.cpp", "base/bad.cpp"})
        self.assertIn(f"-c {self.root}/base/bad.cpp", self.commands["base/bad.cpp"]["command"])

    def test_a_group_that_is_asked_for_whole_is_read_once(self):
        both = ["base/good.cpp", "base/bad.cpp"]
        self.assertEqual(list(tidy.units_of(both, self.commands)), [(str(self.group), both)])
        self.assertEqual(list(tidy.units_of(both[:1], self.commands)), [(f"{self.root}/base/good.cpp", both[:1])])

    def test_a_wrong_name_is_an_error(self):
        self.assertEqual(self.findings("base/good.cpp"), "")
        self.assertRegex(self.findings("base/bad.cpp"), "bad.cpp.*error: invalid case style for function")
        self.assertRegex(self.findings("base/good.cpp", "base/bad.cpp"), "bad.cpp.*error: invalid case style for function")

    def test_a_header_compiles_on_its_own(self):
        self.write("base/whole.hpp", "#pragma once\n#include <string>\nstd::string text();\n")
        self.write("base/half.hpp", "#pragma once\nstd::string text();\n")
        self.assertEqual(tidy.compile_alone("base/whole.hpp", self.commands), [])
        self.assertIn("does not compile on its own", tidy.compile_alone("base/half.hpp", self.commands)[0])


if __name__ == "__main__":
    unittest.main()
