#!/usr/bin/env python3
"""The mathematics of a lab that uses SciPy: margins, step responses, a fit. Prints JSON: results, and seconds of each.

    science.py bode|step|fit-first|fit-fractional FOLDER

FOLDER has the recordings that deploy/compare made: run-first.csv and run-fractional.csv (t_s, duty, velocity_m_s). SciPy has
no fractional orders. Margins need none: the response is a formula. In time the fractional model is the Grünwald-Letnikov
sum, which is a filter, so `lfilter` computes it: the usual way, exact to first order in the sampling period.
"""
import csv
import json
import pathlib
import sys
import time

import numpy
import scipy.optimize
import scipy.signal

FRACTIONAL = {"kp": 0.1, "b1": 0.005682, "b2": 0.11031, "alpha": 1.7263, "beta": 0.8682}  # the paper's (29)
CONTROLLER = {"kp": 65.0028, "kd": 0.0305, "mu": 0.6524}  # the paper's (30)
DT_S = 0.01


def open_loop(omega):
    s = 1j * omega
    plant = FRACTIONAL["kp"] / (FRACTIONAL["b1"] * s ** FRACTIONAL["alpha"] + FRACTIONAL["b2"] * s ** FRACTIONAL["beta"] + 1)
    return plant / s * CONTROLLER["kp"] * (1 + CONTROLLER["kd"] * s ** CONTROLLER["mu"])


def bode(_):
    crossover = scipy.optimize.brentq(lambda omega: abs(open_loop(omega)) - 1, 0.1, 1000, xtol=1e-14)
    omega = numpy.logspace(-1, 3, 200)
    response = open_loop(omega)
    return {"crossover_rad_s": crossover, "phase_margin_deg": 180 + numpy.degrees(numpy.angle(open_loop(crossover))),
            "omega_rad_s": list(omega), "magnitude": list(abs(response))}


def weights(order, count):
    """(-1)^k binomial(order, k)."""
    k = numpy.arange(1, count)
    return numpy.concatenate(([1.0], numpy.cumprod((k - 1 - order) / k)))


def fractional_velocity(parameters, duty):
    kp, b1, b2, alpha, beta = parameters
    count = len(duty)
    feedback = b1 * DT_S ** -alpha * weights(alpha, count) + b2 * DT_S ** -beta * weights(beta, count)
    feedback[0] += 1
    return scipy.signal.lfilter([kp], feedback, duty)


def first_order_velocity(parameters, duty):
    gain, time_constant_s = parameters
    pole = numpy.exp(-DT_S / time_constant_s)  # the duty holds between the samples
    return scipy.signal.lfilter([0, gain * (1 - pole)], [1, -pole], duty)


def step(_):
    duty = numpy.full(6001, 0.3)
    velocity = fractional_velocity(list(FRACTIONAL.values()), duty)
    return {"times_s": [0.1, 1.0, 5.0, 60.0], "velocity_m_s": [velocity[round(t / DT_S)] for t in (0.1, 1, 5, 60)]}


def fit(folder, name, model, start, most):
    """From `start`, each parameter between a twentieth of that and `most`."""
    with open(folder / f"run-{name}.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    duty = numpy.array([float(row["duty"]) for row in rows])
    measured = numpy.array([float(row["velocity_m_s"]) for row in rows])
    scale = numpy.array(start)
    found = scipy.optimize.least_squares(lambda x: model(x * scale, duty) - measured, numpy.ones(len(start)),
                                         bounds=(0.05, numpy.array(most) / scale))
    return {"parameters": list(found.x * scale), "rms_m_s": float(numpy.sqrt(numpy.mean(found.fun ** 2))),
            "evaluations": int(found.nfev), "converged": bool(found.success)}


def fit_first(folder):
    return fit(folder, "first", first_order_velocity, [0.05, 0.2], [1, 4])


def fit_fractional(folder):
    return fit(folder, "fractional", fractional_velocity, [0.05, 0.01, 0.2, 1.5, 0.9], [1, 0.2, 4, 1.99, 1.2])


def main():
    begun = time.perf_counter()
    result = globals()[sys.argv[1].replace("-", "_")](pathlib.Path(sys.argv[2]))
    print(json.dumps(result | {"seconds": time.perf_counter() - begun}))


if __name__ == "__main__":
    main()
