#!/usr/bin/env python3
"""Shows that judge.py finds what it looks for: a byte or a float that differs, a double, a cost, nothing at all."""
import pathlib
import tempfile
import unittest

import judge


class Judge(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def blocks(self, count=judge.TRIAL_BLOCKS):
        return [f"block {number:08x} " + " ".join(["00000001"] * 13) for number in range(count)]

    def write_trials(self, host, chip):
        self.write("trials.host", *host)
        self.write("trials.chip", *chip)

    def trial_faults(self, host, chip):
        self.write_trials(host, chip)
        return list(judge.compare_trials(self.folder))

    def session_faults(self, host_ticks, chip_ticks, **figures):
        self.write("trace.host", *["tick 0000002710 1a2b3c4d"] * host_ticks)
        self.write("trace.chip", *["tick 0000002710 1a2b3c4d"] * chip_ticks)
        found = {"ticks": 3000, "worst_step": 1, "worst_transmit": 1, "worst_receive": 1} | figures
        return list(judge.check_session(self.folder, found))

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
        chip = self.blocks()
        chip[7] = "block 00000007 " + " ".join(["00000001"] * 3 + ["00000002"] + ["00000001"] * 9)
        fault, = self.trial_faults(self.blocks(), chip)
        self.assertIn("divide differs from the host's in 1 of 1000", fault)

    def test_all_blocks_alike_have_no_fault(self):
        self.assertEqual(self.trial_faults(self.blocks(), self.blocks()), [])

    def test_trials_that_are_missing_are_a_fault_also_on_both_sides(self):
        self.assertEqual(len(self.trial_faults([], [])), 2)
        self.assertEqual(len(self.trial_faults(self.blocks(999), self.blocks(999))), 2)
        self.assertEqual(len(self.trial_faults(self.blocks(), self.blocks(999))), 1)

    def test_a_trial_of_another_block_or_with_other_columns_is_a_fault_also_on_both_sides(self):
        for wrong in ("block 00000008 " + " ".join(["00000001"] * 13), "block 00000007 " + " ".join(["00000001"] * 12),
                      "block 00000007 " + " ".join(["00000001"] * 14)):
            blocks = self.blocks()
            blocks[7] = wrong
            self.assertTrue(self.trial_faults(blocks, blocks), wrong)
            self.assertTrue(self.trial_faults(self.blocks(), blocks), wrong)

    def test_traces_that_are_both_empty_are_a_fault(self):
        self.write("trace.host")
        self.write("trace.chip")
        self.assertEqual(len(list(judge.compare_traces(self.folder))), 1)

    def test_a_line_without_a_time_is_told_all_the_same(self):
        self.write("trace.host", "tick")
        self.write("trace.chip", "tick 0000002710 1a2b3c4d")
        self.assertEqual(len(list(judge.compare_traces(self.folder))), 1)

    def test_a_session_that_is_short_or_silent_is_a_fault(self):
        self.assertEqual(self.session_faults(3000, 3000), [])
        self.assertEqual(len(self.session_faults(2999, 2999, ticks=2999)), 1)
        self.assertEqual(len(self.session_faults(3000, 2999)), 1)
        self.assertEqual(len(self.session_faults(0, 0)), 2)
        self.assertEqual(len(self.session_faults(3000, 3000, worst_transmit=0, worst_receive=0)), 2)

    def test_figures_without_a_tick_are_zeros(self):
        self.write("figures", "robot_bytes 26000", "ring_bytes 21000", "reader_bytes 1000")
        figures = judge.figures_of(self.folder / "figures")
        self.assertEqual((figures["ticks"], figures["worst_tick"], figures["worst_receive"]), (0, 0, 0))

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
