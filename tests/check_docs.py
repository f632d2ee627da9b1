#!/usr/bin/env python3
"""Checks that what the documents point to is there: relative links with their anchors, pictures, paths such as
`server/link/robot_session`, code.

A path in backquotes that begins with one of our folders must be a file or folder, with or without its suffix; `*` and
`<noun>` match anything. A block of code that names a file, as "```cpp tests/sim_robot/story_examples_test.cpp", must
stand in that file word for word. The station's own kinds of events are those of the table in docs/database.md, the reasons
for which it ends a robot's connection those of docs/protocol.md, and the figures of the sizing table those of docs/performance.md.
Every decision has a number of its own and a row in docs/decisions/README.md, which also names the numbers that were never
given. Prints `file:line: what is missing` and fails if anything is.
"""
import functools
import pathlib
import re
import sys

FOLDERS = {"protocol", "control", "robot_fw", "sim_robot", "server", "external", "web", "tests", "deploy", "cmake", "docs", "examples", "site"}
SUFFIXES = ("", ".hpp", ".cpp", ".ts", ".tsx", ".py", ".m")


def exists(root, path):
    pattern = re.sub(r"<\w+>", "*", path.rstrip("/"))
    return any(any(root.glob(pattern + suffix)) for suffix in SUFFIXES)


def without_blocks(text):
    """The text with its blocks of code blanked out; lines keep their numbers."""
    return re.sub(r"^```.*?^```$", lambda block: "\n" * block.group(0).count("\n"), text, flags=re.M | re.S)


@functools.cache
def anchors(document):
    """The anchors of a page's headings, as GitHub and the site make them."""
    made = []
    for heading in re.findall(r"^#{1,6} (.+)$", without_blocks(document.read_text(encoding="utf-8")), re.M):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        repeats = sum(re.fullmatch(re.escape(anchor) + r"(-\d+)?", other) is not None for other in made)
        made.append(f"{anchor}-{repeats}" if repeats else anchor)
    return set(made)


def dead_links(document, text):
    """(line, what is wrong) of each link and picture of a page."""
    for number, line in enumerate(without_blocks(text).splitlines(), 1):
        line = re.sub(r"`[^`]*`", "", line)
        for target in re.findall(r"\]\(([^)\s]+)\)", line):
            path, _, anchor = target.partition("#")
            if re.match(r"\w+:", target):
                continue
            page = document.parent / path if path else document
            if not page.exists():
                yield number, f"the link to {path} leads nowhere"
            elif anchor and (page.suffix != ".md" or anchor not in anchors(page.resolve())):
                yield number, f"{path or 'this page'} has no heading for #{anchor}"


def misquotations(root, text):
    """(line, what is wrong) of each block of code that names its file."""
    for block in re.finditer(r"^```\w+ (\S+/\S+)\n(.*?)^```$", text, re.M | re.S):
        path, code = block.groups()
        line = text.count("\n", 0, block.start()) + 1
        if not (root / path).is_file():
            yield line, f"there is no {path} to quote"
        elif code not in (root / path).read_text(encoding="utf-8"):
            yield line, f"this code does not stand in {path}"


def event_kinds(root):
    """What is wrong with the table of the station's own kinds of events."""
    document = root / "docs/database.md"
    if not document.is_file():
        return
    section = re.search(r"^## Events$(.*?)^## ", document.read_text(encoding="utf-8"), re.M | re.S)
    rows = re.findall(r"^\| (`[^|]+) \|", section.group(1), re.M) if section else []
    listed = {kind for row in rows for kind in re.findall(r"`(\w+)`", row)}
    made = set()
    for source in (root / "server/station").rglob("*.cpp"):
        text = source.read_text(encoding="utf-8")
        made |= set(re.findall(r"\bnote(?:_model|_part)?\([^;\"]*?,\s*\"(\w+)\"", text))
        made |= set(re.findall(r"\brobot, \"(control_\w+)\"", text))
    yield from (f"docs/database.md: no row for the event {kind} of the station" for kind in sorted(made - listed))
    yield from (f"docs/database.md: the station makes no event {kind}" for kind in sorted(listed - made))


