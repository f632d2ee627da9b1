#!/usr/bin/env python3
"""What deploy/esp8266-check says when it is given an Arduino core, and when it cannot compile. Its compilers are stand-ins."""
import os
import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[1]
COMPILER = """#!/bin/sh
case "$(basename "$0") $*" in
  *objdump*) cat "$DISASSEMBLY"; exit ;;
esac
case "$*" in
  --version) echo "xtensa-lx106-elf-g++ 10.3" ;;
  "-E -x c -") grep -q pgmspace ;;
  *) echo "$*" >>"$COMPILED" ;;
esac
"""


IN_RAM = """Disassembly of section .iram.text.motor.cpp.25.10:
0000000c <_ZN12_GLOBAL__N_19drive_pinEv>:
   c: rsr.ccount a4
Disassembly of section .text._ZN5MotorE:
00000000 <_ZN5MotorE>:
  3d: callx0 a0
"""


class Esp8266CheckTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="rheonaut-")))
        self.core = self.folder / "core"
        self.core.mkdir()
        (self.core / "platform.txt").write_text("name=ESP8266 Boards\nversion=3.1.2\n")
        self.disassembly = self.folder / "disassembly"
        self.disassembly.write_text(IN_RAM)

    def put_compiler(self, text=COMPILER):
        tools = self.core / "tools/xtensa-lx106-elf/bin"
        tools.mkdir(parents=True)
        for name in ("g++", "gcc", "objdump"):
            compiler = tools / f"xtensa-lx106-elf-{name}"
            compiler.write_text(text)
            compiler.chmod(0o755)

    def check(self):
        environment = {**os.environ, "PATH": "/usr/bin:/bin", "ESP8266_ARDUINO_DIR": str(self.core),
                       "COMPILED": str(self.folder / "compiled"), "DISASSEMBLY": str(self.disassembly)}
        return subprocess.run([ROOT / "deploy/esp8266-check"], env=environment, capture_output=True, text=True, timeout=120)

    def test_the_cores_own_compiler_and_library(self):
        self.put_compiler()
        done = self.check()
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertRegex(done.stdout, r"files compiled against the Arduino core 3\.1\.2 in ESP8266_ARDUINO_DIR, by the chip's compiler: xtensa-lx106-elf-g\+\+ 10\.3\n$")
        compiled = (self.folder / "compiled").read_text()
        self.assertIn("rheonaut_robot/rheonaut_robot.ino", compiled)
        self.assertIn("-DARDUINO_ESP8266_MAJOR=3 -DARDUINO_ESP8266_MINOR=1 -DARDUINO_ESP8266_REVISION=2", compiled)

    def test_a_file_that_does_not_compile_fails_it(self):
        self.put_compiler(COMPILER.replace("echo \"$*\" >>", 'case "$*" in *motor.cpp*) exit 1 ;; esac; echo >>'))
        done = self.check()
        self.assertNotEqual(0, done.returncode)
        self.assertNotIn("compiled against", done.stdout)

    def test_the_motors_interrupt_lies_in_ram_and_calls_nothing(self):
        self.put_compiler()
        for disassembly, fault in ((IN_RAM.replace(".iram.text", ".text"), "does not lie in RAM"),
                                   (IN_RAM.replace("rsr.ccount", "callx0"), "calls a function"),
                                   (IN_RAM.replace("rsr.ccount", "call0"), "calls a function")):
            self.disassembly.write_text(disassembly)
            done = self.check()
            self.assertEqual(1, done.returncode, done.stdout)
            self.assertIn(fault, done.stderr)

    def test_a_folder_that_is_no_core(self):
        (self.core / "platform.txt").unlink()
        done = self.check()
        self.assertEqual(1, done.returncode)
        self.assertIn("is no Arduino core: it has no platform.txt", done.stderr)


if __name__ == "__main__":
    unittest.main()
