"""Figures 5 to 9 and A2 of the paper, drawn from what our programs print; where a robot moves by its own estimate, the
position that it believes and its true position.

The scenarios are played in virtual time with the default sensor and the seed of the scenario's file, which nobody chose
for its result. The robot has the model of the fabric softener, which no one has confirmed to it.
"""
import math

from experiment import BAND_M, DISTURBANCE_AT_S, DISTURBANCE_M, SETPOINT_M
from paper_svg import BLUE, GREY, INK, RED, SETPOINT, Plot, number

STEP = "rheonaut step --duty 0.3 --every-s 0.01 --until-s 7 --csv"
BODE = "rheonaut bode --from-rad-s 0.1 --to-rad-s 1000 --points 161"
BODE_OF_POSITION, BODE_OF_VELOCITY = f"{BODE} --csv", f"{BODE} --velocity-loop --csv"
BODE_AT_65 = "rheonaut bode --from-rad-s 65 --to-rad-s 66 --points 2 --json"
PREDICTED = "rheonaut predict --a 0.5 --csv"
PREDICTED_IN_WATER = "rheonaut predict --a 0.5 --plant newtonian --csv"


def played(scenario):
    """By its accelerometer, also where the scenario's own file has the perfect sensor."""
    return f"rheonaut-sim play {scenario} --sensor bno055"


def thinned(table, dense):
    """The rows that are drawn: each 20 ms in the spans where it moves, else each 100 ms."""
    keep = [i for i, t in enumerate(table["t_s"])
            if round(100 * t) % (2 if any(a <= t <= b for a, b in dense) else 10) == 0]
    return {name: [values[i] for i in keep] for name, values in table.items()}


def as_seen(table):
    """The true position as the controller would see it: with the disturbance, which shifts the measurement."""
    return [x + (DISTURBANCE_M if t > DISTURBANCE_AT_S - 0.005 else 0) for t, x in zip(table["t_s"], table["true_position_m"])]


def edges(table, times):
    return [x + times * sd for x, sd in zip(table["position_m"], table["position_sd_m"])]


def figure_5(programs):
    run = thinned(programs.csv(played("figure_5")), [(0.9, 3), (5.9, 8)])
    model = programs.csv(STEP)
    start_s, end_s = 1.0, 6.0
    plot = Plot("Figure 5: duty 0.3 for 5 s in the fabric softener",
                "the model (29), and a simulated robot that has only its accelerometer")
    position = plot.panel("position (m)", 230, (0, 8), (-0.03, 0.19))
    t_s = run["t_s"]
    position.band(t_s, edges(run, -2), edges(run, 2), BLUE, "believed ± 2 sd")
    position.line(t_s, run["position_m"], BLUE, "believed")
    position.line(t_s, run["true_position_m"], RED, "true")
    shown = range(0, int(100 * (end_s - start_s)) + 1, 10)
    position.line([start_s + model["t_s"][i] for i in shown], [model["position_m"][i] for i in shown], INK, "model (29)",
                  "5 4")
    errors_panel(plot, [(t_s, run, run["true_position_m"], BLUE, "")], (0, 8), (-30, 30))
    duty = plot.panel("duty", 70, (0, 8), (-0.05, 0.4))
    duty.held(t_s, run["duty"], INK)
    plot.x_title("time (s)")
    return plot


def errors_panel(plot, runs, x, y):
    """What the robot does not know: the true position less the believed one, beside the ± that the robot states."""
    panel = plot.panel("true − believed (mm)", 100, x, y)
    for t_s, run, true_m, colour, name in runs:
        panel.band(t_s, [-2e3 * sd for sd in run["position_sd_m"]], [2e3 * sd for sd in run["position_sd_m"]], colour,
                   f"{name}± 2 sd")
        panel.line(t_s, [1e3 * (a - b) for a, b in zip(true_m, run["position_m"])], colour, width=1.3)


def figure_6(programs):
    plot = Plot("Figure 6: Bode diagram of the open loop, controller (30) and model (29)",
                "printed: a crossover at 65 rad/s with a phase margin of 72°")
    x = (0.1, 1000)
    loops = [(programs.csv(BODE_OF_POSITION), RED, "position, (29)", ""),
             (programs.csv(BODE_OF_VELOCITY), BLUE, "velocity, without 1/s", "6 4")]
    found, at_65 = programs.json("rheonaut bode --json"), programs.json(BODE_AT_65)["response"]
    crossover_rad_s = found["gain_crossover_rad_s"]
    panels = [plot.panel("magnitude (dB)", 200, x, (-100, 60), x_log=True),
              plot.panel("phase (°)", 200, x, (-225, 15), x_log=True)]
    panels[0].level(0, "0 dB")
    panels[1].level(-180, "−180°")
    for panel, name in zip(panels, ("magnitude_db", "phase_deg")):
        for table, colour, label, dash in loops:
            panel.line(table["omega_rad_s"], table[name], colour, label if panel is panels[0] else "", dash)
        panel.mark(crossover_rad_s, "" if panel is panels[1] else f"{crossover_rad_s:.1f} rad/s: 0 dB", RED, 190, "end")
        panel.mark(65, "" if panel is panels[1] else f"65 rad/s: {number(at_65['magnitude_db'][0], 1)} dB", GREY, 14)
    panels[1].note(crossover_rad_s, f"{found['phase_margin_deg']:.0f}° above −180°", RED, 190, "end")
    panels[1].note(65, f"{number(-180 - at_65['phase_deg'][0], 0)}° below −180°", GREY, 140)
    plot.x_title("frequency (rad/s)")
    return plot


