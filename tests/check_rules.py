#!/usr/bin/env python3
"""Holds the sources to the rules of the project; prints `file:line: rule: what to do` and fails if there is any.

Usage: check_rules.py [ROOT]. CONTRIBUTING.md says why the rules are what they are; check_rules_test.py shows for each
one a snippet that breaks it.
"""
import pathlib
import re
import sys

from check_rules_tables import (FOLDERS, FOREIGN, MAY_INCLUDE, MOST_FILES_IN_A_ROOM, NOT_ON_THE_ROBOT, ROOMS,
                                ROOMS_WITH_CONTROL, SEAMS)

SEARCHED = (*FOLDERS, "external", "web", "tests", "deploy", "cmake", "docs", "examples", "site")
SKIPPED = {"node_modules", "dist", "build", "__pycache__", "data", "out"}
CPP = {".cpp", ".hpp", ".h", ".c", ".ino"}
SOURCE = CPP | {".py", ".ts", ".tsx", ".css", ".proto", ".sql", ".cmake"}
TEXT = SOURCE | {".md", ".toml", ".yaml"}

BANNED_WORDS = {"manager", "helper", "helpers", "handler", "util", "utils", "common", "misc", "impl", "process", "info"}


class Source:
    """One file: its text, and its text with comments and strings blanked out (lines and columns kept)."""

    def __init__(self, root, path):
        self.root = root
        self.path = path
        self.name = path.relative_to(root).as_posix()
        self.parts = self.name.split("/")
        self.text = path.read_text(encoding="utf-8")
        self.lines = self.text.splitlines()
        self.code = blank_comments(self.text) if path.suffix in CPP | {".ts", ".tsx"} else self.text
        self.is_cpp = path.suffix in CPP
        self.in_tests = self.parts[0] == "tests"

    def line_of(self, offset):
        return self.text.count("\n", 0, offset) + 1


def blank_comments(text):
    pattern = r"//[^\n]*|/\*.*?\*/|R\"(\w*)\(.*?\)\1\"|\"(?:\\.|[^\"\\\n])*\"|(?<!\w)'(?:\\.|[^'\\\n])+'"

    def blank(match):
        found = match.group(0)
        line = text[text.rfind("\n", 0, match.start()) + 1:match.start()]
        if found.startswith('"') and re.match(r"\s*#\s*include\s*$", line):
            return found
        return re.sub(r"[^\n]", " ", found)
    return re.sub(pattern, blank, text, flags=re.S)


def includes(source):
    for number, line in enumerate(source.code.splitlines(), 1):
        match = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
        if match:
            yield number, match.group(1) == '"', match.group(2)


def room_of(path):
    """The room of a file such as server/link/robot_session.hpp, "" where there is none."""
    room = path.rpartition("/")[0]
    return room if room in ROOMS else ""


def target_of(room):
    return room.replace("/", "_")


def uses_of(root, room):
    """The rooms that the link line of a room names; None when it has no CMakeLists.txt."""
    listing = root / room / "CMakeLists.txt"
    if not listing.exists():
        return None
    uses = re.search(r"\bUSES\b([^)]*?)(?:\bLIBRARIES\b|\))", listing.read_text(encoding="utf-8"))
    named = set(uses.group(1).split()) if uses else set()
    return {room for room in ROOMS if target_of(room) in named}


def room_fault(source, target):
    """Why a room may not include this header of another, or nothing."""
    own, other = room_of(source.name), room_of(target)
    for name, room in ((source.name, own), (target, other)):
        if not room:
            return f"{name.rpartition('/')[0]}/ is not in ROOMS of tests/check_rules_tables.py"
    if own == other:
        return None
    if ROOMS.index(other) > ROOMS.index(own):
        return f"{own}/ may not include {other}/, which stands above it"
    uses = uses_of(source.root, own)
    if uses is not None and other not in uses:
        return f"{own}/CMakeLists.txt does not say that it USES {target_of(other)}"
    return None


