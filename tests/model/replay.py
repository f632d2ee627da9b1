#!/usr/bin/env python3
"""Replays through the model what stations and robots have recorded in the system tests: each must be an execution of it.

Usage: replay.py FOLDER      FOLDER is what RHEONAUT_TRACES named when the tests ran; tests/system/processes.py fills it

Prints each record with the number of its actions, and why a part of it is left out, if it is. Fails when the model does
not allow one, and when something is left out for a reason that docs/protocol_model.md does not list.
"""
import collections
import json
import pathlib
import sys
import tempfile
import time

import check
import recorded


def keep(database, folder, name):
    """Called at the end of a test: the traces of a database, as a file of this name."""
    found = {robot_id: vars(one) for robot_id, one in recorded.traces(database).items()}
    pathlib.Path(folder, f"{name}.json").write_text(json.dumps(found))


def kept(folder):
    """Equal traces once: [(the names of the records, Trace)]."""
    names = collections.defaultdict(list)
    for path in sorted(pathlib.Path(folder).glob("*.json")):
        for robot_id, fields in json.loads(path.read_text()).items():
            names[json.dumps(fields)].append(f"{path.stem} {robot_id}")
    for fields, records in names.items():
        one = recorded.Trace(**json.loads(fields))
        one.robot, one.station = [tuple(action) for action in one.robot], [tuple(action) for action in one.station]
        yield records, one


def replay(model, folder):
    """How many records are refused, or cut for a reason that is not listed."""
    wrong, records_of, actions = 0, collections.Counter(), 0
    for records, one in kept(folder):
        begun = time.monotonic()
        is_allowed = recorded.is_allowed(model, one)
        is_listed = one.left_out in ("", *recorded.NOT_IN_THE_MODEL)
        wrong += not is_allowed or not is_listed
        size = len(one.robot) + len(one.station)
        actions += size
        kind = "beyond the model" if one.left_out and size == 0 else "in part" if one.left_out else "whole"
        records_of[kind] += len(records)
        others = f" and {len(records) - 1} more" if len(records) > 1 else ""
        print(f"{'' if is_allowed else 'REFUSED '}{records[0]}{others}: {size} actions, {time.monotonic() - begun:.1f} s"
              + (f"; then {one.left_out}" if one.left_out else ""), flush=True)
        if not is_allowed:
            print(f"  robot: {one.robot}\n  station: {one.station}", flush=True)
    print(f"{sum(records_of.values())} records, {actions} different actions: "
          + ", ".join(f"{count} {kind}" for kind, count in sorted(records_of.items())))
    return wrong


def main(folder):
    with tempfile.TemporaryDirectory(prefix="rheonaut-model-") as place:
        return replay(check.Model(place), folder)


if __name__ == "__main__":
    if len(sys.argv) != 2 or not pathlib.Path(sys.argv[1]).is_dir():
        raise SystemExit(__doc__)
    sys.exit(1 if main(sys.argv[1]) else 0)
