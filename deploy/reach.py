#!/usr/bin/env python3
"""Prints which tests a change can reach, for `deploy/test --changed`; one a line:

    everything        what decides how all of it is built has changed
    program NAME      a test program, all of its cases
    test NAME         a test of CTest
    story NAME        a story of tests/browser
    lx106             the core on the chip's instruction set, which another preset has

Usage: deploy/reach.py FILE... (paths from the top of the tree; a deleted file is named as well)

A room is reached with all of its files, since a header may be carried out by any source of its room. A file that is no
source (a document, a table of numbers) reaches the tests whose sources name it. A test with processes is reached by its
own scripts, and by the files that they name. A change of the programs or of the page would reach all of them, a quarter
of an hour: it has TOGETHER instead, and CI runs the others.
"""
import pathlib
import re
import sys

FOLDERS = ("base", "protocol", "control", "robot_fw", "sim_robot", "server", "external")
WHOLE = ("protocol", "robot_fw", "external")  # one room each
CPP = (".cpp", ".hpp", ".h", ".ino")
# What decides how everything is built or tested.
EVERYTHING = re.compile(r"(CMakeLists\.txt|CMakePresets\.json|cmake/.*|tests/CMakeLists\.txt|deploy/(build|packages|test|"
                        r"reach\.py)|\.ci/.*)$")
CHECKS = ("rules", "rooms", "docs", "docs_messages", "docs_reasons", "docs_safety")  # seconds; after every change
# Tests of the project's own scripts: what each of them tests.
SCRIPTS = {"rules_test": "tests/check_rules", "docs_test": "tests/check_docs", "docs_messages_test": "tests/check_messages",
           "docs_commands_test": "tests/check_commands", "docs_not_yet_test": "tests/check_not_yet",
           "docs_reasons_test": "tests/check_reasons", "docs_safety_test": "tests/check_safety",
           "second_try_test": "tests/second_try", "chip_judge_test": "tests/lx106/judge", "reach_test": "deploy/reach",
           "tidy_test": "deploy/tidy", "arm64_test": "deploy/arm64", "esp8266_check_test": "deploy/esp8266-check",
           "backup_daily_test": "deploy/debian/backup-daily"}
# The programs together: a stop by every way, a station that is killed. The page with them: a key that stops.
TOGETHER = ("system_stop", "system_kill")
STORY = "escape"
LX106 = re.compile(r"(robot_fw|protocol|sim_robot/(world|robot|network|faults|scenario|lab)|control/models|tests/lx106)/|"
                   r"deploy/(lx106|esp8266)")
DOCUMENT = re.compile(r"[^/]*\.md$|docs/|site/|tests/site/|deploy/(site|npm-packages)$")
# What the documents are compared with.
COMMANDS = re.compile(r"(server|sim_robot)/cli/")
INTERFACE = re.compile(r"server/api/openapi\.yaml$|protocol/|" + COMMANDS.pattern)
BROWSER_ROOM = "server/api/routes"  # embeds the page and openapi.yaml


def unit_of(path):
    return re.sub(r"\.[^./]*$", "", path)


def node_of(path):
    """A room for a file of the programs, a unit (.hpp and .cpp as one) for a main.cpp and for tests."""
    top = path.split("/")[0]
    if top in WHOLE:
        return top
    if top in FOLDERS and not path.endswith("main.cpp"):
        return path.rpartition("/")[0]
    return unit_of(path)


class Tree:
    """The sources below a root, what includes what, and what each test is made of."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.graph = {}
        for folder in (*FOLDERS, "tests"):
            for path in sorted((self.root / folder).rglob("*")):
                if path.suffix in CPP and "node_modules" not in path.parts:
                    self._add(path)
        self.programs = {}  # name -> units of its sources
        self.listings = {}  # name -> its CMakeLists.txt
        for listing in sorted((self.root / "tests").rglob("CMakeLists.txt")):
            self._add_programs(listing)

    def _add(self, path):
        name = path.relative_to(self.root).as_posix()
        edges = self.graph.setdefault(node_of(name), set())
        for included in re.findall(r'#\s*include\s*"([^"]+)"', path.read_text(encoding="utf-8")):
            if included == "robot.pb.h":
                edges.add("protocol")
            elif (self.root / included).exists():
                edges.add(node_of(included))
            elif (path.parent / included).exists():
                edges.add(node_of((path.parent / included).resolve().relative_to(self.root.resolve()).as_posix()))

    def _add_programs(self, listing):
        text = re.sub(r"#[^\n]*", "", listing.read_text(encoding="utf-8"))
        for name, rest in re.findall(r"rheonaut_test\((\w+)([^)]*)\)", text):
            sources = re.findall(r"\S+\.(?:cpp|ino)\b", rest.replace("${PROJECT_SOURCE_DIR}", str(self.root)))
            sources = [(listing.parent / source).resolve().relative_to(self.root.resolve()).as_posix() for source in sources]
            units = {node_of(source) for source in sources}
            if "${sketch}" in rest:
                units.add("robot_fw")
            self.programs[name] = units
            self.listings[name] = listing

    def closure(self, nodes):
        seen, waiting = set(), list(nodes)
        while waiting:
            node = waiting.pop()
            if node not in seen:
                seen.add(node)
                waiting += self.graph.get(node, ())
        return seen

    def named_by(self, program):
        """The text of the program's own sources, where the files that it reads are named."""
        own = [node for node in self.closure(self.programs[program]) if node.startswith("tests/")]
        files = [self.root / (node + suffix) for node in own for suffix in (".cpp", ".hpp")]
        return "\n".join(file.read_text(encoding="utf-8") for file in [*files, self.listings[program]] if file.exists())

    def scripts(self):
        """(CTest's name or "story NAME", its text with that of the modules that it imports, their paths) of each test with
        processes."""
        for path in sorted((self.root / "tests/system").glob("*_test.py")):
            yield ("system_" + path.name[:-len("_test.py")], *self._script(path))
        for path in sorted((self.root / "tests/browser").glob("*_test.mjs")):
            name = path.name[:-len("_test.mjs")]
            yield ("browser_programs" if name == "programs" else f"story {name}", *self._script(path))
        for path in (self.root / "tests/server/cli").glob("documented_commands_test.py"):
            yield ("documented_commands", *self._script(path))

    def _script(self, path):
        seen, waiting, text = set(), [path], ""
        while waiting:
            path = waiting.pop()
            if path in seen or not path.exists():
                continue
            seen.add(path)
            own = path.read_text(encoding="utf-8")
            text += own
            for name in re.findall(r"^(?:from|import) (\w+)", own, re.M):
                waiting += [path.parent / f"{name}.py", self.root / "deploy" / f"{name}.py",
                            self.root / "tests/system" / f"{name}.py", self.root / "tests/model" / f"{name}.py",
                            self.root / "examples" / f"{name}.py"]
            waiting += [path.parent / name for name in re.findall(r"from '\./([^']+)'", own)]
        return text, {path.relative_to(self.root).as_posix() for path in seen}