def check_includes(source):
    """include: the tables of ARCHITECTURE.md."""
    folder = source.parts[0]
    if not source.is_cpp or folder not in FOLDERS:
        return
    area = "/".join(source.parts[:2]) if len(source.parts) > 2 else folder
    allowed = MAY_INCLUDE[folder] | {folder} | ({"control"} if room_of(source.name) in ROOMS_WITH_CONTROL else set())
    is_program = source.parts[-1] == "main.cpp"
    has_rooms = any(room.partition("/")[0] == folder for room in ROOMS)
    for line, quoted, target in includes(source):
        parts = target.split("/")
        if quoted and target == "robot.pb.h" and folder == "protocol":
            continue
        if quoted and parts[0] not in FOLDERS and area not in ("robot_fw/esp8266", "robot_fw/lx106"):
            yield line, f'write the path from the root: "{folder}/…/{parts[-1]}", not "{target}"'
        elif quoted and parts[0] in FOLDERS and not is_program:
            if parts[0] not in allowed:
                yield line, f"{folder}/ may not include {parts[0]}/"
            elif parts[:2] == ["robot_fw", "esp8266"] and area != "robot_fw/esp8266":
                yield line, "robot_fw/esp8266/ is included by its tests only"
            elif has_rooms and any(room.partition("/")[0] == parts[0] for room in ROOMS):
                fault = room_fault(source, target)
                if fault:
                    yield line, fault
        elif not quoted:
            if target.startswith(FOREIGN.get(area, FOREIGN.get(folder, ()))):
                yield line, f"{folder}/ does not use <{target}>"
            if area in ("robot_fw/core", "robot_fw/esp8266") or folder == "protocol":
                if target in NOT_ON_THE_ROBOT:
                    yield line, f"<{target}> needs heap, threads or clocks, which the robot has not"


def check_seams(source):
    """seam: what decides about the order of work has the users that ARCHITECTURE.md names, and no others."""
    if not source.is_cpp or source.parts[0] != "server":
        return
    for line, _, target in includes(source):
        if source.name not in SEAMS.get(target, {source.name}):
            yield line, f"{target} has the users that ARCHITECTURE.md names: make the work short, or give it to a worker"


def check_links(source):
    """link: target_link_libraries and USES obey the same tables."""
    folder = source.parts[0]
    if source.parts[-1] != "CMakeLists.txt" or folder not in FOLDERS:
        return
    text = re.sub(r"#[^\n]*", "", source.text)
    own = "/".join(source.parts[:-1])
    allowed = MAY_INCLUDE[folder] | {folder} | ({"control"} if own in ROOMS_WITH_CONTROL else set())
    for call in re.finditer(r"(?:target_link_libraries|rheonaut_room)\s*\(([^)]*)\)", text):
        for word in call.group(1).split():
            owner = next((name for name in FOLDERS if word == name or word.startswith(name + "_")), None)
            if owner and owner not in allowed:
                yield source.line_of(call.start()), f"{folder}/ may not link {word}"
            above = [room for room in ROOMS if target_of(room) == word]
            if above and own in ROOMS and ROOMS.index(above[0]) > ROOMS.index(own):
                yield source.line_of(call.start()), f"{own}/ may not use {word}, which stands above it"


def check_room(source):
    """room: a folder stays small enough to be known; its listing names a source a line."""
    if source.parts[-1] != "CMakeLists.txt" or source.parts[0] not in (*FOLDERS, "tests"):
        return
    for number, line in enumerate(source.lines, 1):
        if len(re.findall(r"\.cpp\b", line.partition("#")[0])) > 1 and "add_" not in line:
            yield number, "one source a line"
    own = "/".join(source.parts[:-1])
    if own in ROOMS:
        files = sum(path.suffix in (".cpp", ".hpp") for path in source.path.parent.iterdir())
        if files > MOST_FILES_IN_A_ROOM:
            yield 1, f"{files} files; make two rooms of it, {MOST_FILES_IN_A_ROOM} is the end"


def closing(code, opening):
    """Index of the bracket that closes the one at `opening`."""
    depth = 0
    for at in range(opening, len(code)):
        depth += (code[at] in "([{") - (code[at] in ")]}")
        if depth == 0:
            return at
    return len(code) - 1


