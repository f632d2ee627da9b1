#!/usr/bin/env python3
"""Judges a run of deploy/lx106: same results as the host, no arithmetic that the chip should not do, and the budgets.

Usage: judge.py FOLDER. In FOLDER: trace.host, trace.chip, trials.host, trials.chip, figures, and chip/ with the image,
its map and the objects of the core. Prints the table of docs/robot.md and a line for each fault; fails if there is any.
"""
import collections
import pathlib
import re
import statistics
import subprocess
import sys

# What is held, in one place: key, what it is, limit, unit.
BUDGETS = (
    ("median_tick", "median tick", 16_000, "instructions"),
    ("worst_tick", "worst tick", 80_000, "instructions"),
    ("core_bytes", "core state without ring and frame buffer", 4_352, "bytes"),
    ("ring_bytes", "ring", 22 * 1024, "bytes"),
    ("stack_bytes", "stack, deepest", 2_048, "bytes"),
    ("text_bytes", "text: core, protocol, nanopb", 43 * 1024, "bytes"),
)
# Told beside them, without a limit of their own.
REPORTED = (
    ("ticks", "ticks replayed", ""),
    ("worst_step", "worst `step()` alone", "instructions"),
    ("worst_transmit", "worst `transmit()` alone", "instructions"),
    ("worst_receive", "worst `receive()`, outside the tick", "instructions"),
    ("step_stack", "stack of `step()`", "bytes"),
    ("transmit_stack", "stack of `transmit()`", "bytes"),
    ("receive_stack", "stack of `receive()`", "bytes"),
    ("constant_bytes", "of the text: constants", "bytes"),
    ("reader_bytes", "frame buffer", "bytes"),
)
CALLS = ("step", "transmit", "receive")
OURS = ("librobot_fw.a", "libprotocol.a", "libnanopb.a")
# sqrtf with what it calls for a negative argument, ceilf, truncf, and the class of a float: exact, all of them.
LIBM_ALLOWED = {"libm_math_sf_sqrt.c.o", "libm_common_math_errf_invalidf.c.o", "libm_math_sf_ceil.c.o",
                "libm_common_sf_trunc.c.o", "libm_common_sf_fpclassify.c.o"}
DOUBLE_ROUTINE = re.compile(r"^__(\w*df[23]|\w*dfsf2|fix(uns)?df[sd]i|float(un)?[sd]idf)$")
TRIAL_BLOCKS, PAIRS_PER_BLOCK = 1000, 1000  # of robot_fw/lx106/float_trials
LEAST_TICKS = 3000  # of the recorded session
LOOP_INSTRUCTIONS = 2000  # of main.cpp's counted loop; the clock has steps of 25

OPERATIONS = ("add subtract multiply divide sqrtf compare from_int32 from_uint32 from_int64 from_uint64 to_int32 to_uint32 "
              "to_uint64").split()


def figures_of(path):
    """The figures of the chip: sizes as they are, costs and stack summed up."""
    found, ticks, worst, stack = {}, [], collections.Counter(), collections.Counter()
    call = None
    for line in path.read_text().splitlines():
        key, value = line.split()
        value = int(value)
        if key == "step":
            ticks.append(value)
        elif key == "transmit":
            if not ticks:
                continue
            ticks[-1] += value
        elif key == "stack":
            stack[call] = max(stack[call], value)
            continue
        elif key not in ("receive", "link"):
            found[key] = value
        call = key
        worst[key] = max(worst[key], value)
    found |= {"ticks": len(ticks), "median_tick": round(statistics.median(ticks or [0])),
              "worst_tick": max(ticks, default=0), "stack_bytes": max(stack.values(), default=0),
              "core_bytes": found["robot_bytes"] - found["ring_bytes"] - found["reader_bytes"]}
    found |= {f"worst_{call}": worst[call] for call in CALLS}
    found |= {f"{call}_stack": stack[call] for call in CALLS}
    return found


def sections_of(map_path):
    """(section, size, object) of each piece in the image."""
    text = map_path.read_text().split("Linker script and memory map")[1]
    for match in re.finditer(r"^ (\.\S+)\s+0x([0-9a-f]+)\s+0x([0-9a-f]+) (\S+)$", text, re.M):
        if int(match.group(2), 16) != 0:
            yield match.group(1), int(match.group(3), 16), match.group(4)


def text_of(map_path):
    text = constants = 0
    for section, size, origin in sections_of(map_path):
        if any(f"{name}(" in origin for name in OURS):
            constants += size * section.startswith(".rodata")
            text += size * section.startswith((".rodata", ".text", ".literal"))
    return {"text_bytes": text, "constant_bytes": constants}


def lines_of(folder, name):
    return (folder / name).read_text().splitlines()


