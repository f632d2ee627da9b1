"""An hour of one robot as CSV and as 2,000 points for a plot: Rheonaut over HTTP, the others from their table."""
import http.client
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import time

from loads import running
from stations import HERE, PYTHON, Rheonaut, environment, output, wait_until

sys.path.insert(0, str(HERE.parent / "bench"))
from machine import cpu_s  # noqa: E402

SAMPLES, REPLAY_RATE = 360_000, 60


def program(command):
    """(seconds, CPU seconds) of a program whose output is thrown away."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([str(part) for part in command], stdout=subprocess.DEVNULL, env=environment(), check=True, timeout=300)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - begun, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def of_rheonaut(options):
    with running(Rheonaut, options) as station:
        connection = http.client.HTTPConnection("127.0.0.1", station.http_port, timeout=300)
        headers = {"Authorization": "Bearer " + station.token(), "Content-Type": "application/json"}

        def ask(method, path, body=None):
            connection.request(method, "/api/v1" + path, None if body is None else json.dumps(body), headers)
            answer = connection.getresponse()
            content = answer.read()
            if answer.status >= 400:
                raise RuntimeError(content.decode())
            return content

        def timed(path):
            before_s, begun = cpu_s(*station.pids()), time.perf_counter()
            ask("GET", path)
            return time.perf_counter() - begun, cpu_s(*station.pids()) - before_s

        generator = subprocess.Popen([options.programs / "rheonaut-sim", "replay", "--station", f"127.0.0.1:{station.robots_port}",
                                      "--robots", "1", "--rate", str(REPLAY_RATE)], stdout=subprocess.DEVNULL)
        station.loads.append(generator)
        wait_until(lambda: [one for one in json.loads(ask("GET", "/robots"))["robots"] if one["next_seq"]], "the replayed robot")
        run = json.loads(ask("POST", "/runs", {"robot_id": "sim-1", "name": "hour"}))["run_id"]
        wanted = options.hour_samples
        deadline = time.monotonic() + 60 + 3 * wanted / (100 * REPLAY_RATE)
        while json.loads(ask("GET", f"/runs/{run}"))["samples_expected"] < wanted:
            if time.monotonic() > deadline:
                raise RuntimeError("the hour was not recorded in time")
            time.sleep(0.5)
        ask("POST", f"/runs/{run}/end", {})
        generator.terminate()
        generator.wait()
        paths = {"csv": f"/runs/{run}/samples.csv", "overview": f"/runs/{run}/overview?points=2000&channels=position_m"}
        return {what: [timed(path) for _ in range(options.rounds)] for what, path in paths.items()}


def of_tables(options, folder):
    path = pathlib.Path(folder) / "hour.sqlite"
    subprocess.run([PYTHON, HERE / "hour.py", "make", path], check=True, env=environment(), timeout=300)
    commands = {"Python": {what: [PYTHON, HERE / "hour.py", what, path] for what in ("csv", "overview")}}
    if output("node", "--version") and os.path.exists(environment()["COMPARE_NODE_MODULES"] + "/node_modules/better-sqlite3"):
        commands["Node"] = {what: ["node", HERE / "hour.mjs", what, path] for what in ("csv", "overview")}
    if output("sqlite3", "--version"):
        sql = "SELECT seq, robot_time_us, received_at_ms, position_m, velocity_m_s, acceleration_m_s2, duty, impedance_mv," \
              " reference_m FROM sample WHERE robot_id = 1 ORDER BY seq"
        commands["sqlite3 -csv"] = {"csv": ["sqlite3", "-readonly", "-csv", path, sql]}
    return {name: {what: [program(command) for _ in range(options.rounds)] for what, command in of.items()}
            for name, of in commands.items()}


def rows(measured):
    """The lines of the report's table."""
    lines = []
    for name, of in measured.items():
        cells = []
        for what in ("csv", "overview"):
            if what not in of:
                cells += ["", ""]
                continue
            cells += [f"{1000 * statistics.median(took[i] for took in of[what]):,.0f} ms" for i in (0, 1)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines
