"""Real stations and simulated robots as processes, for the tests in this folder. Standard library only."""
import contextlib
import itertools
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "deploy"))
sys.path.append(str(ROOT / "tests" / "model"))

import replay  # noqa: E402
from station_api import ApiError, Station, wait_until  # noqa: E402, F401  (used by the tests)

BIN = pathlib.Path(os.environ["RHEONAUT_BIN"])  # set by CTest
TRACES = os.environ.get("RHEONAUT_TRACES")  # a folder for what tests/model/replay.py replays; unset: nothing is kept
NUMBERS = itertools.count(1)
FLEET = (ROOT / "deploy" / "fleet.toml").read_text()  # a station that lets a whole fleet enrol itself


class Lab:
    """A data folder, and the processes that were started for it; all of them are gone at the end."""

    def __init__(self, folder, config=None):
        self.folder = pathlib.Path(folder)
        self.config = config
        self.data = self.folder / "data"
        self.processes = []
        self.station_process = None
        self.bin = BIN  # the programs
        self.is_damaged = False  # the test has damaged the database: it leaves no records

    def _start(self, name, *arguments):
        log = open(self.folder / f"{name}.log", "ab")
        process = subprocess.Popen([str(self.bin / arguments[0]), *map(str, arguments[1:])], stdout=log,
                                   stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        log.close()
        self.processes.append(process)
        return process

    def start_station(self, http="127.0.0.1:0", robots="127.0.0.1:0", config=None):
        with contextlib.suppress(FileNotFoundError):
            (self.data / "endpoints.json").unlink()  # of a station that was killed
        self.start_unannounced(http, robots, config)
        try:
            return Station(self.data, timeout_s=60)
        except TimeoutError:
            print(self.log("station"))
            raise

    def start_unannounced(self, http, robots, config=None):
        """Does not wait for it: on a full disk the station cannot say where it is. `config` is TOML, or else the lab's."""
        flags = []
        config = self.config if config is None else config
        if config is not None:
            (self.folder / "rheonaut.toml").write_text(config)
            flags = ["--config", self.folder / "rheonaut.toml"]
        self.station_process = self._start("station", "rheonaut", "serve", "--data", self.data, "--http", http,
                                           "--robots", robots, *flags)

    def tool(self, *arguments):
        """`rheonaut …`, run to its end."""
        return subprocess.run([str(self.bin / "rheonaut"), *map(str, arguments)], capture_output=True, text=True, timeout=60)

    def start_robot(self, station, robot_id="sim-1", *flags):
        return self._start(robot_id, "rheonaut-sim", "--station", station.endpoints["robots"], "--id", robot_id, *flags)

    def kill_station(self):
        self.station_process.kill()
        self.station_process.wait()

    def stop_station(self, timeout_s=30):
        """SIGTERM; returns the exit code."""
        self.station_process.send_signal(signal.SIGTERM)
        return self.station_process.wait(timeout=timeout_s)

    def log(self, name):
        path = self.folder / f"{name}.log"
        return path.read_text(errors="replace") if path.exists() else ""

    def close(self):
        for process in reversed(self.processes):
            if process.poll() is None:
                process.terminate()
        for process in reversed(self.processes):
            try:
                process.wait(timeout=30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def keep_traces(place):
    """What the station has recorded of its robots, as a file for the model."""
    database = place.data / "station.sqlite"
    if TRACES and database.exists() and not place.is_damaged:
        replay.keep(database, TRACES, f"{pathlib.Path(sys.argv[0]).stem}_{next(NUMBERS)}")


def commanded(station, kind, robot_id="sim-1", **arguments):
    """The answer to a command. One that a machine which stood still has let expire is given again."""
    deadline = time.monotonic() + 60
    while True:
        try:
            return station.command(robot_id, kind, **arguments)
        except ApiError as error:
            if error.status != 504 or time.monotonic() > deadline:
                raise


@contextlib.contextmanager
def lab(disk=None, config=None):
    """A Lab in a folder of its own, on the disk that is mounted there. When the test fails, the logs are printed."""
    with tempfile.TemporaryDirectory(prefix="rheonaut-", dir=disk) as folder:
        place = Lab(folder, config)
        try:
            yield place
        except BaseException:
            for path in sorted(place.folder.glob("*.log")):
                print(f"--- {path.name}\n{path.read_text(errors='replace')[-4000:]}", file=sys.stderr)
            raise
        finally:
            place.close()
        keep_traces(place)
