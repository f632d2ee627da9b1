#!/usr/bin/env python3
"""Performs the paper's closed-loop experiment on a running station and prints what was measured.

Auto mode, setpoint 0.1 m; at t = 20 s the measured position is shifted by -0.05 m; 40 s in all. Exits with 1 when a
sample was lost or a measure leaves its bounds. The predicted rows come from rheonaut-sim, which runs the same firmware
core in virtual time.
"""
import argparse
import json
import subprocess
import sys
import time

from station_api import ApiError, Station, wait_until

SETPOINT_M = 0.1
DISTURBANCE_M = -0.05
DISTURBANCE_AT_S = 20.0
DURATION_S = 40.0

# What a run with duty [-1, 1] must meet: (measure, what it is called, target, tolerance).
BOUNDS = [
    ("settling_s", "settling time [s]", 1.15, 0.05),
    ("overshoot_percent", "overshoot [%]", 0.45, 0.2),
    ("disturbance_settling_s", "settling after the disturbance [s]", 0.63, 0.05),
]


def say(text):
    print(text, flush=True)


def follow(station, robot_id, start_robot_us, until_s):
    """Shows position against setpoint until the robot's clock has reached until_s after the start."""
    tty = sys.stdout.isatty()
    shown_s = -1.0
    while True:
        robot = station.robot(robot_id)
        elapsed_s = (robot["latest_robot_time_us"] - start_robot_us) / 1e6
        sample, setpoint_m = robot["sample"], robot["setpoint_m"] or 0.0
        bar = "#" * max(0, min(40, round(40 * sample["position_m"] / (1.25 * SETPOINT_M))))
        line = (f"  t {elapsed_s:5.1f} s   position {1e3 * sample['position_m']:7.2f} mm   setpoint "
                f"{1e3 * setpoint_m:6.1f} mm   duty {sample['duty']:+5.2f}   |{bar:<40}|")
        if tty:
            print("\r" + line, end="", flush=True)
        elif elapsed_s - shown_s >= 2.0:
            say(line)
            shown_s = elapsed_s
        if robot["link"] != "connected" or robot["mode"] != "auto":
            raise RuntimeError(f"the robot left the experiment: link {robot['link']}, mode {robot['mode']}")
        if elapsed_s >= until_s:
            if tty:
                print()
            return
        time.sleep(min(0.1, max(0.005, until_s - elapsed_s)))


def perform(station, robot_id, fluid="non_newtonian"):
    """Runs the experiment; returns (run, measures)."""
    station.command(robot_id, "zero_position")
    run = station.post("/api/v1/runs", {
        "robot_id": robot_id, "name": "Closed loop to 0.1 m", "fluid": fluid,
        "notes": "setpoint 0.1 m, position disturbance -0.05 m at 20 s, 40 s (the paper's Figure 7)"})
    run_id = run["run_id"]
    start = station.command(robot_id, "set_mode", mode="auto", setpoint_m=SETPOINT_M)["effect_at_robot_us"]
    wait_until(lambda: station.robot(robot_id)["mode"] == "auto", 5, "auto in telemetry")
    follow(station, robot_id, start, DISTURBANCE_AT_S)
    station.command(robot_id, "inject_disturbance", disturbance_m=DISTURBANCE_M)
    follow(station, robot_id, start, DURATION_S)
    run = station.post(f"/api/v1/runs/{run_id}/end", {"verdict": "done"})
    station.command(robot_id, "set_mode", mode="manual")
    return run, measures_of(station.get(f"/api/v1/runs/{run_id}/step-metrics"))


def measures_of(metrics):
    """The steps of a run, as the station measured them, under the names that `rheonaut-sim predict` uses."""
    first, second = metrics["steps"][:2]
    names = ["settling_s", "overshoot_percent", "steady_state_error_m"]
    return {**{name: first[name] for name in names}, **{"disturbance_" + name: second[name] for name in names}}


def predict(sim, duty_min):
    """What the same core does in virtual time with the duty range [duty_min, 1]."""
    command = [sim, "predict", "--duty-min", str(duty_min), "--duty-max", "1", "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def number(value, scale=1.0):
    return "never" if value is None else f"{round(scale * value, 2) + 0.0:.2f}"


def print_table(rows):
    say(f"\n  {'':34}{'settling':>10}{'overshoot':>11}{'error':>10}   {'after the disturbance':>22}")
    say(f"  {'':34}{'[s]':>10}{'[%]':>11}{'[mm]':>10}{'settling [s]':>15}{'error [mm]':>12}")
    for name, row in rows:
        say(f"  {name:34}{number(row['settling_s']):>10}{number(row['overshoot_percent']):>11}"
            f"{number(row['steady_state_error_m'], 1e3):>10}{number(row['disturbance_settling_s']):>15}"
            f"{number(row['disturbance_steady_state_error_m'], 1e3):>12}")


def faults(run, measures):
    """What is wrong with the run, in words; empty when all is well."""
    found = []
    missing = run["samples_expected"] - run["samples_stored"]
    if missing or run["samples_lost"]:
        found.append(f"{missing} of {run['samples_expected']} samples are missing, {run['samples_lost']} known lost")
    for key, name, target, tolerance in BOUNDS:
        value = measures[key]
        if value is None or abs(value - target) > tolerance + 1e-9:
            found.append(f"{name} is {number(value)}, expected {target} +- {tolerance}")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="data folder of the running station")
    parser.add_argument("--robot", default="sim-1")
    parser.add_argument("--sim", required=True, help="path of rheonaut-sim")
    options = parser.parse_args()
    station = Station(options.data)
    station.wait_for_robot(options.robot)
    say(f"robot '{options.robot}': auto mode, setpoint {1e3 * SETPOINT_M:.0f} mm; at {DISTURBANCE_AT_S:.0f} s the "
        f"measured position is shifted by {1e3 * DISTURBANCE_M:.0f} mm; {DURATION_S:.0f} s in all")
    run, measures = perform(station, options.robot)
    print_table([("measured, duty [-1, 1]", measures),
                 ("predicted, duty [-1, 1]", predict(options.sim, -1)),
                 ("predicted, one-way motor [0, 1]", predict(options.sim, 0))])
    say(f"\n  samples   {run['samples_stored']} recorded, {run['samples_lost']} lost, "
        f"{run['samples_expected']} expected (run {run['run_id']})")
    found = faults(run, measures)
    for fault in found:
        say(f"  FAILED    {fault}")
    return 1 if found else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except (ApiError, OSError, RuntimeError, subprocess.CalledProcessError) as error:
        sys.exit(f"experiment: {error}")
