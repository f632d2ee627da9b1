"""What the benches measure of a process, and a station as one. Standard library only."""
import contextlib
import json
import os
import pathlib
import subprocess
import time
import urllib.request

TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def cpu_s(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def written_bytes(pid):
    lines = pathlib.Path(f"/proc/{pid}/io").read_text().splitlines()
    return int(dict(line.split(": ") for line in lines)["write_bytes"])


def resident_mb(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) / 1024
    return 0


def forget_peak(pid):
    """resident_mb() is the most since then."""
    pathlib.Path(f"/proc/{pid}/clear_refs").write_text("5")


@contextlib.contextmanager
def station(programs, folder, config=""):
    """That admits a whole fleet; `config` is TOML, of other sections than [robots]."""
    data = folder / "data"
    fleet = pathlib.Path(__file__).resolve().parents[2] / "deploy" / "fleet.toml"
    (folder / "station.toml").write_text(fleet.read_text() + config)
    with open(folder / "station.log", "wb") as log:
        process = subprocess.Popen([programs / "rheonaut", "serve", "--data", data, "--http", "127.0.0.1:0", "--robots",
                                    "127.0.0.1:0", "--config", folder / "station.toml"], stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    try:
        while not (data / "endpoints.json").exists():
            if process.poll() is not None:
                raise RuntimeError((folder / "station.log").read_text())
            time.sleep(0.05)
        yield process, json.loads((data / "endpoints.json").read_text())["robots"]
    finally:
        process.terminate()
        process.wait()


def ask(http, token, method, path, body=None):
    headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
    content = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"http://{http}/api/v1{path}", content, headers, method=method)
    return urllib.request.urlopen(request, timeout=30)


VIEWERS_OF_A_TOKEN = 30


@contextlib.contextmanager
def viewers(programs, http, count, robots, token=None):
    """So many pages, each of which watches one robot; they may not lose their connection. Without a token, of the bare
    loop."""
    started = []
    for first in range(0, count, VIEWERS_OF_A_TOKEN):
        secret = "none"
        if token:
            with ask(http, token, "POST", "/tokens", {"name": f"viewers-{first}", "scopes": "read"}) as answer:
                secret = json.load(answer)["secret"]
        pages = min(VIEWERS_OF_A_TOKEN, count - first)
        command = [programs / "live_viewers", http.rpartition(":")[2], secret, str(pages), str(robots), str(first)]
        started.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        assert started[-1].stdout.readline() == "ready\n", "a viewer was refused"
    try:
        yield
    finally:
        for each in started:
            said, _ = each.communicate()
            assert each.returncode == 0 and int(said) > 0, "a viewer lost its connection"
