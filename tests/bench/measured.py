"""What the benches measure of a process, and a station as one. Standard library only."""
import contextlib
import json
import os
import pathlib
import subprocess
import time

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
