"""SciPy beside `rheonaut bode`, `step` and `identify`: the same questions, time of each program, and whether they agree."""
import csv
import io
import json
import math
import random
import statistics
import subprocess
import time

from stations import HERE, PYTHON, environment

DT_S, DURATION_S, NOISE_M_S = 0.01, 60, 0.0005
FIRST_ORDER = {"gain": 0.08, "time_constant_s": 0.35}


def timed(command):
    begun = time.perf_counter()
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, env=environment(), timeout=300,
                          check=False)
    if done.returncode:
        raise RuntimeError(f"{command}: {done.stderr}")
    return done.stdout, time.perf_counter() - begun


def record(options, folder):
    """Two recordings: a duty that changes at random, the exact velocity, and noise. The fractional one is by `rheonaut step`, whose
    solution is exact (docs/control.md); a sum of Grünwald and Letnikov at this period is not."""
    bits = random.Random(1)
    duty = []
    while len(duty) <= DURATION_S / DT_S:
        duty += [bits.choice((-0.3, 0.3))] * bits.randrange(20, 120)
    duty = [0.0] * 10 + duty[:round(DURATION_S / DT_S) - 9]
    with open(folder / "duty.csv", "w", newline="") as file:
        csv.writer(file).writerows([("t_s", "duty"), *((round(i * DT_S, 2), value) for i, value in enumerate(duty))])
    said, _ = timed([options.programs / "rheonaut", "step", "--duty-csv", folder / "duty.csv", "--csv"])
    fractional = [float(row["velocity_m_s"]) for row in csv.DictReader(io.StringIO(said))]
    pole, first = math.exp(-DT_S / FIRST_ORDER["time_constant_s"]), [0.0]
    for value in duty[:-1]:
        first.append(pole * first[-1] + (1 - pole) * FIRST_ORDER["gain"] * value)
    noise = random.Random(2)
    for name, velocity in (("first", first), ("fractional", fractional)):
        with open(folder / f"run-{name}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("t_s", "duty", "velocity_m_s"))
            writer.writerows((round(i * DT_S, 2), duty[i], velocity[i] + noise.gauss(0, NOISE_M_S)) for i in range(len(duty)))


def ours(options, folder):
    program = options.programs / "rheonaut"
    fit = [program, "identify", "--json", "--no-offset", "--csv"]
    return {"bode": [program, "bode", "--json", "--from-rad-s", "0.1", "--to-rad-s", "1000", "--points", "200"],
            "step": [program, "step", "--json", "--duty", "0.3", "--times", "0.1,1,5,60"],
            "fit-first": [*fit, folder / "run-first.csv", "--structure", "first_order"],
            "fit-fractional": [*fit, folder / "run-fractional.csv", "--structure", "fractional"]}


def measure(options, folder):
    """Per question: answers of both, and the median times of the programs (SciPy also without its start)."""
    record(options, folder)
    answers = {}
    for question, command in ours(options, folder).items():
        of_ours, of_scipy, inside = [], [], []
        for _ in range(options.rounds):
            said, took_s = timed(command)
            mine = json.loads(said)
            of_ours.append(took_s)
            said, took_s = timed([PYTHON, HERE / "science.py", question, folder])
            theirs = json.loads(said)
            of_scipy.append(took_s)
            inside.append(theirs["seconds"])
        answers[question] = {"ours": mine, "scipy": theirs, "ours_s": statistics.median(of_ours),
                             "scipy_s": statistics.median(of_scipy), "inside_s": statistics.median(inside)}
    return answers


def first_order_of(model):
    """(gain, time constant) of a plant file with one lag."""
    return model["kp"] / model["b3"], model["b2"] / model["b3"]


def rows(answers):
    """The lines of the report's table."""
    bode, step, first, fractional = (answers[key] for key in ("bode", "step", "fit-first", "fit-fractional"))
    decibels = max(abs(20 * math.log10(theirs) - mine) for theirs, mine in
                   zip(bode["scipy"]["magnitude"], bode["ours"]["response"]["magnitude_db"], strict=True))
    margin = abs(bode["scipy"]["phase_margin_deg"] - bode["ours"]["phase_margin_deg"])
    final = step["ours"]["velocity_m_s"][-1]
    steps = [abs(theirs - mine) / final for theirs, mine in
             zip(step["scipy"]["velocity_m_s"], step["ours"]["velocity_m_s"], strict=True)]
    said = {"bode": f"phase margins differ by {margin:.1e}°, magnitudes at 200 frequencies by {decibels:.1e} dB at most",
            "step": f"at 0.1, 1, 5, 60 s by {', '.join(f'{100 * value:.2g}' for value in steps)} % of the final velocity (the sum of"
                    " Grünwald and Letnikov is the one that is off)"}
    gain, lag = first_order_of(first["ours"]["parameters"])
    said["fit-first"] = (f"gain {gain:.5f} and {first['scipy']['parameters'][0]:.5f}, time constant {lag:.5f} and"
                         f" {first['scipy']['parameters'][1]:.5f} s (true: {FIRST_ORDER['gain']}, {FIRST_ORDER['time_constant_s']})")
    orders, mine = fractional["scipy"]["parameters"][3:], fractional["ours"]["parameters"]
    said["fit-fractional"] = (f"orders {mine['alpha']:.3f}, {mine['beta']:.3f} and {orders[0]:.3f},"
                              f" {orders[1]:.3f} (true: 1.7263, 0.8682); SciPy's search:"
                              f" {'converged' if fractional['scipy']['converged'] else 'did not converge'},"
                              f" {fractional['scipy']['evaluations']} steps")
    names = {"bode": "margins and response of (29) with (30)", "step": "velocity of (29) after a step of duty",
             "fit-first": "first-order fit, 60 s at 100 Hz", "fit-fractional": "fractional fit, 60 s at 100 Hz"}
    return [f"| {names[key]} | {1000 * one['ours_s']:.0f} ms | {1000 * one['scipy_s']:.0f} ms ({1000 * one['inside_s']:.0f} ms"
            f" without Python's start and imports) | {said[key]} |" for key, one in answers.items()]
