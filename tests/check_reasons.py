#!/usr/bin/env python3
"""Checks that every reason of a problem that the station answers is listed, once in server/api/openapi.yaml
(ProblemReason) and once in docs/api.md with its meaning, and that nothing else is listed.

A reason is what follows the detail of an error (`ErrorCode::invalid, "…", "out_of_range"`) or of a problem
(`problem(404, "…", "unknown_path")`), if it is a text literal. The robot's own reasons are those of RejectReason in
protocol/messages.cpp; how a command ended says docs/api.md, "Commands". Prints `file:line: what is wrong` and fails if
anything is.
"""
import pathlib
import re
import sys

# Errors that end in no answer: of the command line, of the configuration, and why an experiment or the model of a fluid
# is as it is, which their own documents say.
NOT_ANSWERED = ("server/cli/", "server/exporter/", "server/config/config.cpp", "server/analysis/capsule/archive_reader.cpp",
                "server/station/models/model_exchange.cpp", "server/experiments/adaptive/",
                "server/api/experiments/fit_of_runs.cpp")
# Where a reason is not the literal beside its code: of an error without one its code, of a command its end.
OTHER_SOURCES = {"server/http/http.cpp": r'case ErrorCode::\w+: return "(\w+)"',
                 "protocol/messages.cpp": r'case rheonaut_(?:REJECT_REASON|COMMAND_RESULT)_\w+: return "(\w+)"'}
FOR_COMMANDS = {"control_ended", "limits_changed", "link_lost", "no_answer", "not_seen_in_telemetry", "not_sent_in_time",
                "read_back_differs", "station_restarted", "step_before_dropped", "too_old_on_arrival"}
NOT_REASONS = {"none", "accepted", "rejected_by_robot", "unspecified"}
BEGINNING = re.compile(r"ErrorCode::\w+,|\b(?:problem|refuse)\(\s*\d{3},|\bnot_authenticated\(")


def arguments(text, begin):
    """The arguments from `begin` up to the bracket that ends them."""
    found, depth, at = [""], 0, begin
    while at < len(text):
        literal = re.compile(r'R"\((?:.*?)\)"|"(?:[^"\\]|\\.)*"', re.S).match(text, at)
        if literal:
            found[-1] += literal.group()
            at = literal.end()
            continue
        char = text[at]
        if char in ")}]" and depth == 0:
            return [argument.strip() for argument in found]
        depth += (char in "({[") - (char in ")}]")
        if char == "," and depth == 0:
            found.append("")
        else:
            found[-1] += char
        at += 1
    return []


def reasons_in(source):
    """(line, reason) of each error and problem of a source."""
    for beginning in BEGINNING.finditer(source):
        given = arguments(source, beginning.end())
        word = re.fullmatch(r'"([a-z][a-z0-9_]*)"', given[1]) if len(given) > 1 else None
        if word:
            yield source.count("\n", 0, beginning.start()) + 1, word.group(1)


def answered(root):
    """{reason: where it stands first}."""
    found = {}
    for path in sorted((root / "server").rglob("*.[ch]pp")):
        name = path.relative_to(root).as_posix()
        if not name.startswith(NOT_ANSWERED):
            for line, reason in reasons_in(path.read_text(encoding="utf-8")):
                found.setdefault(reason, f"{name}:{line}")
    for name, pattern in OTHER_SOURCES.items():
        path = root / name
        for reason in re.findall(pattern, path.read_text(encoding="utf-8")) if path.exists() else []:
            found.setdefault(reason, name)
    for reason in FOR_COMMANDS:
        found.setdefault(reason, "tests/check_reasons.py")
    return {reason: place for reason, place in found.items() if reason not in NOT_REASONS}


def listed_in_openapi(text):
    block = re.search(r"^    ProblemReason:\n(?:(?: {5,}.*)?\n)*", text, re.M)
    listed = re.search(r"enum: \[(.*?)\]", block.group(), re.S) if block else None
    return re.findall(r"\w+", listed.group(1)) if listed else []


def listed_in_document(text):
    section = re.search(r"^### Reasons\n(.*?)(?=^#{1,3} |\Z)", text, re.M | re.S)
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", section.group(1), re.M) if section else []
    return [reason for row in rows for reason in re.findall(r"\w+", row) if reason != "reason"]


def problems(root):
    used = answered(root)
    for name, read in (("server/api/openapi.yaml", listed_in_openapi), ("docs/api.md", listed_in_document)):
        listed = read((root / name).read_text(encoding="utf-8"))
        for reason in sorted(set(used) - set(listed)):
            yield f"{used[reason]}: the reason {reason} is not listed in {name}"
        for reason in sorted(set(listed) - set(used)):
            yield f"{name}:1: no answer has the listed reason {reason}"
        for reason in sorted({reason for reason in listed if listed.count(reason) > 1}):
            yield f"{name}:1: the reason {reason} is listed twice"


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent
    found = list(problems(root))
    print("\n".join(found) or "reasons: all are listed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
