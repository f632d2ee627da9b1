"""Parts of documents that a script writes. Standard library only.

    <!-- measured: NAME -->
    …
    <!-- end of: NAME -->

What is between the two lines is replaced; the rest of the document stays.
"""
import os
import pathlib


def write_marked(path, name, text):
    begin, end = f"<!-- measured: {name} -->\n", f"<!-- end of: {name} -->"
    document = path.read_text(encoding="utf-8")
    if document.count(begin) != 1 or document.count(end) != 1 or document.index(begin) > document.index(end):
        raise ValueError(f"{path}: needs one line {begin.strip()!r}, and after it one {end!r}")
    head, _, rest = document.partition(begin)
    _, _, tail = rest.partition(end)
    draft = pathlib.Path(f"{path}.draft")
    with open(draft, "w", encoding="utf-8") as file:
        file.write(f"{head}{begin}\n{text.strip()}\n\n{end}{tail}")
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
