#!/usr/bin/env python3
"""Performs the paper's closed-loop experiment on a running station with a simulated robot and prints what was measured.

Auto mode, setpoint 0.1 m; at t = 20 s the measured position is shifted by -0.05 m; 40 s in all. The robot steers by its
estimate; the simulator says where it really was. Exits with 1 when a sample was lost or the true position leaves its
bounds. The predicted rows come from rheonaut-sim, which runs the same firmware core in virtual time on the true position.
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

BAND_M = 0.02 * SETPOINT_M  # of settling
# What the true position must do after the setpoint, in the fluid of the paper's equation (29).
MOST_SETTLING_S = 1.4
MOST_OVERSHOOT_PERCENT = 2.5
MOST_ERROR_M = 0.002


class Truth:
    """The simulator's true position, from the file that `rheonaut-sim --truth` writes; from where the robot was zeroed."""

    def __init__(self, path, zeroed_us=0):
        self.path = path
        self.zeroed_us = zeroed_us

    def points(self):
        """[(robot_time_us, true_position_m)], ascending, of complete lines."""
        with open(self.path) as file:
            lines = file.read().splitlines(keepends=True)[1:]
        points = [tuple(map(float, line.split(","))) for line in lines if line.endswith("\n")]
        origin_m = next((x for t, x in points if t >= self.zeroed_us), 0.0)
        return [(t, x - origin_m) for t, x in points]

    def at(self, robot_time_us):
        return min(self.points()[-500:], key=lambda point: abs(point[0] - robot_time_us))[1]

    def measures(self, start_us):
        """Under the names of the measured ones. The disturbance shifts what the robot believes: in truth it then moves
        on by as much, away from the setpoint."""
        points = [((t - start_us) / 1e6, x) for t, x in self.points() if t >= start_us]
        first = [(t, x) for t, x in points if t < DISTURBANCE_AT_S]
        second = [(t - DISTURBANCE_AT_S, x) for t, x in points if DISTURBANCE_AT_S <= t < DURATION_S]
        return {"settling_s": settling_s(first, SETPOINT_M),
                "overshoot_percent": 100 * max(0.0, max(x for _, x in first) / SETPOINT_M - 1),
                "steady_state_error_m": SETPOINT_M - first[-1][1],
                "disturbance_settling_s": settling_s(second, SETPOINT_M - DISTURBANCE_M),
                "disturbance_steady_state_error_m": SETPOINT_M - DISTURBANCE_M - second[-1][1]}


def settling_s(points, target_m):
    """The first time from which on all is within the band; None when the end is not."""
    outside = [i for i, (_, x) in enumerate(points) if abs(x - target_m) > BAND_M]
    first_inside = outside[-1] + 1 if outside else 0
    return points[first_inside][0] if first_inside < len(points) else None


def say(text):
    print(text, flush=True)


def follow(station, robot_id, start_robot_us, until_s, truth=None):
    """Shows estimate and true position against the setpoint until the robot's clock has reached until_s after the start."""
    tty = sys.stdout.isatty()
    shown_s = -1.0
    while True:
        robot = station.robot(robot_id)
        elapsed_s = (robot["latest_robot_time_us"] - start_robot_us) / 1e6
        sample, setpoint_m = robot["sample"], robot["setpoint_m"] or 0.0
        bar = "#" * max(0, min(40, round(40 * sample["position_m"] / (1.25 * SETPOINT_M))))
        estimate_m = sample["position_m"] - robot["disturbance_m"]
        line = (f"  t {elapsed_s:5.1f} s   estimate {1e3 * estimate_m:7.2f} ± {2e3 * robot['position_sd_m']:4.1f} mm")
        if truth:
            line += f"   true {1e3 * truth.at(robot['latest_robot_time_us']):7.2f} mm"
        line += f"   setpoint {1e3 * setpoint_m:6.1f} mm   duty {sample['duty']:+5.2f}   |{bar:<40}|"
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


def send_model(station, robot_id, rheonaut, fluid="non_newtonian"):
    """Gives the station the model of the fluid, and has it sent to the robot, read back and confirmed; the model."""
    asked = subprocess.run([rheonaut, "estimator", "--plant", fluid, "--json"], check=True, capture_output=True, text=True)
    model = json.loads(asked.stdout)
    station.post(f"/api/v1/fluids/{fluid}/model", model)
    station.post(f"/api/v1/robots/{robot_id}/fluid", {"fluid": fluid})
    def state():
        return station.robot(robot_id)["model"]
    wait_until(lambda: state()["state"] not in ("sending", "assumed"), 30, "the model on the robot")
    if state()["state"] != "confirmed":
        raise RuntimeError(f"the robot has no confirmed model: {state()['reason']}")
    return model


