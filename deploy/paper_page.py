#!/usr/bin/env python3
"""Makes docs/paper.md and the drawings in docs/images/paper from what our programs print.

    deploy/paper_page.py build/release/bin

tests/system/paper_page_test.py does the same with the programs under test and fails where the committed files differ.
"""
import pathlib
import re
import sys
import textwrap

from paper_claims import SUBJECTS
from paper_figures import drawn
from paper_programs import Programs
from paper_svg import number

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE, DRAWINGS = "docs/paper.md", "docs/images/paper"

BEGIN = """\
# The paper, number by number

This page puts each equation, table and figure of [the paper](references.md) (`birs2021`) beside what we compute, so that
you can check one or the other with the paper in your hand. Type the command below a table to get the value yourself; the
word behind it is where the number stands in the output, and the number in brackets its row. `rheonaut` and `rheonaut-sim`
are in `build/release/bin` after `deploy/build release`, and none of the commands needs a station or a robot.

We have none of the paper's measurements. "Ours" is what its own equations and numbers give, computed by our programs.
A value *holds* if it deviates from the printed one by no more than the tolerance, which is chosen from the digits that are
printed and from what can be seen in a figure. Rows without a printed value are there to be compared with the curves of the
figures.

`deploy/paper` makes this page and the drawings again. A test fails when what the programs print is no longer what stands
here, to the last digit shown. The tests named below each table hold the values, most of them against reference data that
were computed by other means.
"""

MISPRINTS = """\
Misprints that change nothing: (25) has the sum of two frequency responses where the phase of their product is meant; (21)
integrates over x where the time is meant; Section 5.1 calls V a volume, and it is the velocity of Table 1; of (11) to (14)
it is open whether the coefficients carry their sign, and with all of them positive (28) comes out.
"""

CODE = """\
## Where each equation, table and figure is

Equations are numbered as they are printed, each displayed equation one number, from (1) on.

| in the paper | what it is | where it is computed | held by |
|---|---|---|---|
"""

# What is in the paper, in its order; the equations are counted in the order in which they are printed.
PLACES = [
    ("Figures 1 to 4, A1", "photographs, electronics, free body diagram", "no number to compute", ""),
    ("(1) to (7)", "the motion of a submarine in three axes, and its matrices", "no code: the tube guides the robot, so that it \
has one axis; the paper itself drops the other two in (8), and gives no number for them", ""),
    ("(8) to (10)", "velocity vector, small deviations, (1) in one axis", "no code of their own: the step from (1) to (11)", ""),
    ("(11), (12), (13), (14)", "thrust to velocity; added mass, linear and quadratic drag", "`control/models/plant_models`",
     "HydrodynamicModel.OfTable1IsTheNewtonianModelWithin02Percent"),
    ("(15), (16)", "thrust of the propeller, and its area", "`sim_robot/world/plant` (`--fluid water_nonlinear`); linear: (18)",
     "NonlinearPlant.EndsWhereThrustEqualsDrag"),
    ("(17), (27)", "motor", "`control/models/plant_models`, fitted by `rheonaut model --motor-csv`",
     "MotorFit.RecoversTheMotorWithoutNoise"),
    ("(18), (19), (28), Table 1", "model in water", "`control/models/plant_models`, `rheonaut model`",
     "HydrodynamicModel.ShowsItsDerivedNumeratorBesideThePapers232"),
    ("(20), (22), (29)", "fractional model of velocity and position", "`control/models/transfer_function`, `rheonaut step`",
     "StepResponse.OfModel29MeetsTheReference"),
    ("(21), Figure 5", "cost of the identification", "`control/identification/identify`, `rheonaut identify --cost absolute_error`; \
as least squares by default", "Figure5.TheModelIsFoundAsFarAsTheRunCanTell"),
    ("(23), (30)", "fractional PD controller", "`control/models/transfer_function`; on the robot `robot_fw/core/controller`",
     "Controller.HasThePolesAndResiduesOfTheGoldenFit"),
    ("(24), (25), (26)", "the three conditions of the tuning; (25) prints a sum where the phases are meant",
     "`control/tuning/tune`, in closed form; `rheonaut tune`", "Tune.IsoDampedControllersAreTheReference"),
    ("Figure 6", "Bode diagram", "`control/responses/margins`, `rheonaut bode`", "Figure6.IsWrittenAsTheReferenceHasIt"),
    ("Figure 7, Figure 8, Figure 9", "closed loops", "`control/responses/closed_loop`, `rheonaut predict`; on the whole robot \
`rheonaut-sim play`", "Section5Test.FromAStepTestToClosedLoopsInTwoFluids"),
    ("Section 2.1", "walls, insertions, viscosity, pump profile of [19]", "no equation in the paper; \
[simulator.md](simulator.md) says what the simulated tubes assume", ""),
    ("Algorithm 1", "the robot's program", "`robot_fw/core/robot`; [robot.md](robot.md) describes it",
     "Commands.AutoFollowsItsSetpointAndManualEndsIt"),
    ("Figure A2, 175 ± 20 mV", "impedance; stop where it leaves the band", "`robot_fw/core/impedance_monitor`",
     "DeliveryRules.HoldsThePositionOfTheFifthReading"),
]
NEEDED = {f"({n})" for n in range(1, 31)} | {f"Figure {n}" for n in (*range(1, 10), "A1", "A2")} | {"Table 1", "Algorithm 1"}


