#!/usr/bin/env python3
"""Holds the sources to the rules of the project; prints `file:line: rule: what to do` and fails if there is any.

Usage: check_rules.py [ROOT]. CONTRIBUTING.md says why the rules are what they are; check_rules_test.py shows for each
one a snippet that breaks it.
"""
import pathlib
import re
import sys

FOLDERS = ("protocol", "control", "robot_fw", "sim_robot", "server")
SEARCHED = (*FOLDERS, "external", "web", "tests", "deploy", "cmake", "docs")
SKIPPED = {"node_modules", "dist", "build", "__pycache__", "data", "out"}
CPP = {".cpp", ".hpp", ".h", ".c", ".ino"}
SOURCE = CPP | {".py", ".ts", ".tsx", ".css", ".proto", ".sql", ".cmake"}
TEXT = SOURCE | {".md", ".toml", ".yaml"}

# Who may include whom. A folder may always include itself.
MAY_INCLUDE = {
    "protocol": set(),
    "control": set(),
    "robot_fw": {"protocol"},
    "sim_robot": {"robot_fw", "protocol", "control"},
    "server": {"protocol"},  # analysis/ and cli/ also control, see below
}
# Inside server/. The files directly in server/ are seen by all; main.cpp sees everything.
MAY_INCLUDE_IN_SERVER = {
    "": {"station"},
    "station": set(),
    "net": {"station"},
    "link": {"net", "station"},
    "recording": {"station"},
    "live": {"station"},
    "analysis": {"recording", "station", "control"},
    "api": {"net", "station", "live", "recording", "analysis"},
    "cli": {"recording", "analysis", "station", "control"},
}
# Libraries that a folder must not see (beginnings of <...>).
FOREIGN = {
    "protocol": ("boost/", "Eigen/", "nlohmann/", "spdlog/", "SQLiteCpp/"),
    "control": ("boost/", "nlohmann/", "spdlog/", "SQLiteCpp/", "pb"),
    "robot_fw/core": ("boost/", "Eigen/", "nlohmann/", "spdlog/", "SQLiteCpp/", "Arduino", "ESP8266", "Wire", "WiFi"),
    "robot_fw/esp8266": ("boost/", "Eigen/", "nlohmann/", "spdlog/", "SQLiteCpp/"),
}
# What a robot has not: heap, streams, threads, clocks.
NOT_ON_THE_ROBOT = set("vector string map set list deque unordered_map unordered_set memory functional iostream sstream "
                       "fstream chrono thread mutex future atomic new any regex".split())
BANNED_WORDS = {"manager", "helper", "helpers", "handler", "util", "utils", "common", "misc", "impl", "process", "info"}


class Source:
    """One file: its text, and its text with comments and strings blanked out (lines and columns kept)."""

    def __init__(self, root, path):
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


def server_part(parts):
    """The folder inside server/ of a path such as server/link/robot_session.hpp, "" for one directly in server/."""
    return parts[1] if len(parts) > 2 else ""


def check_includes(source):
    """include: the table of ARCHITECTURE.md."""
    folder = source.parts[0]
    if not source.is_cpp or folder not in FOLDERS:
        return
    area = "/".join(source.parts[:2]) if len(source.parts) > 2 else folder
    for line, quoted, target in includes(source):
        parts = target.split("/")
        if quoted and target == "robot.pb.h" and folder == "protocol":
            continue
        if quoted and parts[0] not in FOLDERS and area not in ("robot_fw/esp8266", "robot_fw/lx106"):
            yield line, f'write the path from the root: "{folder}/…/{parts[-1]}", not "{target}"'
        elif quoted and parts[0] in FOLDERS and source.name != "server/main.cpp":
            allowed = MAY_INCLUDE[folder] | {folder}
            if folder == "server":
                inside = MAY_INCLUDE_IN_SERVER.get(server_part(source.parts))
                if inside is None:
                    yield line, f"server/{source.parts[1]}/ is not in the table of check_rules.py"
                    continue
                allowed |= inside & {"control"}
                if parts[0] == "server" and server_part(parts) not in inside | {"", server_part(source.parts)}:
                    yield line, f"{area}/ may not include server/{server_part(parts)}/"
                    continue
            if parts[0] not in allowed:
                yield line, f"{folder}/ may not include {parts[0]}/"
            elif parts[:2] == ["robot_fw", "esp8266"] and area != "robot_fw/esp8266":
                yield line, "robot_fw/esp8266/ is included by its tests only"
        elif not quoted:
            if target.startswith(FOREIGN.get(folder, ()) + FOREIGN.get(area, ())):
                yield line, f"{folder}/ does not use <{target}>"
            if area in ("robot_fw/core", "robot_fw/esp8266") or folder == "protocol":
                if target in NOT_ON_THE_ROBOT:
                    yield line, f"<{target}> needs heap, threads or clocks, which the robot has not"


