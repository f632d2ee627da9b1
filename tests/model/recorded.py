"""Turns what a station has recorded of one robot into a trace for stop_and_control.pml.

    traces(database)        by robot_id, its Trace: `robot` and `station`, lists of (action, argument), each in the order
                            of its own clock; `left_out`: why the rest of the record is not in it ("": all of it is)

The robot's list has in the order of the robot's time: the commands that it says it has run, its emergencies, clears,
lapsed leases and lost links, what ended by itself, its boots, and MOVING wherever samples between two of these show a
duty. The station's list has in the order of its own clock: stops, commands, who got control, connections, and its
restarts. Left out are renewals, pings, parameters, what the station sends by itself, and commands that had no effect.

The model lacks some of what a station can do (NOT_IN_THE_MODEL). The trace ends before the first of these: the beginning
of an execution is an execution. What the robot has done after it, and because of it, is not in the trace either.
"""
import dataclasses
import json
import pathlib
import re
import sqlite3

MODEL = pathlib.Path(__file__).resolve().parent / "stop_and_control.pml"
OPERATORS_OF_THE_MODEL = 4
LONGEST = 200  # actions of the station, and of the robot: numbers of the model have a byte
MOST_STOPS = 30  # with connections, of which each may repeat one: the model remembers stops as bits
NO_MOTION = {"ping", "renew_lease", "get_parameters", "set_parameter", "drop_timed", "zero_position", "set_controller",
             "restore_controller", "inject_disturbance"}  # by itself none of these sets the motor in motion, or ends motion
SCHEDULE = "a schedule of duties"
TIMED = "a timed command other than a duty"
EXPERIMENT = "an experiment"
UNANSWERED = "a duty without an answer"
LINK_LOSS = "another action after link loss than stop"
OPERATORS = "a fifth operator"
RESTORED = "a database that was restored from a backup"
LENGTH = f"more than {LONGEST} actions, or {MOST_STOPS} stops and connections"
UNKNOWN = "a command that the killed station had not stored"
LOST_EVENTS = "events of the robot that were lost"
NO_EVENTS = "a robot that reports no events"
REPLAYED = "a simulated robot that replays a recording"
NOT_IN_THE_MODEL = (SCHEDULE, TIMED, EXPERIMENT, UNANSWERED, LINK_LOSS, OPERATORS, RESTORED, LENGTH, UNKNOWN, LOST_EVENTS,
                    NO_EVENTS, REPLAYED)


class NotInTheModel(Exception):
    """With one of the reasons above."""


@dataclasses.dataclass
class Trace:
    robot: list
    station: list
    left_out: str = ""


def words():
    """The numbers of the model's actions."""
    text = MODEL.read_text()
    frames = re.search(r"mtype = \{ (welcome.*?) \}", text).group(1).split(", ")
    numbers = {name: len(frames) - place for place, name in enumerate(frames)}
    return numbers | {name: int(number) for name, number in re.findall(r"^#define ([A-Z_]+) +(2\d)\b", text, re.M)}


def action_of(kind, arguments):
    """The model's word for a command; None: the model leaves it out."""
    given = json.loads(arguments or "{}")
    if kind == "set_parameter" and given.get("name") == "link_loss_action" and given.get("value") != 0:
        raise NotInTheModel(LINK_LOSS)
    if kind in NO_MOTION:
        return None
    if kind in ("emergency_stop", "clear_emergency"):
        return {"emergency_stop": "stop", "clear_emergency": "clear"}[kind]
    if kind == "set_duty_schedule":
        raise NotInTheModel(SCHEDULE)
    is_rest = kind == "set_duty" and given["duty"] == 0 or kind == "set_mode" and given["mode"] == "manual"
    if "execute_at_robot_us" in given:
        if kind == "set_duty" and not is_rest:
            return "timed"
        raise NotInTheModel(TIMED)
    if is_rest:
        return "rest"
    return {"set_duty": "duty", "set_mode": "automatic", "set_setpoint": "automatic"}[kind]