def awaited(code, start):
    """The text of the expression after the co_await at `start`."""
    depth = 0
    for at in range(start, len(code)):
        if code[at] in "([{":
            depth += 1
        elif code[at] in ")]}":
            depth -= 1
            if depth < 0:
                return code[start:at]
        elif code[at] in ";" and depth == 0:
            return code[start:at]
    return code[start:]


def check_co_await(source):
    """co_await: forms that g++ 11 and 12 miscompile."""
    if not source.is_cpp:
        return
    for match in re.finditer(r"\b(if|while|switch|for)\s*(?:constexpr\s*)?\(", source.code):
        condition = source.code[match.end() - 1:closing(source.code, match.end() - 1)]
        if "co_await" in condition:
            yield source.line_of(match.start()), f"await on the line before: const auto x = co_await …; {match.group(1)} (x)"
    for match in re.finditer(r"\bco_await\b", source.code):
        expression = awaited(source.code, match.start())
        if re.search(r"(?<![\w\])])\s*\[\s*[^\]\s][^\]]*\]\s*(\(|\{|mutable)", expression):
            yield source.line_of(match.start()), "name the capturing lambda on the line before: auto job = […] {…};"
        elif "{" in expression:
            yield source.line_of(match.start()), "name the braced value on the line before the co_await"


def check_tasks(source):
    """task: coroutines start in one place and are never detached."""
    if not source.is_cpp:
        return
    for match in re.finditer(r"\bdetached\b", source.code):
        yield source.line_of(match.start()), "no detached coroutines: use TaskGroup::spawn"
    if source.parts[0] in ("sim_robot", "tests") or source.name in ("server/runtime/tasks.cpp", "server/runtime/tasks.hpp",
                                                                    "server/runtime/worker.hpp"):
        return
    for match in re.finditer(r"\bco_spawn\s*\(", source.code):
        yield source.line_of(match.start()), "only TaskGroup::spawn and WorkerThread::run start coroutines"


CLOCKS = re.compile(r"_clock::now\b|\bsteady_timer\b|\bsystem_timer\b|\bhigh_resolution_timer\b|\bthis_thread::sleep|"
                    r"\bexpires_(?:after|at)\b|\b(?:usleep|nanosleep|gettimeofday|clock_gettime)\s*\(|\bstd::time\s*\(")


def check_clock(source):
    """clock: server/ takes all time from the injected Clock, so that it runs in virtual time."""
    if not source.is_cpp or source.parts[0] != "server":
        return
    if re.fullmatch(r"server/(runtime/(clock|worker)|cli/terminal/progress|storage/export/export_child|exporter/export_work)\.[ch]pp", source.name):
        return
    for number, line in enumerate(source.code.splitlines(), 1):
        if CLOCKS.search(line) and "#include" not in line:
            yield number, "take time and timers from server/runtime/clock.hpp"


def check_threads(source):
    """thread: one loop thread owns all live state; only workers know threads."""
    if not source.is_cpp or re.match(r"(?!server/)|server/(runtime/worker|cli/terminal/progress)\.", source.name):
        return
    for match in re.finditer(r"\bstd::(mutex|atomic|thread|jthread|async|recursive_mutex|shared_mutex)\b|\bmake_strand\b",
                             source.code):
        yield source.line_of(match.start()), "no threads or locks here: send a job to a WorkerThread"


SECRET = r"(?!\w*password_hash\b)\w*(?:secret|token|hash)"
COMPARED_SECRETS = re.compile(rf"\b(?:mem|str)cmp\s*\(|\b{SECRET}\s*[!=]=(?!\s*nullptr)|"
                              rf"[!=]=\s*(?:\w+(?:\.|->|::))*{SECRET}\b(?!\s*[.(>-])")


def check_secrets(source):
    """secret: secrets and their hashes are compared in constant time."""
    if not source.is_cpp or source.parts[0] != "server" or source.name == "server/runtime/secrets.cpp":
        return
    for match in COMPARED_SECRETS.finditer(source.code):
        yield source.line_of(match.start()), "compare with same() or find_secret() of server/runtime/secrets.hpp"