def check_links(source):
    """link: target_link_libraries obeys the same table."""
    folder = source.parts[0]
    if source.parts[-1] != "CMakeLists.txt" or folder not in FOLDERS:
        return
    text = re.sub(r"#[^\n]*", "", source.text)
    allowed = MAY_INCLUDE[folder] | {folder} | ({"control"} if folder == "server" else set())
    for call in re.finditer(r"target_link_libraries\s*\(([^)]*)\)", text):
        for word in call.group(1).split():
            owner = next((name for name in FOLDERS if word == name or word.startswith(name + "_")), None)
            if owner and owner not in allowed:
                yield source.line_of(call.start()), f"{folder}/ may not link {word}"


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
    if source.parts[0] in ("sim_robot", "tests") or source.name in ("server/tasks.cpp", "server/tasks.hpp",
                                                                    "server/worker.hpp"):
        return
    for match in re.finditer(r"\bco_spawn\s*\(", source.code):
        yield source.line_of(match.start()), "only TaskGroup::spawn and WorkerThread::run start coroutines"


CLOCKS = re.compile(r"_clock::now\b|\bsteady_timer\b|\bsystem_timer\b|\bhigh_resolution_timer\b|\bthis_thread::sleep|"
                    r"\bexpires_(?:after|at)\b|\b(?:usleep|nanosleep|gettimeofday|clock_gettime)\s*\(|\bstd::time\s*\(")


def check_clock(source):
    """clock: server/ takes all time from the injected Clock, so that it runs in virtual time."""
    if not source.is_cpp or source.parts[0] != "server":
        return
    if source.name in ("server/clock.hpp", "server/clock.cpp", "server/worker.hpp", "server/worker.cpp"):
        return
    for number, line in enumerate(source.code.splitlines(), 1):
        if CLOCKS.search(line) and "#include" not in line:
            yield number, "take time and timers from server/clock.hpp"


def check_threads(source):
    """thread: one loop thread owns all live state; only workers know threads."""
    if not source.is_cpp or source.parts[0] != "server" or source.name.startswith("server/worker."):
        return
    for match in re.finditer(r"\bstd::(mutex|atomic|thread|jthread|async|recursive_mutex|shared_mutex)\b|\bmake_strand\b",
                             source.code):
        yield source.line_of(match.start()), "no threads or locks here: send a job to a WorkerThread"


SECRET = r"(?!\w*password_hash\b)\w*(?:secret|token|hash)"
COMPARED_SECRETS = re.compile(rf"\b(?:mem|str)cmp\s*\(|\b{SECRET}\s*[!=]=(?!\s*nullptr)|"
                              rf"[!=]=\s*(?:\w+(?:\.|->|::))*{SECRET}\b(?!\s*[.(>-])")


def check_secrets(source):
    """secret: secrets and their hashes are compared in constant time."""
    if not source.is_cpp or source.parts[0] != "server" or source.name == "server/secrets.cpp":
        return
    for match in COMPARED_SECRETS.finditer(source.code):
        yield source.line_of(match.start()), "compare with same() or find_secret() of server/secrets.hpp"


def check_size(source):
    """size: files stay readable in one sitting."""
    count = len(source.lines)
    if source.name == "server/main.cpp" or source.parts[-1] == "main.cpp":
        if count > 80:
            yield 1, f"{count} lines; a main.cpp has at most 80"
    elif source.parts[-1] == "CMakeLists.txt":
        if count > 30 and len(source.parts) > 1 and not source.in_tests:
            yield 1, f"{count} lines; a folder's CMakeLists.txt has at most 30"
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
    """first-line: each file opens with a sentence on what the reader will find."""
    suffix = source.path.suffix
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


RULES = (check_includes, check_links, check_co_await, check_tasks, check_clock, check_threads, check_secrets, check_size, check_names,
         check_text, check_first_line)


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