def time_of(line):
    try:
        return f"{int(line.split()[1], 16) / 1e6:.2f} s"
    except (IndexError, ValueError):
        return "no time"


def check_session(folder, figures):
    """Yields what a session that did not happen, or did not get far, lacks."""
    if figures["ticks"] < LEAST_TICKS:
        yield f"the chip replayed {figures['ticks']} ticks; {LEAST_TICKS} are the least"
    for name in ("trace.host", "trace.chip"):
        ticks = sum(line.startswith("tick ") for line in lines_of(folder, name))
        if ticks != figures["ticks"]:
            yield f"{name} has {ticks} ticks, the chip's figures have {figures['ticks']}"
    for call in CALLS:
        if not figures[f"worst_{call}"] > 0:
            yield f"no {call}() was counted"


def compare_traces(folder):
    host, chip = (lines_of(folder, name) for name in ("trace.host", "trace.chip"))
    if not host:
        yield "the host's trace is empty"
    for number, (a, b) in enumerate(zip(host, chip), 1):
        if a != b:
            yield f"line {number} of the traces, {time_of(a)}: host '{a[:70]}', chip '{b[:70]}'"
            return
    if len(host) != len(chip):
        yield f"the traces have {len(host)} (host) and {len(chip)} (chip) lines"


def compare_trials(folder):
    sides = {name: lines_of(folder, name) for name in ("trials.host", "trials.chip")}
    for name, lines in sides.items():
        if len(lines) != TRIAL_BLOCKS:
            yield f"{name} has {len(lines)} blocks, not {TRIAL_BLOCKS}"
        for number, line in enumerate(lines):
            if line.split()[:2] != ["block", f"{number:08x}"] or len(line.split()) != 2 + len(OPERATIONS):
                yield f"{name}, line {number + 1}: not block {number:08x} with {len(OPERATIONS)} checksums: '{line[:70]}'"
                return
    host, chip = sides.values()
    differing = collections.Counter()
    for a, b in zip(host, chip):
        if a != b:
            differing.update(name for name, x, y in zip(OPERATIONS, a.split()[2:], b.split()[2:]) if x != y)
    for operation, count in differing.items():
        yield f"{operation} differs from the host's in {count} of {len(host)} blocks; lx106_host trials BLOCK shows one"


def symbols(path, *options):
    return subprocess.run(["xtensa-lx106-elf-nm", *options, path], check=True, capture_output=True, text=True).stdout


def check_arithmetic(chip):
    for name in sorted({line.split()[-1] for line in symbols(chip / "lx106_replay.elf").splitlines()}):
        if DOUBLE_ROUTINE.match(name):
            yield f"the image computes in double: {name}"
    pulled_in = (chip / "lx106_replay.map").read_text().split("Memory Configuration")[0]
    for member in sorted(set(re.findall(r"\((libm_\S+?)\)", pulled_in)) - LIBM_ALLOWED):
        yield f"the image uses libm beyond sqrtf and ceilf: {member}"
    for library in ("robot_fw/librobot_fw.a", "protocol/libprotocol.a", "libnanopb.a"):
        member = ""
        for line in symbols(chip / library, "--undefined-only").splitlines():
            if line.endswith(":"):
                member = line[:-1]
            elif re.search(r"__fix(uns)?[sd]f[sd]i|\bll?round|\bll?rint", line) and member != "saturate.cpp.obj":
                yield f"{member} converts float to integer by itself ({line.split()[-1]}): use robot_fw/core/saturate.hpp"


def main():
    folder = pathlib.Path(sys.argv[1])
    figures = figures_of(folder / "figures") | text_of(folder / "chip/lx106_replay.map")
    faults = [*compare_traces(folder), *check_session(folder, figures), *compare_trials(folder),
              *check_arithmetic(folder / "chip")]
    if not LOOP_INSTRUCTIONS - 25 <= figures["loop_instructions"] <= LOOP_INSTRUCTIONS + 50:
        faults.append(f"a loop of {LOOP_INSTRUCTIONS} instructions counts {figures['loop_instructions']}")
    print("| what | measured | budget |\n|---|---|---|")
    for key, what, limit, unit in BUDGETS:
        print(f"| {what} | {figures[key]:,} | {limit:,} {unit} |")
        if figures[key] > limit:
            faults.append(f"over budget: {what}: {figures[key]:,} of {limit:,} {unit}")
    for key, what, unit in REPORTED:
        print(f"| {what} | {figures[key]:,} {unit}".rstrip() + " | |")
    for fault in faults:
        print(f"lx106: {fault}")
    if not faults:
        print(f"lx106: same bytes and floats as the host in {figures['ticks']:,} ticks, "
              f"{TRIAL_BLOCKS * PAIRS_PER_BLOCK:,} float pairs alike, within the budgets")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
