#!/usr/bin/env python3
"""Checks that docs/safety.md agrees with the code: each row of its tables names a guard, a test and a bound that are there.

A guard is a mark `SAFETY:` in robot_fw/, server/, protocol/ or web/src/. The document quotes it as `path`: "the words that
follow the mark in its line", and lists each mark once: in a table of failures, in the table of the other guards, or, one of
the cockpit, with its test in the table of the page's guards. A test is `Suite.Name` (GoogleTest), `tests/system/x_test.py
test_y`, `web/tests/x.ts` "title" or `tests/browser/x_test.mjs` "title"; its file must be one that is built and run. A story
of the browser that is named stands in a group of CTest with such stories alone: a second try of a group that failed must
not hide a failure of one of these. Prints `docs/safety.md: what is wrong` and fails if anything is.
"""
import collections
import pathlib
import re
import sys

PAGE = "docs/safety.md"
BROWSER = "tests/browser"
GUARDED = ("robot_fw", "server", "protocol", "web/src")
SOURCES = (".cpp", ".hpp", ".h", ".ino", ".proto", ".ts", ".tsx", ".css")
GUARD = re.compile(r'`([\w./]+)`: "([^"]+)"')
ROW = re.compile(r"^\| (\d+\.\d+) \| (.*) \|$", re.M)
PAGE_ROW = re.compile(r'^\| (\d+\.\d+) \| (`web/src/[\w./]+`: "[^"]+") \| (.*) \|$', re.M)  # with its test
COLUMNS = 4  # of a row of failures, without its number: what goes wrong, guard, test, what bounds it


def marks(root):
    """(file, words behind the mark in its line), each as often as it stands there."""
    found = collections.Counter()
    for folder in GUARDED:
        for path in sorted((root / folder).rglob("*")):
            if not path.is_file() or path.suffix not in SOURCES:
                continue
            for line in path.read_text(encoding="utf-8").splitlines():
                if "SAFETY:" in line:
                    words = re.sub(r"\s*\*/\}?$", "", line.partition("SAFETY:")[2].strip())
                    found[str(path.relative_to(root)), words] += 1
    return found


def is_listed(name, cmake):
    """Whether a CMakeLists.txt names it, as a whole word that is not in a comment."""
    if not cmake.is_file():
        return False
    code = re.sub(r"#.*", "", cmake.read_text(encoding="utf-8"))
    return re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", code) is not None


def googletests(root):
    """Names of the tests whose file stands in a CMakeLists.txt of its folder, or of one above it."""
    names = set()
    for path in (root / "tests").rglob("*_test.cpp"):
        lists = (folder / "CMakeLists.txt" for folder in path.parents if folder.is_relative_to(root / "tests"))
        if any(is_listed(path.name, known) for known in lists):
            text = path.read_text(encoding="utf-8")
            names |= {f"{suite}.{name}" for suite, name in re.findall(r"^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", text, re.M)}
    return names


def mixed_groups(root, text):
    """A story of the browser that the page names, in one test of CTest with one that it does not name."""
    listing = root / BROWSER / "CMakeLists.txt"
    code = re.sub(r"#.*", "", listing.read_text(encoding="utf-8")) if listing.is_file() else ""
    for group, words in re.findall(r"^browser_stories\((\w+)([^)]*)\)", code, re.M):
        named = [f"`{BROWSER}/{story}_test.mjs`" in text for story in words.split()]
        if any(named) and not all(named):
            yield f"{group} has a story that is named here beside {words.split()[named.index(False)]}, which is not"


def missing_test(root, known, cell):
    """What is wrong with one test of a row; None: it is there."""
    titled = re.fullmatch(r'`([\w./]+)` "(.+)"', cell)
    if titled:
        path, title = titled.groups()
        file = root / path
        quoted = (f"test('{title}'", f'test("{title}"', f"it('{title}'", f"'{title}'() {{")
        there = file.is_file() and any(q in file.read_text(encoding="utf-8").replace("\\'", "'") for q in quoted)
        run = file.suffix == ".ts" or is_listed(file.name.removesuffix("_test.mjs"), file.parent / "CMakeLists.txt")
        return None if there and run else f"no test {path} \"{title}\""
    name = cell.strip("`")
    path, separator, function = name.partition(" ")
    if not separator:
        return None if name in known else f"no test {name}"
    file, listed = root / path, (root / path).parent / "CMakeLists.txt"
    there = file.is_file() and re.search(rf"^    def {re.escape(function)}\(", file.read_text(encoding="utf-8"), re.M)
    run = is_listed(file.name.removesuffix("_test.py"), listed)
    return None if there and run else f"no test {name}"


def faults(root):
    text = (root / PAGE).read_text(encoding="utf-8")
    known = googletests(root)
    hazards = re.search(r"^## Hazards$.*?(?=^## |\Z)", text, re.M | re.S).group(0)
    rows = set()
    for line in text.splitlines():
        if re.match(r"\| *\d+\.\d+ *\|", line) and not ROW.fullmatch(line):
            yield f"a row is not written as one: {line[:60]}"
    for number, rest in ROW.findall(hazards):
        cells = [cell.strip() for cell in rest.split(" | ")]
        if len(cells) != COLUMNS:
            yield f"row {number} has {1 + len(cells)} columns"
            continue
        if number in rows:
            yield f"row {number} stands there twice"
        rows.add(number)
        _, guards, tests, bound = cells
        if not GUARD.search(guards):
            yield f"row {number} names no guard"
        if not bound:
            yield f"row {number} has no bound"
        for cell in tests.split("<br>"):
            wrong = missing_test(root, known, cell)
            if wrong:
                yield f"row {number}: {wrong}"
    for number, guard, tests in PAGE_ROW.findall(text):
        for cell in tests.split("<br>"):
            wrong = missing_test(root, known, cell)
            if wrong:
                yield f"row {number}, {guard}: {wrong}"
    yield from mixed_groups(root, text)
    for number, guard in re.findall(r"^\| (\d+\.\d+) \| (`web/src/[^|]*) \|$", text, re.M):
        yield f"row {number} names no test of {guard}"
    # The tables of what was measured and of the other guards name a row of these.
    others = {number for number, _ in ROW.findall(text.replace(hazards, ""))}
    yield from (f"there is no row {number}" for number in sorted(others - rows))
    listed, there = collections.Counter(GUARD.findall(text)), marks(root)
    for path, words in sorted((there - listed).elements()):
        yield f'{path} has a guard without a row: "{words}"'
    for path, words in sorted((listed - there).elements()):
        yield f'{path} has no guard "{words}"'


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]).resolve()
    found = list(faults(root))
    for fault in found:
        print(f"{PAGE}: {fault}")
    print(f"{len(found)} faults" if found else "every guard has its row, and every row its guards and tests")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