def closed_loop(programs, scenario, prediction, title):
    run, predicted = (thinned(programs.csv(command), [(0, 3), (19.9, 23)]) for command in (played(scenario), prediction))
    t_s, true_m, x = run["t_s"], as_seen(run), (0, 40)
    plot = Plot(title, "to 0.1 m; after 20 s the measured position is shifted by −0.05 m, and so is the true one as drawn here")
    panels = [plot.panel("position (m)", 200, x, (-0.01, 0.13)),
              plot.panel("position (m), the step", 150, (0, 3), (0.08, 0.115), part=(0, 0.47)),
              plot.beside("position (m), disturbance", 150, (20, 23), (0.08, 0.115), part=(0.53, 1))]
    for panel in panels:
        named = panel is panels[0]
        if not named:
            panel.band([0, 40], [SETPOINT_M - BAND_M] * 2, [SETPOINT_M + BAND_M] * 2, SETPOINT, "± 2 mm")
        panel.line(t_s, run["reference_m"], SETPOINT, "setpoint" if named else "", "6 4", 1.2)
        panel.line(t_s, run["position_m"], BLUE, "believed" if named else "")
        panel.line(t_s, true_m, RED, "true" if named else "")
        panel.line(predicted["t_s"], predicted["measured_m"], INK, "predicted, with the exact position" if named else "", "2 3",
                   1.2)
    top = max(2e3 * max(run["position_sd_m"]), 1)
    limit = 10 * math.ceil(top / 10)
    errors_panel(plot, [(t_s, run, true_m, BLUE, "")], x, (-limit, limit))
    duty = plot.panel("duty", 90, x, (-1.1, 1.1))
    duty.held(t_s, run["duty"], INK)
    plot.x_title("time (s)")
    return plot


def figure_7(programs):
    return closed_loop(programs, "figure_7", PREDICTED, "Figure 7: controller (30) in the fabric softener")


def figure_8(programs):
    plot = Plot("Figure 8: controller (30) in two fluids", "to 0.1 m, without a disturbance; the first 4 s of 20")
    x, position = (0, 4), None
    runs = []
    for scenario, fluid, colour in (("figure_8_non_newtonian", "softener", RED), ("figure_8_water", "water", BLUE)):
        table = programs.csv(played(scenario))
        kept = [i for i, t in enumerate(table["t_s"]) if t <= x[1] and i % 2 == 0]
        run = {name: [values[i] for i in kept] for name, values in table.items()}
        if position is None:
            position = plot.panel("position (m)", 250, x, (-0.01, 0.13))
            position.line(run["t_s"][1:], run["reference_m"][1:], SETPOINT, "setpoint", "6 4", 1.2)
        position.line(run["t_s"], run["true_position_m"], colour, f"{fluid}, true")
        position.line(run["t_s"], run["position_m"], colour, "believed", "2 3", 1.4)
        runs.append((run["t_s"], run, run["true_position_m"], colour, f"{fluid} "))
    errors_panel(plot, runs, x, (-15, 15))
    duty = plot.panel("duty", 90, x, (-1.1, 1.1))
    for t_s, run, _, colour, _ in runs:
        duty.held(t_s, run["duty"], colour)
    plot.x_title("time (s)")
    return plot


def figure_9(programs):
    return closed_loop(programs, "figure_9", PREDICTED_IN_WATER, "Figure 9: controller (30) in water")


def figure_a2(programs):
    run = programs.csv(played("figure_a2"))
    every = range(0, len(run["t_s"]), 4)
    plot = Plot("Figure A2: impedance along the tube",
                "glucose from 0.20 to 0.30 m, passed at 0.05 m/s; the noise and the offset of the electrode are assumed")
    impedance = plot.panel("impedance (mV)", 260, (0, 0.45), (105, 205))
    impedance.level(195, "175 + 20 mV")
    impedance.level(155, "175 − 20 mV: below it the robot stops")
    impedance.level(120, "120 mV, as printed")
    for name, colour, label in (("position_m", BLUE, "at the position that the robot believes"),
                                ("true_position_m", RED, "at its true position")):
        impedance.dots([run[name][i] for i in every], [run["impedance_mv"][i] for i in every], colour, label)
    plot.x_title("position (m)")
    return plot


FIGURES = {"figure_5": figure_5, "figure_6": figure_6, "figure_7": figure_7, "figure_8": figure_8, "figure_9": figure_9,
           "figure_a2": figure_a2}


def drawn(programs):
    """{name: Plot}"""
    return {name: draw(programs) for name, draw in FIGURES.items()}
