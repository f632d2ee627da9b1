#!/usr/bin/env python3
"""Holds tests/data/golden_frames.txt to Google's protobuf compiler, which shares no code with our codec.

For each frame the payload must decode (protoc --decode) to the text of the file, and the text must encode
(protoc --encode) to the payload. Every message of robot.proto must have a frame. docs/protocol.md must quote bytes of
the file and name every field and enumerator. With --write, bytes and text are written anew from the text.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests/data/golden_frames.txt"
PROTO = ROOT / "protocol/robot.proto"
QUOTES = ROOT / "docs/protocol.md"
MESSAGE = {"robot": "rheonaut.RobotFrame", "station": "rheonaut.StationFrame"}


class Frame:
    def __init__(self):
        self.comment, self.name, self.sender, self.bytes, self.text = [], "", "", b"", ""

    def payload(self):
        length, used = 0, 0
        while True:
            byte = self.bytes[used]
            length |= (byte & 0x7F) << (7 * used)
            used += 1
            if byte < 0x80:
                break
        if length != len(self.bytes) - used:
            raise ValueError(f"{self.name}: the length prefix says {length}, {len(self.bytes) - used} bytes follow")
        return self.bytes[used:]

    def lines(self):
        digits = self.bytes.hex(" ").split()
        rows = [" ".join(digits[at:at + 32]) for at in range(0, len(digits), 32)]
        return [*self.comment, f"frame {self.name}", f"from {self.sender}", *(f"hex {row}" for row in rows),
                *(f"| {line}" for line in self.text.splitlines()), ""]


def read(path):
    """Returns the comment at the top and the frames."""
    head, _, rest = path.read_text(encoding="utf-8").partition("\n\n")
    frames = []
    for block in rest.strip("\n").split("\n\n"):
        frame = Frame()
        for line in block.split("\n"):
            key, _, value = line.partition(" ")
            if key == "#":
                frame.comment.append(line)
            elif key == "frame":
                frame.name = value
            elif key == "from":
                frame.sender = value
            elif key == "hex":
                frame.bytes += bytes.fromhex(value)
            elif key == "|":
                frame.text += value + "\n"
            else:
                raise ValueError(f"{path.name}: cannot read the line {line!r}")
        frames.append(frame)
    return head, frames


def protoc(program, action, frame, given):
    done = subprocess.run([program, f"--{action}={MESSAGE[frame.sender]}", f"-I{PROTO.parent}", PROTO.name],
                          input=given, capture_output=True, env={**os.environ, "PATH": "/usr/bin:/bin"}, check=False)
    if done.returncode != 0:
        raise ValueError(f"{frame.name}: protoc --{action}: {done.stderr.decode().strip()}")
    return done.stdout


def prefixed(payload):
    length, prefix = len(payload), bytearray()
    while length >= 0x80:
        prefix.append(length & 0x7F | 0x80)
        length >>= 7
    return bytes(prefix) + bytes([length]) + payload


def rewrite(program, head, frames):
    for frame in frames:
        payload = protoc(program, "encode", frame, frame.text.encode())
        frame.bytes = prefixed(payload)
        frame.text = protoc(program, "decode", frame, payload).decode()
    lines = [line for frame in frames for line in frame.lines()]
    GOLDEN.write_text("\n".join([head, "", *lines]), encoding="utf-8")


def wrong_frames(program, frames):
    for frame in frames:
        payload = frame.payload()
        if protoc(program, "decode", frame, payload).decode() != frame.text:
            yield f"{frame.name}: protoc decodes the bytes to another text"
        if protoc(program, "encode", frame, frame.text.encode()) != payload:
            yield f"{frame.name}: protoc encodes the text to other bytes"
        if len(payload) > 1024:
            yield f"{frame.name}: {len(payload)} bytes, a frame has at most 1024"


def oneof_members(message):
    proto = PROTO.read_text(encoding="utf-8")
    body = re.search(rf"^message {message} {{.*?\n  oneof \w+ {{\n(.*?)\n  }}", proto, re.S | re.M).group(1)
    return re.findall(r"^\s*\w+ (\w+) = \d+;", body, re.M)


def missing_frames(frames):
    """Members of the three oneofs without a frame: a body is at the first level of the text, an action at the second."""
    for message, sender, indent in (("RobotFrame", "robot", ""), ("StationFrame", "station", ""),
                                    ("Command", "station", "  ")):
        for member in oneof_members(message):
            opening = re.compile(rf"^{indent}{member} {{", re.M)
            if not any(frame.sender == sender and opening.search(frame.text) for frame in frames):
                yield f"{message}.{member}: no golden frame has it"


def wrong_quotes(frames):
    """A block ```hex NAME in the document quotes the named frame from its first byte on; `;` starts a remark."""
    by_name = {frame.name: frame.bytes for frame in frames}
    text = QUOTES.read_text(encoding="utf-8")
    for name, body in re.findall(r"^```hex (\S+)\n(.*?)^```", text, re.S | re.M):
        quoted = bytes.fromhex("".join(line.split(";")[0] for line in body.splitlines()))
        if not quoted or quoted != by_name.get(name):
            yield f"{QUOTES.name}: the bytes quoted for {name} are not those of {GOLDEN.name}"


def undocumented_words():
    """Fields and enumerators (as text() spells them) that docs/protocol.md does not mention."""
    proto = re.sub(r"//.*", "", PROTO.read_text(encoding="utf-8"))
    words = re.findall(r"^\s*(?:optional |repeated )?\w+ (\w+) = \d+;", proto, re.M)
    for enum, body in re.findall(r"^enum (\w+) {(.*?)^}", proto, re.S | re.M):
        prefix = re.sub(r"(?<!^)(?=[A-Z])", "_", enum).upper() + "_"
        words += [value.removeprefix(prefix).lower() for value in re.findall(r"(\w+) = \d+;", body)]
    known = set(re.findall(r"\w+", QUOTES.read_text(encoding="utf-8"))) | {"unspecified"}
    for word in dict.fromkeys(words):
        if word not in known:
            yield f"{QUOTES.name}: does not mention {word}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--protoc", default="/usr/bin/protoc")
    parser.add_argument("--write", action="store_true", help="fill in the bytes, and the text as protoc spells it")
    parser.add_argument("--export", type=pathlib.Path, help="write each frame as a file into this folder, and end")
    parser.add_argument("--sender", choices=MESSAGE, help="export the frames of this one only")
    parser.add_argument("--prefix", type=bytes.fromhex, default=b"", help="bytes in hex before each exported frame")
    options = parser.parse_args()
    head, frames = read(GOLDEN)
    if options.export:
        for frame in frames:
            if options.sender in (None, frame.sender):
                (options.export / frame.name).write_bytes(options.prefix + frame.bytes)
        return 0
    if options.write:
        rewrite(options.protoc, head, frames)
        return 0
    faults = [*wrong_frames(options.protoc, frames), *missing_frames(frames), *wrong_quotes(frames), *undocumented_words()]
    for fault in faults:
        print(fault)
    print(f"{len(frames)} frames, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
