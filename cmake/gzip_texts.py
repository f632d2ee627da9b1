#!/usr/bin/env python3
"""Copies a folder's files for embedding; a text is compressed, and named with ".gz" at the end.

Usage: gzip_texts.py FOLDER OUT

OUT is emptied first. The same files always give the same bytes. A FOLDER that does not exist has no files. OUT.d then
names all that was read for Ninja, and the folders, in which a file may be new.
"""
import gzip
import pathlib
import shutil
import sys

TEXTS = {".html", ".js", ".css", ".json", ".map", ".svg", ".txt", ".webmanifest"}


def main():
    folder, out = map(pathlib.Path, sys.argv[1:])
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    files = sorted(folder.rglob("*"))
    for file in files:
        copy = out / file.relative_to(folder)
        if file.is_dir():
            copy.mkdir(parents=True, exist_ok=True)
            continue
        copy.parent.mkdir(parents=True, exist_ok=True)
        if file.suffix in TEXTS:
            copy.with_name(copy.name + ".gz").write_bytes(gzip.compress(file.read_bytes(), 9, mtime=0))
        else:
            shutil.copyfile(file, copy)
    read = [str(path).replace(" ", "\\ ") for path in ([folder] if folder.is_dir() else []) + files]
    out.with_name(out.name + ".d").write_text(f"{out}.made: {' '.join(read)}\n")


main()
