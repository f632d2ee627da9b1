"""Real stations and simulated robots as processes, for the tests in this folder. Standard library only."""
import contextlib
import itertools
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "deploy"))
sys.path.append(str(ROOT / "tests" / "model"))

import replay  # noqa: E402
import station_api  # noqa: E402
from station_api import ApiError, wait_until  # noqa: E402, F401  (used by the tests)

BIN = pathlib.Path(os.environ["RHEONAUT_BIN"])  # set by CTest
TRACES = os.environ.get("RHEONAUT_TRACES")  # a folder for what tests/model/replay.py replays; unset: nothing is kept
NUMBERS = itertools.count(1)
PATIENCE_S = 60  # far beyond what any step takes: a wait judges order and outcome, not how fast this machine is
# A link that outlives a machine that stands still for a few seconds. Tests whose subject is the time-out of the link have
# the station as it comes: lab(config=None), where it is 1 s.
PATIENT = "[robots]\nlink_timeout_ms = 5000\nheartbeat_interval_ms = 200\n"
FLEET = (ROOT / "deploy" / "fleet.toml").read_text()  # a station that lets a whole fleet enrol itself


class Station(station_api.Station):
    """With the patience of a test."""

    def request(self, method, path, body=None, timeout_s=PATIENCE_S):
        return super().request(method, path, body, timeout_s)

    def wait_for_robot(self, robot_id, timeout_s=PATIENCE_S):
        return super().wait_for_robot(robot_id, timeout_s)


def hurry(process):
    """The process waits for no other of this machine, where that is permitted: it stands for another computer."""
    with contextlib.suppress(PermissionError, ProcessLookupError):
        os.sched_setscheduler(process.pid, os.SCHED_RR, os.sched_param(1))


def child_of(process):
    """The number of a process that it has started, as text; none: empty."""
    with contextlib.suppress(FileNotFoundError):
        return pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().strip()


def has_ended(pid):
    """Also when nobody has asked for its exit status."""
    try:
        return not pathlib.Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return True


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

    def _start(self, name, *arguments, environment=None):
        log = open(self.folder / f"{name}.log", "ab")
        process = subprocess.Popen([str(self.bin / arguments[0]), *map(str, arguments[1:])], stdout=log,
                                   stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, env=os.environ | (environment or {}))
        log.close()
        if arguments[0] == "rheonaut-sim":  # a real one has a processor of its own
            hurry(process)
        self.processes.append(process)
        return process

    def start_station(self, http="127.0.0.1:0", robots="127.0.0.1:0", config=None):
        with contextlib.suppress(FileNotFoundError):
            (self.data / "endpoints.json").unlink()  # of a station that was killed
        self.start_unannounced(http, robots, config)
        try:
            return Station(self.data, timeout_s=PATIENCE_S)
        except TimeoutError:
            print(self.log("station"))
            raise

    def start_unannounced(self, http, robots, config=None, environment=None):
        """Does not wait for it: on a full disk the station cannot say where it is. `config` is TOML, or else the lab's;
        `environment` is added to this program's."""
        flags = []
        config = self.config if config is None else config
        if config is not None:
            (self.folder / "rheonaut.toml").write_text(config)
            flags = ["--config", self.folder / "rheonaut.toml"]
        self.station_process = self._start("station", "rheonaut", "serve", "--data", self.data, "--http", http,
                                           "--robots", robots, *flags, environment=environment)

    def tool(self, *arguments):
        """`rheonaut …`, run to its end."""
        return subprocess.run([str(self.bin / "rheonaut"), *map(str, arguments)], capture_output=True, text=True, timeout=2 * PATIENCE_S)

    def start_robot(self, station, robot_id="sim-1", *flags):
        return self._start(robot_id, "rheonaut-sim", "--station", station.endpoints["robots"], "--id", robot_id, *flags)

    def kill_station(self):
        self.station_process.kill()
        self.station_process.wait()

    def stop_station(self, timeout_s=PATIENCE_S):
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
                process.wait(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def keep_traces(place):
    """What the station has recorded of its robots, as a file for the model."""
    database = place.data / "station.sqlite"
    if TRACES and database.exists() and not place.is_damaged:
        replay.keep(database, TRACES, f"{pathlib.Path(sys.argv[0]).stem}_{next(NUMBERS)}")


def commanded(station, kind, robot_id="sim-1", **arguments):
    """The answer to a command. One that a machine which stood still has let expire, or whose robot it has kept from its
    link, is given again."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            return station.command(robot_id, kind, **arguments)
        except ApiError as error:
            if (error.status != 504 and error.reason != "not_connected") or time.monotonic() > deadline:
                raise
            time.sleep(0.02)


def swimming(station, robot_id="sim-1", setpoint_m=0.5):
    """The robot in auto, once its motor runs. A machine that stood still may have broken its link, which ends auto: then
    it is sent there again."""
    def runs():
        robot = station.robot(robot_id)
        if robot["mode"] == "auto" and robot["setpoint_m"] == setpoint_m:
            return abs(robot["sample"]["duty"]) > 0.5 and robot
        with contextlib.suppress(ApiError):  # it may be without a link just now
            station.command(robot_id, "set_mode", mode="auto", setpoint_m=setpoint_m)
        return None
    return wait_until(runs, PATIENCE_S, f"the motor of {robot_id} runs")


def stopped(station, robot_id="sim-1"):
    """The record of one stop, once the robot has confirmed it: a machine that stands still may keep it from that in time,
    and the station repeats the stop by itself until it is."""
    record = station.post(f"/api/v1/robots/{robot_id}/emergency-stop")
    def confirmed():
        now = station.get(f"/api/v1/commands/{record['command_id']}")
        return now["state"] in ("acknowledged", "verified") and now
    return wait_until(confirmed, PATIENCE_S, f"a stop that {robot_id} confirms")


def cleared(station, emergency_id, robot_id="sim-1"):
    """The robot in manual, once this stop is reset."""
    try:
        commanded(station, "clear_emergency", robot_id, emergency_id=emergency_id)
    except ApiError as error:
        if error.reason != "other_emergency":  # a clear before it has acted, and its answer came too late
            raise
    def in_manual():
        robot = station.robot(robot_id)
        return robot["mode"] == "manual" and robot
    return wait_until(in_manual, PATIENCE_S, f"manual of {robot_id} in telemetry")


@contextlib.contextmanager
def lab(disk=None, config=PATIENT, data=None):
    """A Lab in a folder of its own, on the disk that is mounted there. `config` is TOML; None: no file, as it comes. `data`
    is a data folder of which it has a copy. When the test fails, the logs are printed."""
    with tempfile.TemporaryDirectory(prefix="rheonaut-", dir=disk) as folder:
        place = Lab(folder, config)
        if data:
            shutil.copytree(data, place.data)
        try:
            yield place
        except BaseException:
            for path in sorted(place.folder.glob("*.log")):
                print(f"--- {path.name}\n{path.read_text(errors='replace')[-4000:]}", file=sys.stderr)
            raise
        finally:
            place.close()
        keep_traces(place)
