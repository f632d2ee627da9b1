"""Turns what a station has recorded of one robot into a trace for stop_and_control.pml.

    robot, station = actions(database, robot_id)       lists of (action, argument), each in the order of its own clock

The robot's list has in the order of the robot's time: the commands that it says it has run, its emergencies, clears,
lapsed leases and lost links, its boots, and MOVING wherever samples between two of these show a duty. The station's list
has in the order of its own clock: stops, commands, who got control, connections, and its restarts. Renewals, pings,
parameters and what the station sends by itself are left out. ValueError: something that the model has no word for.
"""
import json
import pathlib
import re
import sqlite3

MODEL = pathlib.Path(__file__).resolve().parent / "stop_and_control.pml"
LEFT_OUT = {"ping", "renew_lease", "get_parameters", "set_parameter", "drop_timed", "zero_position"}
OPERATORS_OF_THE_MODEL = 2


def words():
    """The numbers of the model's actions."""
    text = MODEL.read_text()
    frames = re.search(r"mtype = \{ (welcome.*?) \}", text).group(1).split(", ")
    numbers = {name: len(frames) - place for place, name in enumerate(frames)}
    return numbers | {name: int(number) for name, number in re.findall(r"^#define ([A-Z]+) (2\d)\b", text, re.M)}


def action_of(kind, arguments):
    """The model's word for a command; None: the model leaves it out."""
    given = json.loads(arguments or "{}")
    if kind in LEFT_OUT:
        return None
    if kind == "emergency_stop":
        return "stop"
    if kind == "clear_emergency":
        return "clear"
    if "execute_at_robot_us" in given and kind == "set_duty":
        return "timed"
    if kind == "set_duty" and given.get("duty") != 0:
        return "duty"
    if kind == "set_mode" and given.get("mode") == "auto":
        return "automatic"
    raise ValueError(f"the model has no {kind} {arguments}")


def actions(database, robot_id):
    with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as rows:
        rows.row_factory = sqlite3.Row
        commands = rows.execute("SELECT * FROM robot_command WHERE robot_id = ? ORDER BY submitted_at_us", (robot_id,)).fetchall()
        events = rows.execute("SELECT * FROM event LEFT JOIN boot USING (boot_key, robot_id) WHERE robot_id = ? ORDER BY event_row", (robot_id,)).fetchall()
        starts = rows.execute("SELECT at_us FROM audit WHERE action = 'station.started' ORDER BY at_us").fetchall()[1:]
        duties = rows.execute(
            "SELECT segment.boot_key, first_robot_time_us + (row - first_row) * period_us AS robot_time_us FROM segment "
            "JOIN boot USING (boot_key) JOIN sample ON row BETWEEN first_row AND first_row + last_seq - first_seq "
            "WHERE robot_id = ? AND sample.duty != 0 ORDER BY 1, 2", (robot_id,)).fetchall()
        boots = {str(row["boot_id"] % 2**64): row["boot_key"] for row in rows.execute("SELECT * FROM boot WHERE robot_id = ?", (robot_id,))}
    station, tenures = of_station(commands, events, starts)
    return of_robot(commands, events, duties, boots, tenures), station


def of_station(commands, events, starts):
    """The list, and of each command its time of control."""
    actors = sorted({command["actor"] for command in commands if not command["actor"].startswith("station:")})
    moments = [(row["at_us"], 0, "RESTART", "") for row in starts]
    for event in events:
        if event["event_seq"] is None:
            moments.append((event["received_at_us"], 1, event["kind"], event["detail"]))
    for command in commands:
        if not command["actor"].startswith("station:"):
            moments.append((command["submitted_at_us"], 2, command, ""))
    moments.sort(key=lambda moment: moment[:2])
    for place in range(len(moments) - 1):  # a command that takes control is submitted, and then control is taken
        (_, kind, command, _), (_, _, event, detail) = moments[place], moments[place + 1]
        if kind == 2 and event == "control_taken" and detail == f"by {command['actor']}":
            moments[place], moments[place + 1] = moments[place + 1], moments[place]
    found, tenures, tenure = [], {}, 0
    for _, _, what, detail in moments:
        if isinstance(what, str):
            taken = re.match(r"by (\S+) from|by (\S+) to (\S+)|by (\S+)", detail) if what.startswith("control_") else None
            if what in ("control_taken", "control_forced", "control_handed_over"):
                tenure += 1
                holder = taken.group(1) or taken.group(3) or taken.group(4)
                if holder not in actors:
                    actors.append(holder)
                found.append(("CONTROL", actors.index(holder) + 1))
            elif what in ("control_released", "control_expired"):
                found.append(("CONTROL", 0))
            elif what in ("connected", "disconnected", "RESTART"):
                found.append(({"connected": "CONNECTED", "disconnected": "SILENCE"}.get(what, what), 0))
            continue
        action = action_of(what["kind"], what["arguments"])
        tenures[what["command_id"]] = tenure
        if action is not None:
            found.append((action, actors.index(what["actor"]) + 1))
    if len(actors) > OPERATORS_OF_THE_MODEL:
        raise ValueError(f"the model has two operators, and not {actors}")
    return found, tenures


def of_robot(commands, events, duties, boots, tenures):
    moments = []
    for command in commands:
        ran = command["effect_at_robot_us"] and command["state"] not in ("rejected", "expired")
        action = action_of(command["kind"], command["arguments"]) if ran else None
        if action in ("duty", "automatic"):
            at_us = command["effect_at_robot_us"]
            moments.append((boots[command["boot_id"]], int(at_us), 0, action, tenures[command["command_id"]]))
    is_first_boot = True
    for event in events:
        if event["event_seq"] is None:
            continue
        command_id = str(event["command_id"] % 2**64)
        kind, argument = event["kind"], 0
        if kind == "boot":
            action, is_first_boot = None if is_first_boot else "BOOT", False
        elif kind == "emergency":
            action = {"command": "stop", "reset": None}.get(event["cause"], "EMERGENCY")
        elif kind == "emergency_cleared":
            action, argument = "clear", tenures[command_id]
        else:
            action = {"lease_lapsed": "LAPSE", "link_lost": "SILENCE"}.get(kind)
        if action:
            moments.append((event["boot_key"], event["robot_time_us"], 0, action, argument))
    moments += [(row["boot_key"], row["robot_time_us"], 1, "MOVING", 0) for row in duties]
    found = []
    for *_, action, argument in sorted(moments, key=lambda moment: moment[:3]):
        if action != "MOVING" or not found or found[-1][0] != "MOVING":
            found.append((action, argument))
    return found


def text(trace):
    numbers = words()
    return " ".join(str(256 * numbers[action] + argument) for action, argument in trace)


def is_allowed(model, robot, station):
    """Whether the model has an execution with these actions."""
    def count(trace, *kinds):
        return sum(action in kinds for action, _ in trace)
    bounds = {
        "STOPS": count(station, "stop") + count(station, "CONNECTED"), "FAULTS": count(robot, "EMERGENCY"),
        "BOOTS": 1 + count(robot, "BOOT"), "CONNECTIONS": count(station, "CONNECTED"),
        "RESTARTS": count(station, "RESTART"), "TENURES": count(station, "CONTROL"),
        "ERAS": 1 + count(robot, "LAPSE") + 2 * count(robot, "SILENCE"),
        "COMMANDS": len(station), "REPEATS": 0,
    }
    _, reached = model.explore(bounds, ROBOT_TRACE=text(robot), STATION_TRACE=text(station))
    if reached not in ("", "assertion violated 0"):
        raise AssertionError(f"an assertion of the model fails in a real execution: {reached}")
    return bool(reached)