class Record:
    """What the database has of one robot."""

    def __init__(self, rows, robot_id):
        def select(query):
            return [dict(row) for row in rows.execute(query, (robot_id,))]

        self.commands = select("SELECT * FROM robot_command WHERE robot_id = ? ORDER BY submitted_at_us")
        self.events = select("SELECT * FROM event LEFT JOIN boot USING (boot_key, robot_id) WHERE robot_id = ? ORDER BY event_row")
        boots = select("SELECT * FROM boot WHERE robot_id = ?")
        self.boots = {str(row["boot_id"] % 2**64): row["boot_key"] for row in boots}
        self.is_a_replay = any(row["firmware_version"].endswith(" replay") for row in boots)
        self.moving = select(  # CROSS JOIN: in this order, and of each segment only its own samples
            "SELECT boot_key, segment.received_at_us, first_robot_time_us + (row - first_row) * period_us AS robot_time_us "
            "FROM boot CROSS JOIN segment USING (boot_key) CROSS JOIN sample ON row BETWEEN first_row AND "
            "first_row + last_seq - first_seq WHERE robot_id = ? AND (min_duty <> 0 OR max_duty <> 0) AND duty <> 0")
        self.has_lost_events = bool(select("SELECT 1 FROM event_gap JOIN boot USING (boot_key) WHERE robot_id = ?"))
        actions = rows.execute("SELECT at_us, action FROM audit WHERE action IN ('station.started', 'station.stopped', 'store.restored') "
                               "ORDER BY entry").fetchall()
        begun = [(row["at_us"], before["action"]) for before, row in zip(actions, actions[1:]) if row["action"] == "station.started"]
        self.restarts = [at_us for at_us, _ in begun]
        self.kills = [at_us for at_us, before in begun if before != "station.stopped"]
        self.restored = [row["at_us"] for row in actions if row["action"] == "store.restored"]
        self.reported = {}  # when the robot says that a command has run, also if its answer did not arrive
        for event in self.events:
            if event["event_seq"] is not None and event["command_id"]:
                event["command_id"] = str(event["command_id"] % 2**64)
                self.reported.setdefault(event["command_id"], event["robot_time_us"])

    def ran_at_us(self, command):
        """In the robot's time; None: it did not run, as far as the record shows."""
        if command["effect_at_robot_us"] and command["state"] not in ("rejected", "expired"):
            return command["effect_at_robot_us"]
        return self.reported.get(command["command_id"])

    def shows_its_stops(self):
        """False: it has obeyed a stop, and no event of it is there. A robot need not report events."""
        has_stopped = any(each["kind"] == "emergency_stop" and each["effect_at_robot_us"] for each in self.commands)
        return not has_stopped or any(each["event_seq"] is not None for each in self.events)

    def may_have_run(self, command):
        is_open = command["state"] in ("queued", "sent", "unknown") or command["kind"] == "emergency_stop"
        return is_open or bool(command["effect_at_robot_us"]) or self.ran_at_us(command) is not None


def traces(database):
    """Of each robot in it, by robot_id."""
    with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as rows:
        rows.row_factory = sqlite3.Row
        robots = [row["robot_id"] for row in rows.execute("SELECT robot_id FROM robot ORDER BY 1")]
        found = {robot_id: trace_of(Record(rows, robot_id)) for robot_id in robots}
    rows.close()
    return found


def trace_of(record):
    try:
        if record.is_a_replay:
            raise NotInTheModel(REPLAYED)
        if record.has_lost_events:
            raise NotInTheModel(LOST_EVENTS)
        if not record.shows_its_stops():
            raise NotInTheModel(NO_EVENTS)
        station, tenures, left_out = of_station(record)
        return Trace(of_robot(record, tenures), station, left_out)
    except NotInTheModel as reason:
        return Trace([], [], str(reason))


ACTOR = r"([^\s,]+)(?:, (?:page|script) \S+)?"  # and its client, where that has an id


def of_station(record):
    """The list, of each command in it and of those that the model leaves out its time of control, and why the list ends
    before the record does."""
    moments = [(at_us, 0, "RESTART", "") for at_us in record.restarts]
    moments += [(at_us, 0, "RESTORED", "") for at_us in record.restored]
    moments += [(event["received_at_us"], 1, event["kind"], event["detail"]) for event in record.events
                if event["event_seq"] is None]
    moments += [(command["submitted_at_us"], 2, command, "") for command in record.commands]
    moments.sort(key=lambda moment: moment[:2])
    for place in range(len(moments) - 1):  # a command that takes control is submitted, and then control is taken
        (_, kind, command, _), (_, _, event, detail) = moments[place], moments[place + 1]
        if kind == 2 and event == "control_taken" and detail.split(", ")[0] == f"by {command['actor']}":
            moments[place], moments[place + 1] = moments[place + 1], moments[place]
    found, tenures, actors, tenure, stops = [], {}, [], 0, 0

    def number_of(actor):
        if actor not in actors:
            actors.append(actor)
        if len(actors) > OPERATORS_OF_THE_MODEL:
            raise NotInTheModel(OPERATORS)
        return actors.index(actor) + 1

    try:
        for _, _, what, detail in moments:
            if len(found) == LONGEST or stops == MOST_STOPS:
                raise NotInTheModel(LENGTH)
            if what == "RESTORED":
                raise NotInTheModel(RESTORED)
            if isinstance(what, dict):
                action = number = None
                if what["actor"] == "station:experiments":
                    raise NotInTheModel(EXPERIMENT)
                if not what["actor"].startswith("station:") and record.may_have_run(what):
                    action = action_of(what["kind"], what["arguments"])
                if action == "duty" and record.ran_at_us(what) is None:
                    raise NotInTheModel(UNANSWERED)
                if action is not None:
                    number = number_of(what["actor"])
                    found.append((action, number))
                stops += what["kind"] == "emergency_stop"
                tenures[what["command_id"]] = tenure
            elif what in ("control_taken", "control_forced", "control_handed_over"):
                taken = re.match(rf"by {ACTOR} from|by {ACTOR} to {ACTOR}|by {ACTOR}", detail)
                number = number_of(taken.group(1) or taken.group(3) or taken.group(4))
                tenure += 1
                found.append(("CONTROL", number))
            elif what in ("control_released", "control_expired", "control_ended_by_reservation"):
                found.append(("CONTROL", 0))
            elif what in ("connected", "disconnected", "RESTART"):
                found.append(({"connected": "CONNECTED", "disconnected": "SILENCE"}.get(what, what), 0))
                stops += what == "connected"
    except NotInTheModel as reason:
        return found, tenures, str(reason)
    return found, tenures, ""