def changed_nodes(path):
    """What of the graph a changed file stands for."""
    if path == "server/api/openapi.yaml":
        return {BROWSER_ROOM}
    if path.split("/")[0] in FOLDERS:
        return {node_of(path)}
    return {unit_of(path)} if path.endswith(CPP) else set()


def names_of(path):
    """How a source may name a file that is none: by its name, or by its folder in tests/data."""
    names = {path.rpartition("/")[2]}
    inside = re.match(r"tests/data/([^/]+)/", path)
    return names | ({inside.group(1) + "/", f'"{inside.group(1)}"'} if inside else set())


def reached(root, changed):
    """Lines as above, sorted, for these changed files."""
    if any(EVERYTHING.match(path) for path in changed):
        return ["everything"]
    tree = Tree(root)
    nodes = set().union(*(changed_nodes(path) for path in changed))
    others = [path for path in changed if not path.endswith(CPP)]
    lines = {f"test {name}" for name in CHECKS}
    lines |= {f"test {name}" for name, script in SCRIPTS.items() if any(is_part(path, name, script) for path in changed)}
    if any(path.endswith(CPP) for path in changed):
        lines.add("test format")
    for program, units in tree.programs.items():
        text = tree.named_by(program)
        if nodes & tree.closure(units) or any(name in text for path in others for name in names_of(path)):
            lines.add(f"program {program}")
        if any(path.endswith("CMakeLists.txt") and tree.root / path == tree.listings[program] for path in changed):
            lines.add(f"program {program}")
    lines |= {name if " " in name else f"test {name}" for name in process_tests(tree, changed, nodes, others)}
    if any(path.startswith("web/") or path == "server/api/openapi.yaml" for path in changed):
        lines.add("test web_.*")
    if any(re.match(r"web/(?!tests/)", path) or path == "tests/browser/stories.mjs" for path in changed):
        lines.add(f"story {STORY}")
    if nodes & tree.closure({"server/main", "sim_robot/main"}):
        lines.add("program goldens_test")  # it runs both
    if any(LX106.match(path) for path in changed):
        lines |= {"lx106", "test esp8266_check"}
    if any(DOCUMENT.match(path) for path in changed):
        lines |= {"test docs_commands", "test docs_not_yet"}
    if any(COMMANDS.match(path) for path in changed):
        lines.add("test docs_commands")
    if any(INTERFACE.match(path) for path in changed):
        lines.add("test docs_not_yet")
    if any(path.startswith("tests/data/") and not is_named(tree, path) for path in changed):
        lines |= {f"program {program}" for program in tree.programs}
    return sorted(lines)


def is_part(path, test, script):
    """Whether the file is the script, its tables, or the test of it."""
    return path.split(".")[0] in (script, script + "_tables") or path.rpartition("/")[2] in (test + ".py", script.rpartition("/")[2] + "_test.py")


def is_named(tree, path):
    return any(name in tree.named_by(program) for program in tree.programs for name in names_of(path))


def process_tests(tree, changed, nodes, others):
    """Tests that run the programs."""
    is_robot_reached = bool(nodes & tree.closure({"sim_robot/main"}))
    if is_robot_reached or nodes & tree.closure({"server/main"}):
        yield from TOGETHER
    for name, text, paths in tree.scripts():
        if paths & set(changed) or any(name in text for path in others for name in names_of(path)):
            yield name
    if is_robot_reached or "tests/sim_robot/CMakeLists.txt" in changed:
        yield "rheonaut_sim_.*"
    if any(path.startswith("tests/protocol/") or path.endswith("golden_frames.txt") for path in changed) \
            or "protocol" in nodes:
        yield "golden_frames_by_protoc"


if __name__ == "__main__":
    print("\n".join(reached(pathlib.Path(__file__).resolve().parents[1], sys.argv[1:])))
