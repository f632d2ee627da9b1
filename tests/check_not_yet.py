#!/usr/bin/env python3
"""Checks what the documents say is missing, so that no list of it outlives the work.

A list begins with a heading "Not yet" and ends with the next heading, or is a paragraph that begins with "Not yet". What
stands there in backquotes must be missing: a route (`GET /api/v1/robots`) in openapi.yaml, a command (`rheonaut stop`)
or option (`--once`) in the programs' own --help, a word (`supply_mv`) among the fields and values of robot.proto (with
or without the name of their enum) and the members and values of openapi.yaml. What exists is named there without backquotes. And docs/security.md, whose rows name a test each,
may not say of one that it has not been run. The programs are in RHEONAUT_BIN. Prints `file:line: what is wrong`.
"""
import pathlib
import re
import sys

from check_commands import PROGRAMS, fault_of_program, help_of

NOT_RUN = re.compile(r"\bnot yet( been)? run\b|\b(not|never)( yet)? been( yet)? run\b")


def lists(text):
    """(line, its text) of each line that says what is missing."""
    in_section = in_paragraph = False
    for number, line in enumerate(text.splitlines(), 1):
        heading = re.match(r"#+ +(.*)", line)
        if heading:
            in_section = heading[1].lower().startswith("not yet")
            continue
        in_paragraph = bool(line.strip()) and (in_paragraph or re.match(r"(- +)?\**not yet\b", line, re.I) is not None)
        if in_section or in_paragraph:
            yield number, line


def blank(route):
    """With its parameters of one name, however they are written."""
    return re.sub(r"\{[^}]*\}|<[^>]*>", "{}", route.rstrip("/"))


def commands(path):
    """The command and all below it, each as a tuple of its words."""
    yield path
    for word in sorted(help_of(path)[0]):
        yield from commands(path + (word,))


def all_commands():
    return [words for program in PROGRAMS for words in commands((program,))]


def words_of_proto(proto):
    """The fields and values; the values as the documents write them, too: MODE_AUTO of the enum Mode is auto."""
    found = set(re.findall(r"(\w+) = \d+", proto))
    for enum, body in re.findall(r"^enum (\w+) \{(.*?)^\}", proto, re.M | re.S):
        prefix = re.sub(r"\B(?=[A-Z])", "_", enum).upper() + "_"
        found |= {value.removeprefix(prefix).lower() for value in re.findall(r"(\w+) = \d+", body)}
    return found


def words_of_openapi(openapi):
    """The members, which stand below `properties:`, and the values of each `enum:`."""
    found = set(re.findall(r"\w+", " ".join(re.findall(r"\benum: \[([^\]]*)\]", openapi))))
    for start in re.finditer(r"^( +)properties:\n", openapi, re.M):
        block = re.match(rf"(?:{start[1]} .*\n|\n)*", openapi[start.end():])[0]
        found |= set(re.findall(rf"^{start[1]}  (\w+):", block, re.M))
    return found


def is_there(name, openapi, proto):
    """What the name is, where it exists; else None."""
    route = re.fullmatch(r"(?:(GET|POST|PUT|PATCH|DELETE) )?(/\S+)", name)
    if route:
        method, path = route.groups()
        for block in re.findall(r"^  (/\S+):\n((?:    .*\n|\n)*)", openapi, re.M):
            if blank(block[0]) == blank(path) and (not method or re.search(rf"^    {method.lower()}:", block[1], re.M)):
                return "a route of openapi.yaml"
    elif name.split()[0] in PROGRAMS:
        return "a command" if fault_of_program(name.split()) is None else None
    elif name.startswith("--"):
        found = next((words for words in all_commands() if name in help_of(words)[1]), None)
        return found and f"an option of {' '.join(found)}"
    elif re.fullmatch(r"\w+", name):
        if name in words_of_proto(proto):
            return "a field or value of robot.proto"
        if name in words_of_openapi(openapi):
            return "a member or value of openapi.yaml"
        if any(name in words[1:] for words in all_commands()):
            return "a command"
    return None


def faults(root):
    openapi, proto = ((root / path).read_text(encoding="utf-8") for path in ("server/api/openapi.yaml", "protocol/robot.proto"))
    for document in sorted([*root.glob("*.md"), *root.glob("docs/*.md")]):
        text, name = document.read_text(encoding="utf-8"), document.relative_to(root)
        for number, line in lists(text):
            for quoted in re.findall(r"`([^`]+)`", line):
                what = is_there(quoted, openapi, proto)
                if what:
                    yield f"{name}:{number}: {quoted} is not missing: it is {what}"
    security = root / "docs/security.md"
    for number, line in enumerate(security.read_text(encoding="utf-8").splitlines(), 1):
        if NOT_RUN.search(line):
            yield f"docs/security.md:{number}: {NOT_RUN.search(line)[0]}: run it, and say what came out"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]).resolve()
    found = list(faults(root))
    for fault in found:
        print(fault)
    print(f"{len(found)} faults" if found else "what the documents say is missing is missing")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
