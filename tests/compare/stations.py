"""The stations that are compared: how each is started, loaded, asked to stop a robot, killed, and counted afterwards."""
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import sqlite3
import struct
import subprocess
import time

import mqtt_packets as mqtt

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CACHE = ROOT / ".cache" / "compare"
WAIT_S = 60
PYTHON = "/usr/bin/python3" if pathlib.Path("/usr/bin/python3").exists() else shutil.which("python3")


def environment():
    """With what `deploy/compare --install` has unpacked, before what is installed."""
    unpacked = CACHE / "root" / "usr"
    libraries = [str(path) for pattern in ("lib/*-linux-gnu/openblas-pthread", "lib/*-linux-gnu")
                 for path in unpacked.glob(pattern)]
    joined = lambda name, paths: ":".join([*paths, *filter(None, [os.environ.get(name)])])  # noqa: E731
    return os.environ | {"LD_LIBRARY_PATH": joined("LD_LIBRARY_PATH", libraries), "COMPARE_NODE_MODULES": str(CACHE / "node"),
                         "PYTHONPATH": joined("PYTHONPATH", [str(unpacked / "lib/python3/dist-packages")]),
                         "PATH": joined("PATH", [str(unpacked / "sbin"), "/usr/sbin"])}


def output(*command):
    """What a program prints, or None where it or its library is missing."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=60, check=False)
    except FileNotFoundError:
        return None
    return done.stdout.strip() if done.stdout.strip() and "Error" not in done.stderr else None


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_until(condition, what):
    deadline = time.monotonic() + WAIT_S
    while not condition():
        if time.monotonic() > deadline:
            raise RuntimeError(f"waited {WAIT_S} s for {what}")
        time.sleep(0.02)


def behind():
    """The robots of the load are other machines in life: here they yield to the station, its robot and who stops it."""
    os.nice(10)


def reachable(port):
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
        return True
    return False


class Station:
    """One kind of station in a folder of its own. `processes` are those whose CPU counts."""

    killable = ("the server",)
    load_kind = "tcp"

    def __init__(self, options, folder):
        self.options, self.folder, self.processes = options, folder, {}
        self.database = folder / "samples.sqlite"
        self.robots_port, self.http_port = free_port(), free_port()
        self.loads = []

    def start(self):
        raise NotImplementedError

    def spawn(self, name, command, ready=True):
        with open(self.folder / f"{name}.log", "ab") as log:
            process = subprocess.Popen([str(part) for part in command], stdin=subprocess.DEVNULL,
                                       stdout=subprocess.PIPE if ready else log, stderr=log, text=True, env=environment())
        self.processes[name] = process
        if ready and process.stdout.readline() != "ready\n":
            raise RuntimeError(f"{name} did not start: " + (self.folder / f"{name}.log").read_text()[-1000:])

    def pids(self):
        return [process.pid for process in self.processes.values()]

    def kill(self, what):
        process = self.processes[what]
        process.kill()
        process.wait()

    def stop(self):
        for process in reversed(self.processes.values()):
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                try:
                    process.wait(timeout=WAIT_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()

    def close(self):
        for load in self.loads:
            if load.poll() is None:
                load.kill()
                load.wait()
        self.stop()

    def start_load(self, robots, prefix="load"):
        load = subprocess.Popen([PYTHON, HERE / "robots.py", self.load_kind, str(self.robots_port), str(robots), prefix],
                                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                preexec_fn=behind if prefix == "load" else None)
        self.loads.append(load)
        if load.stdout.readline() != "connected\n":
            raise RuntimeError("the robots did not start")
        return load

    def end_load(self, load):
        """Samples made."""
        return json.loads(load.communicate(timeout=WAIT_S)[0].splitlines()[-1])["made"]

    def start_stopped_robot(self):
        self.start_load(1, "stopped")

    def stopper(self):
        return HttpStopper(self.http_port, "/stop/stopped-1")

    # of each robot of the load: how many different samples are stored, and how many it has made at least
    robots_sql = ("SELECT count(*), max(seq) + 1 FROM sample JOIN robot USING (robot_id) WHERE name LIKE 'load-%'"
                  " GROUP BY robot_id")
    rows_sql = "SELECT count(*) FROM sample"

    def stored(self):
        """Once everything has ended: (samples of the load: stored, made at least; rows, bytes of the file)."""
        with contextlib.closing(sqlite3.connect(self.database)) as database:
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            robots = database.execute(self.robots_sql).fetchall()
            rows, = database.execute(self.rows_sql).fetchone()
        return sum(row[0] for row in robots), sum(row[1] for row in robots), rows, self.database.stat().st_size


class Rheonaut(Station):
    name = "Rheonaut"
    sources = ()
    robots_sql = ("SELECT sum(last_seq - first_seq + 1), max(last_seq) + 1 FROM segment JOIN boot USING (boot_key)"
                  " WHERE robot_id LIKE 'load-%' GROUP BY boot_key")
    rows_sql = "SELECT coalesce(sum(last_seq - first_seq + 1), 0) FROM segment"

    @staticmethod
    def version(options):
        return output(options.programs / "rheonaut", "--version")

    def __init__(self, options, folder):
        super().__init__(options, folder)
        self.data = folder / "data"
        self.database = self.data / "station.sqlite"
        # Nobody has real-time priority here: not the station, which asks for it, and not the others, which do not.
        (folder / "station.toml").write_text((ROOT / "deploy" / "fleet.toml").read_text() + "\n[station]\nreal_time = false\n")

    def start(self):
        endpoints = self.data / "endpoints.json"
        endpoints.unlink(missing_ok=True)
        self.spawn("the server", [self.options.programs / "rheonaut", "serve", "--data", self.data, "--http",
                                  f"127.0.0.1:{self.http_port}", "--robots", f"127.0.0.1:{self.robots_port}",
                                  "--config", self.folder / "station.toml"], ready=False)
        wait_until(lambda: endpoints.exists() or self.processes["the server"].poll() is not None, "the station")
        if not endpoints.exists():
            raise RuntimeError("the station did not start: " + (self.folder / "the server.log").read_text()[-1000:])

    def start_load(self, robots, prefix="load"):
        load = subprocess.Popen([self.options.programs / "rheonaut-sim", "replay", "--station", f"127.0.0.1:{self.robots_port}",
                                 "--robots", str(robots), "--samples-per-frame", "10", "--id", prefix, "--json"],
                                stdout=subprocess.PIPE, text=True, preexec_fn=behind)
        self.loads.append(load)
        for line in load.stdout:
            if json.loads(line).get("connected") == robots:
                return load
        raise RuntimeError("the robots did not start")

    def end_load(self, load):
        load.send_signal(signal.SIGTERM)
        return json.loads(load.communicate(timeout=WAIT_S)[0].splitlines()[-1])["samples_made"]

    def start_stopped_robot(self):
        robot = subprocess.Popen([self.options.programs / "rheonaut-sim", "--station", f"127.0.0.1:{self.robots_port}",
                                  "--id", "stopped"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.loads.append(robot)

    def token(self):
        return (self.data / "rheonaut.token").read_text().strip()

    def stopper(self):
        return HttpStopper(self.http_port, "/api/v1/robots/stopped/emergency-stop", self.token())


class Node(Station):
    name = "Node, SQLite"
    sources = ("node_server.mjs",)

    @staticmethod
    def version(_options):
        return output("node", "-e", "const load = require('module').createRequire(process.env.COMPARE_NODE_MODULES + '/');"
                      "const Database = load('better-sqlite3'), {version} = load('better-sqlite3/package.json');"
                      "const sqlite = new Database(':memory:').prepare('select sqlite_version()').pluck().get();"
                      "console.log(`Node ${process.versions.node}, better-sqlite3 ${version}, SQLite ${sqlite}`)")

    def start(self):
        self.spawn("the server", ["node", HERE / "node_server.mjs", self.database, self.robots_port, self.http_port])


class Python(Station):
    name = "Python, SQLite"
    sources = ("python_server.py", "rows.py")

    @staticmethod
    def version(_options):
        return output(PYTHON, "-c", "import platform, sqlite3; print(f'Python {platform.python_version()},"
                      " SQLite {sqlite3.sqlite_version}')")

    def start(self):
        self.spawn("the server", [PYTHON, HERE / "python_server.py", self.database, self.robots_port, self.http_port])


class Mosquitto(Station):
    name = "mosquitto, SQLite"
    sources = ("mqtt_store.py", "rows.py")
    killable = ("the store", "the broker")
    load_kind = "mqtt"

    @staticmethod
    def version(_options):
        broker = output("mosquitto", "-h")
        client = output(PYTHON, "-c", "import paho.mqtt; print(paho.mqtt.__version__)")
        found = re.search(r"version ([\d.]+)", broker or "")
        return f"mosquitto {found[1]}, paho-mqtt {client}" if found and client else None

    def start(self):
        if self.processes.get("the broker") is None or self.processes["the broker"].poll() is not None:
            user = "root" if os.getuid() == 0 else ""
            (self.folder / "mosquitto.conf").write_text(
                f"listener {self.robots_port} 127.0.0.1\nallow_anonymous true\npersistence true\nautosave_interval 1\n"
                f"set_tcp_nodelay true\npersistence_location {self.folder}/\n" + (f"user {user}\n" if user else ""))
            self.spawn("the broker", ["mosquitto", "-c", self.folder / "mosquitto.conf"], ready=False)
            wait_until(lambda: reachable(self.robots_port) or self.processes["the broker"].poll() is not None, "the broker")
        if self.processes.get("the store") is None or self.processes["the store"].poll() is not None:
            self.spawn("the store", [PYTHON, HERE / "mqtt_store.py", self.database, self.robots_port])

    def stopper(self):
        return MqttStopper(self.robots_port, "stopped-1")


class HttpStopper:
    """One connection, as a page or a script has it; a stop is from the first byte of the request to the last of the answer."""

    def __init__(self, port, path, token=None):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=10)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        authorization = f"Authorization: Bearer {token}\r\n" if token else ""
        self.request = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n{authorization}Content-Length: 0\r\n\r\n".encode()

    def stop(self):
        self.socket.sendall(self.request)
        answer = b""
        while b"\r\n\r\n" not in answer:
            received = self.socket.recv(65536)
            if not received:
                raise RuntimeError("the connection ended")
            answer += received
        head, _, body = answer.partition(b"\r\n\r\n")
        length = re.search(rb"content-length: *(\d+)", head, re.I)
        while length and len(body) < int(length[1]):
            body += self.socket.recv(65536)
        return head.split(b" ", 2)[1] == b"200"

    def close(self):
        self.socket.close()


class MqttStopper:
    """Publishes the stop with QoS 1, and waits until the robot has published that it obeyed."""

    def __init__(self, port, robot):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=10)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.reader, self.robot, self.number = mqtt.Reader(), robot, 0
        self.socket.sendall(mqtt.connect("stopper") + mqtt.subscribe(1, f"robots/{robot}/stopped"))
        while not any(kind == mqtt.SUBACK for kind, _, _ in self.packets()):
            pass

    def packets(self):
        received = self.socket.recv(65536)
        if not received:
            raise RuntimeError("the connection ended")
        return self.reader.packets(received)

    def stop(self):
        self.number += 1
        sent = struct.pack("<I", self.number)
        self.socket.sendall(mqtt.publish(self.number % 65535 + 1, f"robots/{self.robot}/stop", sent))
        obeyed = False
        while not obeyed:
            for kind, first_byte, rest in self.packets():
                if kind == mqtt.PUBLISH:
                    _, packet_id, payload = mqtt.published(first_byte, rest)
                    obeyed |= payload == sent
                    if packet_id is not None:
                        self.socket.sendall(mqtt.puback(packet_id))
        return True

    def close(self):
        self.socket.close()


ALL = (Rheonaut, Node, Python, Mosquitto)