def tests_of_the_project():
    """{"Suite.Name": file} of every test in C++."""
    found = {}
    for source in sorted((ROOT / "tests").rglob("*_test.cpp")):
        for suite, name in re.findall(r"^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", source.read_text(encoding="utf-8"), re.M):
            found[f"{suite}.{name}"] = source.relative_to(ROOT).as_posix()
    return found


def covered(places):
    """The single equations and figures that these entries name: "(8) to (10)" are three."""
    names = set()
    for place in places:
        for first, last in re.findall(r"\((\d+)\)(?: to \((\d+)\))?", place):
            names |= {f"({n})" for n in range(int(first), int(last or first) + 1)}
        for first, last in re.findall(r"Figures? (\w+)(?: to (\d+))?", place):
            names |= {f"Figure {n}" for n in range(int(first), int(last) + 1)} if last else {f"Figure {first}"}
        names |= {f"Figure {name}" for name in re.findall(r"\b(A1)\b", place)}
        names |= {name for name in ("Table 1", "Algorithm 1") if name in place}
    return names


class Page:
    def __init__(self, programs, plots):
        self.programs, self.plots, self.tests = programs, plots, tests_of_the_project()
        self.values, self.broken, self.count = {}, [], 0
        missing = NEEDED - covered([place for place, *_ in PLACES])
        if missing:
            raise RuntimeError(f"no entry for {', '.join(sorted(missing))} in PLACES of paper_page.py")

    def test(self, name):
        if name not in self.tests:
            raise RuntimeError(f"there is no test {name}; rename it in deploy/paper_claims.py or paper_page.py too")
        return f"[{name}](../{self.tests[name]})"

    def cells(self, row):
        """(printed, ours, deviation, tolerance, holds)"""
        ours = row.ours(self.programs)
        unit = f" {row.unit}" if row.unit and row.unit != "°" else row.unit
        shown = ours if isinstance(ours, str) else number(ours, row.digits)
        if row.key:
            self.values[row.key] = shown
            self.values[row.key + "_abs"] = shown.lstrip("−")
        if row.printed is None:
            return "", shown + unit, "", "", ""
        if isinstance(row.printed, str):
            return row.printed, shown, "", "", row.holds(self.programs)
        printed = f"{row.printed:.8f}".rstrip("0").rstrip(".") + unit
        deviation = ours - row.printed
        if row.relative:
            deviation *= 100 / row.printed
            differs, tolerance = self.signed(deviation, 2 if abs(deviation) < 1 else 1) + " %", f"{row.tolerance:g} %"
        else:
            differs, tolerance = self.signed(deviation, row.digits) + unit, f"{row.tolerance:g}{unit}" if row.tolerance else "0"
        return printed, shown + unit, differs, tolerance, abs(deviation) <= row.tolerance + 1e-9 * abs(row.printed)

    @staticmethod
    def signed(value, digits):
        text = number(value, digits)
        return text if text.startswith("−") or float(text) == 0 else "+" + text

    def subject(self, subject):
        lines = [f"## {subject.title}\n", subject.text + "\n"]
        lines += [f"![{self.plots[name].title}](images/paper/{name}.svg)\n" for name in subject.figures]
        lines += ["| row | in the paper | what | printed | ours | deviation | tolerance | holds |", "|---|---|---|---|---|---|---|---|"]
        commands, tests = {}, {}
        for row in subject.rows:
            self.count += 1
            *cells, holds = self.cells(row)
            if holds is False and row.proof:
                self.broken.append((self.count, row.proof))
            word = {True: "yes", False: "**no**", "": ""}[holds]
            lines.append(f"| {self.count} | {row.where} | {row.what} | {' | '.join(cells)} | {word} |")
            for command, member in ((row.command, row.member), *row.also):
                commands.setdefault(command, {}).setdefault(member, []).append(str(self.count))
            tests.setdefault(row.test, []).append(str(self.count))
        lines += ["", "```"]
        for command, members in commands.items():
            named = ", ".join(f"{member} ({', '.join(rows)})" for member, rows in members.items())
            lines += [f"$ {command}", textwrap.fill(named, 110, initial_indent="    # ", subsequent_indent="    # ")]
        lines += ["```", ""]
        lines.append(wrapped("Tests: " + "; ".join(f"{self.test(name)} ({', '.join(rows)})" for name, rows in tests.items()) + "."))
        return "\n".join(lines)

    def text(self):
        subjects = [self.subject(subject) for subject in SUBJECTS]
        places = "".join(f"| {place} | {what} | {where} | {self.test(test) if test else '—'} |\n"
                         for place, what, where, test in PLACES)
        broken = "".join("\n" + wrapped(f"{i}. {' '.join(proof.split()).format(**self.values)} (Row {row}.)", "   ")
                         for i, (row, proof) in enumerate(self.broken, 1))
        return "\n".join([BEGIN, "## What does not hold\n" + broken, MISPRINTS, *subjects, CODE + places])


def wrapped(text, indent=""):
    return textwrap.fill(text, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) + "\n"


def files(programs):
    """{path from the root: text}"""
    plots = drawn(programs)
    return {PAGE: Page(programs, plots).text(), **{f"{DRAWINGS}/{name}.svg": plot.svg() for name, plot in plots.items()}}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for name, text in files(Programs(sys.argv[1])).items():
        (ROOT / name).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / name).write_text(text, encoding="utf-8")
        print(name)


if __name__ == "__main__":
    main()