def check_words(source):
    """words: the text of a library's exception is shown to nobody; Rheonaut's own ones are words for a person."""
    if not source.is_cpp or source.parts[0] not in ("server", "sim_robot") or source.name == "server/runtime/exceptions.cpp":
        return
    caught = ""
    for number, line in enumerate(source.code.splitlines(), 1):
        caught = (re.findall(r"catch \(const ([\w:]+)&", line) or [caught])[-1]
        if ".what()" in line and caught not in ("std::invalid_argument", "UsageError", "NotOurs"):
            yield number, "say runtime::text_of(error), or base::failures::words_of(error), instead of what()"


def check_size(source):
    """size: files stay readable in one sitting."""
    count = len(source.lines)
    if source.name == "server/main.cpp" or source.parts[-1] == "main.cpp":
        if count > 80:
            yield 1, f"{count} lines; a main.cpp has at most 80"
    elif source.parts[-1] == "CMakeLists.txt":
        return
    elif source.path.suffix in SOURCE and "generated" not in (source.lines or [""])[0].lower():
        if count > 600:
            yield 1, f"{count} lines; split it, 600 is the end"
        elif count > 400 and not any("LONG:" in line for line in source.lines[:12]):
            yield 1, f"{count} lines; split it, or give the reason near the top: // LONG: …"


def words_of(name):
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name)}


def check_names(source):
    """name: a name says what the thing is."""
    banned = BANNED_WORDS - ({"process"} if source.in_tests else set())  # tests run real processes
    for part in source.parts:
        for word in words_of(part.split(".")[0]) & banned:
            yield 1, f"'{word}' in the path says nothing: name the file for what is in it"
    if source.is_cpp or source.path.suffix in (".ts", ".tsx"):
        types = r"\b(?:class|struct|enum class|enum|using|concept|interface|type)\s+([A-Z]\w*)"
        for match in re.finditer(types, source.code):
            for word in words_of(match.group(1)) & banned:
                yield source.line_of(match.start()), f"'{word}' in {match.group(1)} says nothing: find the noun"


def check_text(source):
    """text: no tabs, no notes to oneself."""
    own = source.name.startswith("tests/check_rules")
    for number, line in enumerate(source.lines, 1):
        if "\t" in line and source.path.suffix != ".md":
            yield number, "spaces, not tabs"
        if not own and re.search(r"\b(TODO|FIXME|XXX)\b", line):
            yield number, "do it, or open an issue; the source holds no notes to oneself"


def check_first_line(source):
    """first-line: each file opens with a sentence on what the reader will find; a .cpp may leave it to its .hpp."""
    suffix = source.path.suffix
    if suffix == ".cpp" and source.path.with_suffix(".hpp").exists():
        return
    if suffix not in SOURCE and (source.parts[-1] != "CMakeLists.txt" or source.in_tests):
        return
    lines = source.lines[1:] if source.text.startswith("#!") else source.lines
    mark = {".py": '"""', ".cmake": "# ", ".txt": "# ", ".sql": "-- ", ".css": "/*"}.get(suffix, "//")
    block = []
    for line in lines:
        if block and suffix not in (".py", ".css") and not line.startswith(mark.strip()):
            break
        block.append(line)
        if len(block) == 6:
            break
    opening = " ".join(block)
    if not re.match(re.escape(mark) + r"\s*\S", opening) and not opening.startswith("/*"):
        yield 1, f"begin with a sentence ({mark} …) on what is in the file"
    elif not re.search(r"[.:!?](\s|$|\"|\*)", opening):
        yield 1, "the opening comment is not a sentence"


RULES = (check_includes, check_seams, check_links, check_room, check_co_await, check_tasks, check_clock, check_threads,
         check_secrets, check_words, check_size, check_names, check_text, check_first_line)


def sources(root):
    for top in SEARCHED:
        for path in sorted((root / top).rglob("*")):
            relative = path.relative_to(root)
            if path.is_file() and not SKIPPED & set(relative.parts):
                if path.suffix in TEXT or path.name == "CMakeLists.txt":
                    yield Source(root, path)


def faults(root):
    for source in sources(root):
        for rule in RULES:
            name = rule.__doc__.split(":")[0]
            for line, advice in rule(source):
                yield f"{source.name}:{line}: {name}: {advice}"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]).resolve()
    found = list(faults(root))
    for fault in found:
        print(fault)
    print(f"{len(found)} faults" if found else "all rules hold")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
