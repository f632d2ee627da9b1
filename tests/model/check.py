#!/usr/bin/env python3
"""Checks tests/model/stop_and_control.pml with Spin: with all of its rules, and without each of them in turn.

Usage: check.py states      every state within BOUNDS; no assertion may fail
       check.py rules [R]   without each rule (or R) an assertion must fail, or it is listed here as redundant;
                            within the same bounds no assertion may fail with all rules
docs/protocol_model.md says what the model is.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
MODEL = HERE / "stop_and_control.pml"
BOUNDS = (  # of the searches of `states`: each with takeovers and two commands, three with time that passes
    {"STOPS": 1, "FAULTS": 0, "BOOTS": 1, "CONNECTIONS": 1, "RESTARTS": 0, "TENURES": 2, "ERAS": 3, "COMMANDS": 2, "REPEATS": 0},
    {"STOPS": 0, "FAULTS": 1, "BOOTS": 1, "CONNECTIONS": 1, "RESTARTS": 0, "TENURES": 2, "ERAS": 2, "COMMANDS": 2, "REPEATS": 0},
    {"STOPS": 0, "FAULTS": 0, "BOOTS": 1, "CONNECTIONS": 2, "RESTARTS": 1, "TENURES": 2, "ERAS": 2, "COMMANDS": 2, "REPEATS": 0},
    {"STOPS": 0, "FAULTS": 0, "BOOTS": 2, "CONNECTIONS": 3, "RESTARTS": 1, "TENURES": 2, "ERAS": 1, "COMMANDS": 2, "REPEATS": 0},
)
LEAST_STATES = 5_000_000
NOTHING = {"STOPS": 0, "FAULTS": 0, "BOOTS": 1, "CONNECTIONS": 1, "RESTARTS": 0, "TENURES": 1, "ERAS": 1, "COMMANDS": 0,
           "REPEATS": 0}
# What must be possible for an assertion to fail without the rule.
NEEDS = {
    "EXPIRED": {"COMMANDS": 1, "ERAS": 2},
    "TIMED_EXPIRED": {"COMMANDS": 3, "ERAS": 3},
    "REFUSED_LATCHED": {"COMMANDS": 1, "FAULTS": 1},
    "STOP_ENDS_ORDERS": {"COMMANDS": 2, "FAULTS": 1},
    "STOP_DROPS_TIMED": {"COMMANDS": 2, "FAULTS": 1},
    "NEW_EMERGENCY_ID": {"COMMANDS": 2, "FAULTS": 2},
    "CLEAR_NAMES_LATCH": {"COMMANDS": 2, "FAULTS": 2},
    "DUTY_LAPSES": {"COMMANDS": 1, "ERAS": 2},
    "TIMED_LAPSE": {"COMMANDS": 1, "ERAS": 2},
    "LINK_LOSS_STOPS": {"COMMANDS": 1, "ERAS": 3},
    "BOOTS_AT_REST": {"COMMANDS": 1, "BOOTS": 2},
    "STOP_KEPT": {"COMMANDS": 1, "STOPS": 1},
    "STOP_RESTORED": {"COMMANDS": 1, "STOPS": 1, "RESTARTS": 1},
    "STOP_OVERTAKES": {"COMMANDS": 1, "STOPS": 1, "TENURES": 2},
    "STOP_SUPERSEDES": {"COMMANDS": 1, "STOPS": 1},
    "STOPPED_AGAIN": {"COMMANDS": 1, "STOPS": 1, "BOOTS": 2, "CONNECTIONS": 2},
    "LATCH_RESTORED": {"COMMANDS": 1, "STOPS": 1, "BOOTS": 2, "CONNECTIONS": 2, "RESTARTS": 1},
    "NEWER_COUNTS": {"COMMANDS": 1, "STOPS": 1, "BOOTS": 2, "CONNECTIONS": 2},
    "ENDS_WITH_LINK": {"COMMANDS": 1, "CONNECTIONS": 2},
    "ONE_IN_CONTROL": {"COMMANDS": 2, "TENURES": 2},
    "WITHDRAWS": {"COMMANDS": 2, "TENURES": 2},
    "DROPS": {"COMMANDS": 2, "TENURES": 2},
    "DROP_COMES_FIRST": {"COMMANDS": 2, "TENURES": 2},
    "DROP_AFTER_LINK": {"COMMANDS": 2, "TENURES": 2, "CONNECTIONS": 2},
    "DROP_AFTER_RESTART": {"COMMANDS": 2, "TENURES": 2, "CONNECTIONS": 2, "RESTARTS": 1},
}
# Rules without which nothing fails; what is explored for that, and why. Each is a second guard, or serves no safety.
REDUNDANT = {
    "OTHER_BOOT": ({"COMMANDS": 1, "BOOTS": 2, "CONNECTIONS": 2}, "a connection belongs to one boot, and what waits ends with it"),
    "LATCH_HOLDS_DUTY": ({"COMMANDS": 2, "FAULTS": 1}, "the stop has ended every order, and none is accepted"),
    "LATCHES_ANEW": ({"STOPS": 1, "COMMANDS": 1, "REPEATS": 1}, "a stop is repeated only while no clear is accepted"),
    "LINK_LOSS_DROPS": ({"COMMANDS": 2, "ERAS": 3}, "the lease has dropped them before"),
    "STOP_FIRST": ({"STOPS": 1, "COMMANDS": 1, "CONNECTIONS": 2}, "the station accepts no motion while it is pending"),
    "CLEAR_WAITS": ({"STOPS": 2, "COMMANDS": 1}, "the link is FIFO, and a clear names what it clears"),
    "STATION_LATCHES": ({"STOPS": 1, "COMMANDS": 1, "CONNECTIONS": 2}, "a stop goes first, and the robot refuses it, too"),
}


def rules():
    """By name, their numbers."""
    found = re.findall(r"^#define (\w+) +has_rule\((\d+)\)", MODEL.read_text(), re.M)
    return {name: int(number) for name, number in found}


class Model:
    """The model as a program, in a folder of its own."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        shutil.copy(MODEL, self.folder)
        self._run("spin", "-a", MODEL.name)
        compiler = shutil.which("clang-19") or "cc"
        self._run(compiler, "-O2", "-w", "-DSAFETY", "-DNOREDUCE", "-DCOLLAPSE", "-DVECTORSZ=512", "-o", "pan", "pan.c")

    def _run(self, *words, **environment):
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True,
                              env=os.environ | {name: str(value) for name, value in environment.items()})
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(words)}: {done.stdout}{done.stderr}")
        return done.stdout

    def explore(self, bounds, table_bits=18, **more):
        """(states, the assertion that failed or ""): no execution within the bounds is left out."""
        out = self._run("./pan", "-E", "-n", "-m200000", f"-w{table_bits}", **(bounds | more))
        found = re.search(r"pan:1: (.*) \(at depth", out)
        if found is None and "errors: 0" not in out or "max search depth too small" in out:
            raise RuntimeError(out)
        return int(re.search(r"(\d+) states, stored", out).group(1)), found.group(1) if found else ""


