"""The programs of examples/ plot Figure 7 from the exports of a real station and a simulated robot."""

import pathlib
import shutil
import subprocess
import sys
import time
import unittest
import xml.etree.ElementTree

from processes import ROOT, commanded, lab

EXAMPLES = ROOT / "examples"
SVG = "{http://www.w3.org/2000/svg}"
SETPOINT_M, DISTURBANCE_M = 0.1, -0.05


def record(station):
    """A step to 0.1 m, and a disturbance 1.5 s later; the run's number."""
    commanded(station, "zero_position")
    run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "Figure 7, short"})["run_id"]
    time.sleep(0.3)  # these times are the input of this test
    commanded(station, "set_mode", mode="auto", setpoint_m=SETPOINT_M)
    time.sleep(1.5)
    commanded(station, "inject_disturbance", disturbance_m=DISTURBANCE_M)
    time.sleep(0.7)
    station.post(f"/api/v1/runs/{run}/end", {})
    commanded(station, "set_mode", mode="manual")
    return run


def height_of_line(path):
    """The y of each point, of a line drawn with M and L."""
    points = path.replace("L", "M").split("M")[1:]
    return [float(point.split()[1]) for point in points]


def octave(program):
    return subprocess.run(["octave-cli", "--norc", "--path", str(EXAMPLES), "--eval", program], capture_output=True,
                          text=True, timeout=120)


class Figure7Test(unittest.TestCase):
    def check(self, picture, run_title):
        root = xml.etree.ElementTree.parse(picture).getroot()
        self.assertEqual(root.tag, f"{SVG}svg")
        texts = [text.text for text in root.iter(f"{SVG}text")]
        for wanted in ("position (m)", "duty", "time (s)"):
            self.assertIn(wanted, texts, run_title)
        lines = [path.get("d") for path in root.iter(f"{SVG}path") if path.get("stroke-width") == "1.3"]
        self.assertEqual(len(lines), 3, "setpoint, position, duty")
        setpoint, position, _ = map(height_of_line, lines)
        self.assertGreater(len(position), 200)
        self.assertLess(len(setpoint), len(position), "it has none in manual")
        self.assertLess(min(position), position[0] - 50, "the robot went up")
        self.assertAlmostEqual(min(position), setpoint[0], delta=30, msg="to the setpoint")

    @classmethod
    def setUpClass(cls):
        """One station for all, which has recorded a run."""
        cls.place = cls.enterClassContext(lab())
        cls.station = cls.place.start_station()
        cls.place.start_robot(cls.station, "sim-1", "--seed", "3")
        cls.station.wait_for_robot("sim-1")
        cls.run_id = record(cls.station)

    def export(self, kind):
        exported = self.place.folder / f"run.{kind}"
        made = self.place.tool("export", "--run", self.run_id, "--format", kind, "--to", exported, "--data", self.place.data)
        self.assertEqual(made.returncode, 0, made.stderr)
        return exported

    def test_python_plots_it(self):
        place, station, run = self.place, self.station, self.run_id
        with self.subTest("from the station"):
            picture = place.folder / "asked.svg"
            self.plot(place, "--station", "http://" + station.endpoints["http"], "--token-file",
                      place.data / "rheonaut.token", "--run", run, "--to", picture)
            self.check(picture, "from the station")
        with self.subTest("from a CSV file"):
            picture = place.folder / "exported.svg"
            self.plot(place, "--csv", self.export("csv"), "--to", picture)
            self.assertEqual(picture.read_text(), (place.folder / "asked.svg").read_text())

    @unittest.skipIf(shutil.which("octave-cli") is None, "octave-cli is not installed")
    def test_octave_plots_it(self):
        if not octave("exit(isempty(available_graphics_toolkits()))").returncode == 0:
            self.skipTest("octave-cli has no graphics here; gnuplot-nox gives it some without a display")
        exported, picture = self.export("mat"), self.place.folder / "octave.svg"
        plotted = octave(f"figure_7('{exported}', '{picture}')")
        self.assertEqual(plotted.returncode, 0, plotted.stderr)
        self.assertEqual(plotted.stdout, f"{picture}\n")
        root = xml.etree.ElementTree.parse(picture).getroot()
        self.assertEqual(root.tag, f"{SVG}svg")
        texts = "".join(root.itertext())
        for wanted in ("position (m)", "setpoint", "2 sd of the estimate", "duty", "time (s)"):
            self.assertIn(wanted, texts)
        longest = max(path.get("d", "").count(",") for path in root.iter(f"{SVG}path"))
        self.assertGreater(longest, 200, "a point for each sample")

    def plot(self, place, *arguments):
        made = subprocess.run([sys.executable, "-B", str(EXAMPLES / "figure_7.py"), *map(str, arguments)],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertTrue(pathlib.Path(made.stdout.strip()).exists())


if __name__ == "__main__":
    unittest.main()
