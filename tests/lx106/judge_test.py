#!/usr/bin/env python3
"""Shows that judge.py finds what it looks for: a byte that differs, a float that differs, a double, a cost."""
import pathlib
import tempfile
import unittest

import judge


class Judge(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def write(self, name, *lines):
        (self.folder / name).write_text("".join(line + "\n" for line in lines))

    def test_equal_traces_have_no_fault(self):
        for side in ("host", "chip"):
            self.write(f"trace.{side}", "tick 0000002710 1a2b3c4d", "sent 0000002710 0801")
        self.assertEqual(list(judge.compare_traces(self.folder)), [])

    def test_names_the_first_line_that_differs_and_its_time(self):
        self.write("trace.host", "tick 0000002710 1a2b3c4d", "sent 0000002710 0801")
        self.write("trace.chip", "tick 0000002710 1a2b3c4d", "sent 0000002710 0802")
        fault, = judge.compare_traces(self.folder)
        self.assertIn("line 2 of the traces, 0.01 s", fault)

    def test_a_trace_that_ends_early_is_a_fault(self):
        self.write("trace.host", "tick 0000002710 1a2b3c4d", "sent 0000002710 0801")
        self.write("trace.chip", "tick 0000002710 1a2b3c4d")
        self.assertEqual(len(list(judge.compare_traces(self.folder))), 1)

    def test_names_the_operation_that_differs(self):
        self.write("trials.host", "block 00000000 " + " ".join(["00000001"] * 13))
        self.write("trials.chip", "block 00000000 " + " ".join(["00000001"] * 3 + ["00000002"] + ["00000001"] * 9))
        fault, = judge.compare_trials(self.folder)
        self.assertIn("divide differs", fault)

    def test_a_tick_is_a_step_and_what_is_sent_after_it(self):
        self.write("figures", "robot_bytes 26000", "ring_bytes 21000", "reader_bytes 1000", "step 100", "stack 50",
                   "transmit 30", "stack 70", "transmit 20", "stack 60", "receive 900", "stack 80", "step 200", "stack 40")
        figures = judge.figures_of(self.folder / "figures")
        self.assertEqual((figures["ticks"], figures["median_tick"], figures["worst_tick"]), (2, 175, 200))
        self.assertEqual((figures["stack_bytes"], figures["transmit_stack"]), (80, 70))
        self.assertEqual((figures["core_bytes"], figures["worst_receive"]), (4000, 900))

    def test_knows_routines_for_doubles(self):
        for name in ("__adddf3", "__ltdf2", "__extendsfdf2", "__truncdfsf2", "__fixunsdfsi", "__floatundidf"):
            self.assertTrue(judge.DOUBLE_ROUTINE.match(name), name)
        for name in ("__addsf3", "__fixsfsi", "__floatundisf", "__udivmoddi4", "__cmpdi2", "__math_invalidf"):
            self.assertFalse(judge.DOUBLE_ROUTINE.match(name), name)


if __name__ == "__main__":
    unittest.main()