def reasons_to_close(root):
    """What is wrong with the table of the reasons for which the station ends a robot's connection."""
    session, document = root / "server/link/robot_session.cpp", root / "docs/protocol.md"
    if not session.is_file():
        return
    text = session.read_text(encoding="utf-8")
    given = set(re.findall(r'\b(?:close_)?reason_? = [^;"]*?"([^"]+)"(?= *[;:])', text))
    given |= set(re.findall(r'close_reason_ = [^;]*? : "([^"]+)";', text))
    given |= set(re.findall(r'co_return "([^"]+)";', text)) | set(re.findall(r'^constexpr auto k\w+ = "([^"]+)";', text, re.M))
    for source in (root / "server").rglob("*.cpp"):
        if "/cli/" in source.as_posix():
            continue
        other = source.read_text(encoding="utf-8")
        given |= set(re.findall(r'(?:session\.|->)close\((?:fmt::format\()?"([^"]+)"', other))
        given |= set(re.findall(r'end_connection\([^;"]*"([^"]+)"\)', other))
    given = {reason.replace("{}", "…") for reason in given - {": "}} | {"refusal: detail"}
    given.discard("a hello that does not decode")  # it is refused: "malformed: …"
    section = re.search(r"^### Why a connection ends$(.*?)^The robot ends it", document.read_text(encoding="utf-8"), re.M | re.S)
    listed = set(re.findall(r"^\| `([^|]+)` \|", section.group(1), re.M)) if section else set()
    yield from (f"docs/protocol.md: no row for the end of a connection “{reason}”" for reason in sorted(given - listed))
    yield from (f"docs/protocol.md: no connection ends by “{reason}”" for reason in sorted(listed - given))


def sizing(root):
    """Figures of the sizing table that docs/performance.md does not have as measured."""
    document, measured = root / "docs/operations.md", root / "docs/performance.md"
    if not (document.is_file() and measured.is_file()):
        return
    section = re.search(r"^## Sizing$(.*?)^## ", document.read_text(encoding="utf-8"), re.M | re.S)
    rows = "\n".join(re.findall(r"^\|.*", section.group(1), re.M)) if section else ""
    known = re.sub(r"\s+", " ", measured.read_text(encoding="utf-8"))
    for figure in sorted(set(re.findall(r"\b[\d.]+ (?:µs|MB)", rows))):
        if not re.search(r"(?<![\d.])" + re.escape(figure), known):
            yield f"docs/operations.md: docs/performance.md has no {figure}"


def decision_numbers(root):
    """What is wrong with the numbers of the decisions and with their index."""
    folder = root / "docs/decisions"
    pages = sorted(page.name for page in folder.glob("[0-9]*.md"))
    if not pages:
        return
    index = folder / "README.md"
    text = index.read_text(encoding="utf-8") if index.is_file() else ""
    listed = re.findall(r"^\| \[\d+\]\(([^)]+)\)", text, re.M)
    not_given = re.search(r"^Not assigned: ([^.]*)\.", text, re.M)
    skipped = set(re.findall(r"\d{4}", not_given.group(1))) if not_given else set()
    numbers = [page[:4] for page in pages]
    yield from (f"docs/decisions: the number {n} is given twice" for n in sorted({n for n in numbers if numbers.count(n) > 1}))
    expected = {f"{n:04}" for n in range(1, int(numbers[-1]) + 1)}
    yield from (f"docs/decisions: there is no decision {n}" for n in sorted(expected - set(numbers) - skipped))
    yield from (f"docs/decisions/README.md: {n} is a decision" for n in sorted(skipped & set(numbers)))
    yield from (f"docs/decisions/README.md: no row for {page}" for page in pages if listed.count(page) != 1)


def faults(root):
    yield from event_kinds(root)
    yield from reasons_to_close(root)
    yield from decision_numbers(root)
    yield from sizing(root)
    documents = [*root.glob("*.md"), *root.glob("docs/**/*.md")]
    for document in sorted(documents):
        text = document.read_text(encoding="utf-8")
        name = document.relative_to(root)
        yield from (f"{name}:{line}: {what}" for line, what in misquotations(root, text))
        yield from (f"{name}:{line}: {what}" for line, what in dead_links(document, text))
        in_block = False
        for number, line in enumerate(text.splitlines(), 1):
            place = f"{name}:{number}"
            in_block ^= line.startswith("```")
            for quoted in [] if in_block else re.findall(r"`([^`]+)`", line):
                path = quoted.split(" ")[0]
                if "/" in path and path.split("/")[0] in FOLDERS and not exists(root, path):
                    yield f"{place}: there is no {path}"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]).resolve()
    found = list(faults(root))
    for fault in found:
        print(fault)
    print(f"{len(found)} faults" if found else "all links and paths lead somewhere, and all code is quoted right")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
