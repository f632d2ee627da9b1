#!/usr/bin/env python3
"""Checks that each command in the documents parses: its names and options are those of the programs' own --help.

Commands are lines of code blocks, and code in backquotes, that call `rheonaut`, `rheonaut-sim` (with or without the
folder they were built in), or a script in deploy/, tests/bench or examples/. Of a script the options must stand in its text.
The programs are in RHEONAUT_BIN. Prints `file:line: what is wrong` and fails if anything is. What can run without a
station is run by tests/server/cli/documented_commands_test.py.
"""
import functools
import os
import pathlib
import re
import shlex
import subprocess
import sys

PROGRAMS = ("rheonaut", "rheonaut-sim")
SEPARATOR = re.compile(r"[|&;<>()]+")
NEVER_COMMANDS = re.compile(r"^(CHANGELOG\.md|docs/decisions/)")  # they speak of commands as they were


@functools.cache
def help_of(words):
    """(subcommands, options) that `program … --help` lists; its arguments are neither."""
    done = subprocess.run([str(pathlib.Path(os.environ["RHEONAUT_BIN"]) / words[0]), *words[1:], "--help"],
                          capture_output=True, text=True, timeout=60)
    text = re.sub(r"^Arguments:\n(  .*\n)*", "", done.stdout, flags=re.M)
    subcommands = set(re.findall(r"^  ([a-z][a-z0-9-]*)(?: {2,}\S|$)", text, re.M))
    return subcommands, set(re.findall(r"(?<![\w-])--?[a-z][a-z0-9-]*", text)) | {"--help", "--version"}


def fault_of_program(words):
    path, options = (words[0],), set()
    for before, word in zip(words, words[1:]):
        if "…" in word:  # what stands there may have options of its own
            return None
        subcommands, known = help_of(path)
        options |= known
        if word.startswith("-") and re.match(r"--?[a-z]", word):
            name = word.split("=")[0]
            if name not in options:
                return f"{' '.join(path)} has no option {name}"
        elif word in subcommands:
            path += (word,)
            options |= help_of(path)[1]
        elif subcommands and not before.startswith("-") and re.fullmatch(r"[a-z][a-z-]*", word):
            return f"{' '.join(path)} has no command {word}"
    return None


@functools.cache
def text_of_script(path):
    """The script, and the Python files beside it that it may import."""
    texts = [path.read_text(encoding="utf-8", errors="replace")]
    texts += [other.read_text(encoding="utf-8") for other in path.parent.glob("*.py")]
    return "\n".join(texts)


def fault_of_script(root, words):
    path = root / words[0]
    if not path.is_file():
        return f"there is no {words[0]}"
    if not os.access(path, os.X_OK):
        return f"{words[0]} is not executable"
    for word in words[1:]:
        name = word.split("=")[0]
        if re.match(r"--[a-z]", name) and name not in text_of_script(path):
            return f"{words[0]} has no option {name}"
    return None


def simple_commands(line):
    """The words of each command of a line of shell, without redirections and assignments before it."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="|&;<>()")
    lexer.whitespace_split = True
    try:
        words = list(lexer)
    except ValueError:  # a quotation that goes on in the next line, or no shell at all
        return
    command = []
    for word in [*words, ";"]:
        if not SEPARATOR.fullmatch(word):
            command.append(word)
            continue
        while command and re.match(r"\w+=|\$$", command[0]):
            command = command[1:]
        if command:
            yield command
        command = []


def is_script(word):
    return re.fullmatch(r"((deploy|tests/bench|\.ci)/[\w-]+|examples/\w+\.py)", word) is not None


def faults_of_line(root, line):
    for words in simple_commands(line):
        words[0] = re.sub(r"^(.*/)?build/\w+/bin/", "", words[0])
        if words[0] in PROGRAMS:
            yield fault_of_program(words)
        elif is_script(words[0]) and len(words) > 1:  # alone it is a path, which check_docs.py checks
            yield fault_of_script(root, words)


def lines_of_code(text):
    """(line number, text) of each line of a block without a language or of shell, and of code in backquotes."""
    language = None  # of the block that we are in
    continued, began = "", 0
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("```"):
            language, continued = (line[3:].strip() if language is None else None), ""
        elif language in ("", "sh"):
            began = began if continued else number
            continued += line
            if continued.endswith("\\"):
                continued = continued[:-1] + " "
                continue
            yield began, continued
            continued = ""
        elif language is None:
            yield from ((number, code) for code in re.findall(r"`([^`]+)`", line))


def documents(root):
    for path in sorted([*root.glob("*.md"), *root.glob("docs/**/*.md")]):
        name = path.relative_to(root).as_posix()
        if not NEVER_COMMANDS.match(name) and "node_modules" not in path.parts:
            yield name, path.read_text(encoding="utf-8")


def faults(root):
    for name, text in documents(root):
        for number, code in lines_of_code(text):
            if re.search(r"rheonaut|deploy/|tests/bench/|examples/", code):
                yield from (f"{name}:{number}: {fault}" for fault in faults_of_line(root, code) if fault)


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]).resolve()
    found = list(faults(root))
    for fault in found:
        print(fault)
    print(f"{len(found)} faults" if found else "all commands are those of the programs")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
