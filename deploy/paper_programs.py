"""Runs `rheonaut` and `rheonaut-sim` as a reader types them, each command once, and reads what they print."""
import csv
import io
import json
import pathlib
import shlex
import subprocess

NOTHING_MEETS_IT = 3  # exit status of `rheonaut tune`: an answer, too
LONGEST_S = 120


class Programs:
    def __init__(self, folder):
        self.folder, self.printed = pathlib.Path(folder), {}

    def text(self, command):
        if command not in self.printed:
            program, *words = shlex.split(command)
            done = subprocess.run([str(self.folder / program), *words], capture_output=True, text=True, timeout=LONGEST_S)
            if done.returncode not in (0, NOTHING_MEETS_IT):
                raise RuntimeError(f"{command}: exit status {done.returncode}: {done.stderr.strip()}")
            self.printed[command] = done.stdout
        return self.printed[command]

    def json(self, command):
        return json.loads(self.text(command))

    def csv(self, command):
        """{name of the column: [numbers]}; words stay words, and an empty cell is None."""
        rows = list(csv.DictReader(io.StringIO(self.text(command))))
        return {name: [_number(row[name]) for row in rows] for name in rows[0]}


def _number(cell):
    if not cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return cell