def perform(station, robot_id, fluid="non_newtonian", truth=None):
    """Runs the experiment; returns (run, measures, true measures or None)."""
    zeroed = station.command(robot_id, "zero_position")
    if truth:
        truth.zeroed_us = zeroed["effect_at_robot_us"]
    run = station.post("/api/v1/runs", {
        "robot_id": robot_id, "name": "Closed loop to 0.1 m", "fluid": fluid,
        "notes": "setpoint 0.1 m, position disturbance -0.05 m at 20 s, 40 s (the paper's Figure 7)"})
    run_id = run["run_id"]
    start = station.command(robot_id, "set_mode", mode="auto", setpoint_m=SETPOINT_M)["effect_at_robot_us"]
    wait_until(lambda: station.robot(robot_id)["mode"] == "auto", 30, "auto in telemetry")
    follow(station, robot_id, start, DISTURBANCE_AT_S, truth)
    station.command(robot_id, "inject_disturbance", disturbance_m=DISTURBANCE_M)
    follow(station, robot_id, start, DURATION_S, truth)
    run = station.post(f"/api/v1/runs/{run_id}/end", {"verdict": "done"})
    station.command(robot_id, "set_mode", mode="manual")
    measures = measures_of(station.get(f"/api/v1/runs/{run_id}/step-metrics"))
    return run, measures, truth and truth.measures(start)


def measures_of(metrics):
    """The steps of a run, as the station measured them, under the names that `rheonaut-sim predict` uses."""
    first, second = metrics["steps"][:2]
    names = ["settling_s", "overshoot_percent", "steady_state_error_m", "position_sd_m"]
    return {**{name: first[name] for name in names}, **{"disturbance_" + name: second[name] for name in names}}


def predict(sim, duty_min):
    """What the same core does in virtual time with the duty range [duty_min, 1]."""
    command = [sim, "predict", "--duty-min", str(duty_min), "--duty-max", "1", "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def number(value, scale=1.0):
    return "never" if value is None else f"{round(scale * value, 2) + 0.0:.2f}"


def error_mm(row, name):
    """With ± 2 sd where the position is an estimate."""
    sd_m = row.get(name.replace("steady_state_error_m", "position_sd_m"), 0)
    return number(row[name], 1e3) + (f" ± {2e3 * sd_m:.1f}" if sd_m else "")


def print_table(rows):
    say(f"\n  {'':34}{'settling':>10}{'overshoot':>11}{'error':>15}   {'after the disturbance':>22}")
    say(f"  {'':34}{'[s]':>10}{'[%]':>11}{'[mm]':>15}{'settling [s]':>15}{'error [mm]':>15}")
    for name, row in rows:
        say(f"  {name:34}{number(row['settling_s']):>10}{number(row['overshoot_percent']):>11}"
            f"{error_mm(row, 'steady_state_error_m'):>15}{number(row['disturbance_settling_s']):>15}"
            f"{error_mm(row, 'disturbance_steady_state_error_m'):>15}")


def faults(run, measures, true):
    """What is wrong with the run, in words; empty when all is well."""
    found = []
    missing = run["samples_expected"] - run["samples_stored"]
    if missing or run["samples_lost"]:
        found.append(f"{missing} of {run['samples_expected']} samples are missing, {run['samples_lost']} known lost")
    if true["settling_s"] is None or true["settling_s"] > MOST_SETTLING_S:
        found.append(f"true settling time is {number(true['settling_s'])} s, at most {MOST_SETTLING_S} expected")
    if true["overshoot_percent"] > MOST_OVERSHOOT_PERCENT:
        found.append(f"true overshoot is {number(true['overshoot_percent'])} %, at most {MOST_OVERSHOOT_PERCENT} expected")
    if abs(true["steady_state_error_m"]) > MOST_ERROR_M:
        found.append(f"true error is {number(true['steady_state_error_m'], 1e3)} mm, at most {1e3 * MOST_ERROR_M} expected")
    for prefix in ("", "disturbance_"):
        off_m = abs(true[prefix + "steady_state_error_m"] - measures[prefix + "steady_state_error_m"])
        if off_m > 2 * measures[prefix + "position_sd_m"]:
            found.append(f"the estimate is {1e3 * off_m:.1f} mm off, more than 2 sd")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="data folder of the running station")
    parser.add_argument("--robot", default="sim-1")
    parser.add_argument("--rheonaut", required=True, help="path of rheonaut")
    parser.add_argument("--sim", required=True, help="path of rheonaut-sim")
    parser.add_argument("--truth", required=True, help="file that `rheonaut-sim --truth` writes")
    options = parser.parse_args()
    station = Station(options.data)
    station.wait_for_robot(options.robot)
    say(f"robot '{options.robot}': auto mode, setpoint {1e3 * SETPOINT_M:.0f} mm; at {DISTURBANCE_AT_S:.0f} s the "
        f"measured position is shifted by {1e3 * DISTURBANCE_M:.0f} mm; {DURATION_S:.0f} s in all")
    model = send_model(station, options.robot, options.rheonaut)
    say("model of the fluid (29), sent to the robot, read back and confirmed: gains " +
        ", ".join(f"{gain:.3g}" for gain in model["model_gain_m_s"]) + " m/s, time constants " +
        ", ".join(f"{constant:.3g}" for constant in model["model_time_constant_s"]) +
        f" s, fit error {100 * model['fit_error']:.2f} %")
    run, measures, true = perform(station, options.robot, truth=Truth(options.truth))
    print_table([("true, as the simulator says", true),
                 ("by the robot's estimate, ± 2 sd", measures),
                 ("predicted on the true position", predict(options.sim, -1)),
                 ("predicted, one-way motor [0, 1]", predict(options.sim, 0))])
    say(f"\n  samples   {run['samples_stored']} recorded, {run['samples_lost']} lost, "
        f"{run['samples_expected']} expected (run {run['run_id']})")
    found = faults(run, measures, true)
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
