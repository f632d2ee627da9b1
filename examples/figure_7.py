#!/usr/bin/env python3
"""Plots Figure 7 from a run that a station has recorded: position and duty over time, as an SVG file.

    examples/figure_7.py --station http://127.0.0.1:8080 --token-file lab/rheonaut.token --run 1 --to figure_7.svg
    examples/figure_7.py --csv run-1.csv --to figure_7.svg

The second form reads a file that `rheonaut export --run 1 --format csv --to run-1.csv`, or the API's samples.csv, has
written. Python's standard library is all it needs.
"""
import argparse
import csv
import io
import math
import urllib.request

WIDTH, LEFT, RIGHT, TOP = 720, 70, 16, 28  # pixels
PANELS = (("position (m)", 250), ("duty", 130))
GAP = 44  # between panels
MEASURED, COMMANDED = "#1b2a33", "#b0186f"


def fetch(station, token, run):
    """The run as CSV text: every sample, with units in the names of the columns."""
    request = urllib.request.Request(f"{station}/api/v1/runs/{run}/samples.csv",
                                     headers={"Authorization": f"Bearer {token}"})
    with urllib.request.urlopen(request) as answer:
        return answer.read().decode()


def columns(text):
    """{name: [numbers]}; an empty field is NaN."""
    rows = list(csv.DictReader(line for line in io.StringIO(text) if not line.startswith("#")))
    names = ("robot_time_us", "position_m", "position_sd_m", "duty", "setpoint_m", "gap_before")
    table = {name: [float(row[name]) if row[name] else math.nan for row in rows] for name in names}
    begin_us = table["robot_time_us"][0]
    table["t_s"] = [(t_us - begin_us) * 1e-6 for t_us in table["robot_time_us"]]
    return table


def ticks(low, high, count):
    """Round values between the two."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
    first = math.ceil(low / step)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)], step


class Panel:
    """A plot over time, from `top` pixels on."""

    def __init__(self, title, top, height, t_end_s, values):
        finite = [v for v in values if math.isfinite(v)]
        margin = 0.06 * (max(finite) - min(finite)) or 0.1
        self.low, self.high = min(finite) - margin, max(finite) + margin
        self.top, self.height, self.t_end_s = top, height, t_end_s
        self.parts = [f'<text x="{LEFT}" y="{top - 8}" font-weight="600">{title}</text>']
        self.axes()

    def x(self, t_s):
        return LEFT + t_s / self.t_end_s * (WIDTH - LEFT - RIGHT)

    def y(self, value):
        return self.top + (self.high - value) / (self.high - self.low) * self.height

    def axes(self):
        bottom = self.top + self.height
        for value, anchor, horizontal in [(v, "end", True) for v in ticks(self.low, self.high, 5)[0]]:
            self.parts.append(f'<path d="M{LEFT} {self.y(value):.1f}H{WIDTH - RIGHT}" stroke="#e3e9eb"/>'
                              f'<text x="{LEFT - 8}" y="{self.y(value) + 4:.1f}" text-anchor="{anchor}">{value:.4g}</text>')
        for t_s in ticks(0, self.t_end_s, 8)[0]:
            self.parts.append(f'<path d="M{self.x(t_s):.1f} {self.top}V{bottom}" stroke="#e3e9eb"/>'
                              f'<text x="{self.x(t_s):.1f}" y="{bottom + 16}" text-anchor="middle">{t_s:.4g}</text>')
        self.parts.append(f'<rect x="{LEFT}" y="{self.top}" width="{WIDTH - LEFT - RIGHT}" height="{self.height}" '
                          'fill="none" stroke="#8b9aa1"/>')

    def line(self, table, name, colour, dashed=False):
        """Interrupted where samples are missing, or the value is none."""
        path, pen_is_down = [], False
        for t_s, value, gap in zip(table["t_s"], table[name], table["gap_before"]):
            if not math.isfinite(value):
                pen_is_down = False
                continue
            path.append(f"{'L' if pen_is_down and gap == 0 else 'M'}{self.x(t_s):.1f} {self.y(value):.2f}")
            pen_is_down = True
        dash = ' stroke-dasharray="6 3"' if dashed else ""
        self.parts.append(f'<path d="{"".join(path)}" fill="none" stroke="{colour}" stroke-width="1.3"{dash}/>')

    def band(self, table):
        """Two standard deviations around the position, which is the robot's estimate."""
        points = [(t, x, s) for t, x, s in zip(table["t_s"], table["position_m"], table["position_sd_m"])
                  if math.isfinite(x) and math.isfinite(s)]
        forth = [f"{self.x(t):.1f} {self.y(x + 2 * s):.2f}" for t, x, s in points]
        back = [f"{self.x(t):.1f} {self.y(x - 2 * s):.2f}" for t, x, s in reversed(points)]
        self.parts.append(f'<path d="M{"L".join(forth + back)}Z" fill="{MEASURED}" fill-opacity="0.18"/>')


def figure(table, title):
    """The SVG text."""
    t_end_s = table["t_s"][-1]
    tops = [TOP + 30]
    for _, height in PANELS[:-1]:
        tops.append(tops[-1] + height + GAP)
    edges = [x + k * s for x, s in zip(table["position_m"], table["position_sd_m"]) for k in (-2, 2)]
    position = Panel(PANELS[0][0], tops[0], PANELS[0][1], t_end_s, edges + table["setpoint_m"])
    position.band(table)
    position.line(table, "setpoint_m", COMMANDED, dashed=True)
    position.line(table, "position_m", MEASURED)
    duty = Panel(PANELS[1][0], tops[1], PANELS[1][1], t_end_s, table["duty"])
    duty.line(table, "duty", COMMANDED)
    bottom = tops[-1] + PANELS[-1][1]
    parts = position.parts + duty.parts
    parts.append(f'<text x="{WIDTH / 2}" y="{bottom + 34}" text-anchor="middle">time (s)</text>')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {bottom + 44}" '
            'font-family="sans-serif" font-size="11" fill="#44545c"><rect width="100%" height="100%" fill="#fff"/>'
            f'<text x="{LEFT}" y="20" font-size="14" font-weight="600" fill="#1b2a33">{title}</text>'
            + "".join(parts) + "</svg>\n")


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--station", default="http://127.0.0.1:8080")
    options.add_argument("--token-file")
    options.add_argument("--run", type=int)
    options.add_argument("--csv", help="an export, instead of a station")
    options.add_argument("--to", default="figure_7.svg")
    given = options.parse_args()
    if given.csv:
        with open(given.csv, encoding="utf-8") as file:
            text = file.read()
    elif given.run and given.token_file:
        with open(given.token_file, encoding="utf-8") as file:
            text = fetch(given.station, file.read().strip(), given.run)
    else:
        options.error("give --csv, or --run and --token-file")
    with open(given.to, "w", encoding="utf-8") as file:
        file.write(figure(columns(text), "Closed loop with a disturbance (Figure 7)"))
    print(given.to)


if __name__ == "__main__":
    main()