def check_states(model):
    failed, total = False, 0
    for bounds in BOUNDS:
        begun, cpu_s = time.monotonic(), os.times().children_user
        states, error = model.explore(bounds, table_bits=24)
        cpu_s = os.times().children_user - cpu_s
        print(" ".join(f"{name.lower()} {most}" for name, most in bounds.items()), flush=True)
        print(f"  {states} states in {time.monotonic() - begun:.1f} s ({cpu_s:.1f} s of one core): "
              f"{error or 'no assertion fails'}", flush=True)
        failed |= bool(error)
        total += states
    print(f"{total} states")
    return failed or total < LEAST_STATES


def report(name, states, begun, words):
    print(f"{name:18} {states:8} states {time.monotonic() - begun:4.1f} s  {words}", flush=True)


def widest(all_bounds):
    """Those of which none lies within another: an execution within the narrower bounds is one within the wider."""
    def lies_within(narrow, wide):
        return narrow != wide and all(narrow[name] <= wide[name] for name in narrow)
    return [bounds for place, bounds in enumerate(all_bounds)
            if bounds not in all_bounds[:place] and not any(lies_within(bounds, other) for other in all_bounds)]


def check_rules(model, names):
    wrong = 0
    for name in names:
        begun = time.monotonic()
        bounds, reason = REDUNDANT.get(name, (NEEDS.get(name, {}), ""))
        states, error = model.explore(NOTHING | bounds, WITHOUT=rules()[name])
        wrong += bool(error) == (name in REDUNDANT)
        report(name, states, begun, error or f"nothing fails; {reason}")
    for bounds in widest([NOTHING | NEEDS[name] for name in names if name in NEEDS]):
        begun = time.monotonic()
        states, error = model.explore(bounds, table_bits=22)
        wrong += bool(error)
        within = " ".join(f"{name.lower()} {most}" for name, most in bounds.items() if most != NOTHING[name])
        report("(all rules)", states, begun, f"{error or 'nothing fails'}; {within}")
    return wrong


def main(words):
    with tempfile.TemporaryDirectory(prefix="rheonaut-model-") as folder:
        model = Model(folder)
        if words[:1] == ["states"]:
            return check_states(model)
        if words[:1] == ["rules"]:
            return check_rules(model, words[1:] or rules())
    raise SystemExit(__doc__)


if __name__ == "__main__":
    sys.exit(1 if main(sys.argv[1:]) else 0)
