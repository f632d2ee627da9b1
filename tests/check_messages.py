#!/usr/bin/env python3
"""Checks that each message in docs/troubleshooting.md is still what a program says.

A message is a text in backquotes in the first column of a table; `…` stands for anything that is filled in. Its pieces
between must stand, in this order, in one source file, in which adjacent string literals are joined and white space is
one blank. A word without a blank, such as `motor_on`, must be a word of the sources. Prints `file:line: what is missing`
and fails if anything is.
"""
import pathlib
import re
import sys

FOLDERS = ("base", "control", "robot_fw", "server", "sim_robot", "protocol", "web/src", "deploy")
SUFFIXES = {".cpp", ".hpp", ".ts", ".tsx", ".proto", ".toml", ""}
DOCUMENTS = ("docs/troubleshooting.md",)


def plain(source):
    """What a reader of the running program could see of a source: literals joined, escapes undone, blanks as one."""
    source = re.sub(r'"\s*\n\s*"', "", source)
    source = source.replace('\\"', '"').replace("{{", "{").replace("}}", "}").replace("’", "'")
    return re.sub(r"\s+", " ", source)


def sources(root):
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in SUFFIXES and path.is_file() and not {"node_modules", "dist"} & set(path.parts):
                yield plain(path.read_text(encoding="utf-8", errors="replace"))


def stands_in(message, source):
    at = 0
    for piece in (piece for piece in message.split("…") if piece.strip(" .,;:'()")):
        found = source.find(piece, at)
        if found < 0:
            return False
        at = found + len(piece)
    return True


def messages(text):
    """(line, message) of each quotation in the first column of a table."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("| ") and not line.startswith("|---"):
            yield from ((number, quoted) for quoted in re.findall(r"`([^`]+)`", line[2:].split(" | ")[0]))


def faults(root):
    known = list(sources(root))
    words = {word for source in known for word in re.findall(r"\w+", source.lower())}
    for document in DOCUMENTS:
        for line, message in messages((root / document).read_text(encoding="utf-8")):
            said = message.lower() in words if re.fullmatch(r"\w+", message) else any(stands_in(message, s) for s in known)
            if not said:
                yield f"{document}:{line}: no program says '{message}'"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]).resolve()
    found = list(faults(root))
    for fault in found:
        print(fault)
    print(f"{len(found)} faults" if found else "all quoted messages are those of the programs")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
