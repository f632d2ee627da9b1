"""What is measured of each station: recording with stops, and a kill in the middle."""
import contextlib
import pathlib
import sys
import tempfile
import time

from stations import HERE

sys.path.insert(0, str(HERE.parent / "bench"))
from machine import cpu_s, resident_mb  # noqa: E402

RATE_HZ = 100


@contextlib.contextmanager
def running(kind, options):
    with tempfile.TemporaryDirectory(dir=options.scratch, prefix="compare-") as name:
        station = kind(options, pathlib.Path(name))
        try:
            station.start()
            yield station
        finally:
            station.close()


def stop_times_ms(station, count, pause_s):
    """(times of all stops, how many of them were not answered as obeyed)."""
    station.start_stopped_robot()
    stopper, times, missed = station.stopper(), [], 0
    try:
        deadline = time.monotonic() + 30
        while not stopper.stop():  # the robot is not connected yet
            if time.monotonic() > deadline:
                raise RuntimeError("the robot that is to be stopped did not connect")
            time.sleep(0.1)
        while len(times) < count:
            time.sleep(pause_s)
            begun = time.perf_counter()
            missed += not stopper.stop()
            times.append(1000 * (time.perf_counter() - begun))
    finally:
        stopper.close()
    return times, missed


def empty_bytes(kind, options):
    with running(kind, options) as station:
        station.stop()
        return station.stored()[3]


def record(kind, options, robots):
    with running(kind, options) as station:
        load = station.start_load(robots)
        time.sleep(options.warm_up_s)
        before_s, begun = cpu_s(*station.pids()), time.monotonic()
        time.sleep(options.duration_s)
        used_s, elapsed_s = cpu_s(*station.pids()) - before_s, time.monotonic() - begun
        memory_mb = resident_mb(*station.pids())
        stops, missed = stop_times_ms(station, options.stops, options.stop_pause_s)
        made = station.end_load(load)
        for other in station.loads:
            if other.poll() is None:
                other.terminate()
                other.wait()
        station.stop()
        stored, at_least, rows, size = station.stored()
    made = max(made, at_least)
    return {"cpu_us": 1e6 * used_s / (robots * RATE_HZ * elapsed_s), "memory_mb": memory_mb, "stops_ms": stops,
            "missed_stops": missed, "made": made, "lost": made - stored, "rows": rows, "size": size}


def kill(kind, options, what, robots=10):
    with running(kind, options) as station:
        load = station.start_load(robots)
        time.sleep(options.warm_up_s)
        station.kill(what)
        time.sleep(1)
        station.start()
        time.sleep(options.after_kill_s)
        made = station.end_load(load)
        station.stop()
        stored, at_least, _, _ = station.stored()
    made = max(made, at_least)
    return {"made": made, "lost": made - stored}