def of_robot(record, tenures):
    """The list, as far as it has to do with commands that have a time of control."""
    ends = "END"
    moments = []
    stored = {command["command_id"] for command in record.commands}
    for command in record.commands:
        at_us = record.ran_at_us(command)
        if at_us is None or command["kind"] in ("emergency_stop", "clear_emergency") or command["kind"] in NO_MOTION:
            continue
        place = (record.boots[command["boot_id"]], int(at_us), 0)
        if command["command_id"] not in tenures:
            moments.append((*place, ends, 0))
        elif not command["actor"].startswith("station:"):
            action = action_of(command["kind"], command["arguments"])
            if action != "timed":
                moments.append((*place, action, tenures[command["command_id"]]))
    latches = set()
    is_first_boot = True
    for event in record.events:
        if event["event_seq"] is None:
            continue
        if event["command_id"] and event["command_id"] not in stored:
            raise NotInTheModel(UNKNOWN)
        kind, argument, action = event["kind"], 0, None
        if kind == "boot":
            action, is_first_boot = None if is_first_boot else "BOOT", False
        elif kind in ("emergency", "emergency_cleared") and event["command_id"]:
            is_known = event["command_id"] in tenures
            action = {"emergency": "stop", "emergency_cleared": "clear"}[kind] if is_known else ends
            argument = tenures[event["command_id"]] if is_known and kind == "emergency_cleared" else 0
        elif kind == "emergency" and event["emergency_id"] not in latches:  # else it has survived a reset
            action = "EMERGENCY"
        elif kind == "mode_changed" and event["mode"] == "manual" and event["cause"] not in ("command", "link_loss"):
            action = "AT_REST"
        else:
            action = {"lease_lapsed": "LAPSE", "link_lost": "SILENCE", "position_uncertain": "AT_REST"}.get(kind)
        latches.add(event["emergency_id"])
        if action:
            moments.append((event["boot_key"], event["robot_time_us"], 0, action, argument))
    after_kill = min(record.kills, default=float("inf"))
    moments += [(row["boot_key"], row["robot_time_us"], 1, "MOVING", row["received_at_us"] >= after_kill)
                for row in record.moving]
    found, is_ordered, is_latched = [], False, False
    for *_, action, argument in sorted(moments, key=lambda moment: moment[:3]):
        if action == ends:
            break
        if action == "MOVING" and argument and not is_ordered and not is_latched:
            raise NotInTheModel(UNKNOWN)
        if action == "MOVING":
            argument = 0
        else:
            is_ordered = action in ("duty", "automatic")
            is_latched = action in ("stop", "EMERGENCY") or is_latched and action != "clear"
        if action != "MOVING" or not found or found[-1][0] != "MOVING":
            found.append((action, argument))
    if len(found) > LONGEST:
        raise NotInTheModel(LENGTH)
    return found


def text(trace):
    numbers = words()
    return " ".join(str(256 * numbers[action] + argument) for action, argument in trace)


def is_allowed(model, trace):
    """Whether the model has an execution with these actions."""
    def count(actions, *kinds):
        return sum(action in kinds for action, _ in actions)
    robot, station = trace.robot, trace.station
    bounds = {
        "STOPS": count(station, "stop") + count(station, "CONNECTED"), "FAULTS": count(robot, "EMERGENCY"),
        "BOOTS": 1 + count(robot, "BOOT"), "CONNECTIONS": count(station, "CONNECTED"),
        "RESTARTS": count(station, "RESTART"), "TENURES": count(station, "CONTROL"),
        "ERAS": 1 + count(robot, "LAPSE") + 2 * count(robot, "SILENCE"),
        "COMMANDS": len(station), "REPEATS": 0,
        "OPERATORS": max((number for action, number in station if action not in ("CONNECTED", "SILENCE")), default=0),
    }
    if not robot and not station:
        return True
    _, reached = model.explore(bounds, ROBOT_TRACE=text(robot), STATION_TRACE=text(station))
    if reached not in ("", "assertion violated 0"):
        raise AssertionError(f"an assertion of the model fails in a real execution: {reached}")
    return bool(reached)
