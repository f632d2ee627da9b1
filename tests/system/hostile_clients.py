#!/usr/bin/env python3
"""Slow and hostile clients of a running station, from addresses of this machine, until ended. Standard library only.

    tests/system/hostile_clients.py HTTP ROBOTS TOKEN [ATTACK...]

For each attack a line when it is in full swing: its name. The fast ones act a thousand times a second, so that what is
measured beside them is the station and not this program.
"""
import base64
import contextlib
import itertools
import json as json_text
import os
import resource
import selectors
import socket
import struct
import sys
import threading
import time

PAUSE_S = 0.001


def connect(at, source, receive_bytes=None):
    client = socket.socket()
    if receive_bytes is not None:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    client.settimeout(5)
    client.bind((source, 0))
    host, port = at.rsplit(":", 1)
    try:
        client.connect((host, int(port)))
    except OSError:
        client.close()
        raise
    return client


def head(method, path, token=None, *fields):
    lines = [f"{method} {path} HTTP/1.1", "Host: localhost", *fields]
    if token:
        lines.append(f"Authorization: Bearer {token}")
    return ("\r\n".join(lines) + "\r\n\r\n").encode()


def post(path, body, token=None):
    return head("POST", path, token, "Content-Type: application/json", f"Content-Length: {len(body)}") + body


class Crowd:
    """So many connections at once, all the time: one that the station ends is replaced."""

    def __init__(self, size, dial):
        self.size = size
        self.dial = dial
        self.open = []
        self.watch = selectors.DefaultSelector()

    def fill(self):
        while len(self.open) < self.size:
            try:
                client = self.dial()
            except OSError:
                return
            client.setblocking(False)
            self.watch.register(client, selectors.EVENT_READ)
            self.open.append(client)

    def replace(self, pause_s):
        """Waits so long, and takes note of those that were ended."""
        time.sleep(pause_s)
        for key, _ in self.watch.select(0):
            with contextlib.suppress(BlockingIOError):
                try:
                    gone = not key.fileobj.recv(4096)
                except ConnectionError:
                    gone = True
                if gone:
                    self.watch.unregister(key.fileobj)
                    key.fileobj.close()
                    self.open.remove(key.fileobj)
        self.fill()


def say_begun(name):
    sys.stdout.write(f"{name}\n")
    sys.stdout.flush()


def slowloris(http, _robots, token):
    begun = head("POST", "/api/v1/runs", token, "Content-Length: 1000")
    starts = [b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Filler: ", begun]
    number = 0

    def dial():
        nonlocal number
        number += 1
        client = connect(http, "127.0.0.2")
        client.sendall(starts[number % 2])
        return client
    drips = Crowd(150, dial)
    drips.fill()
    say_begun("slowloris")
    while True:
        for client in drips.open:
            with contextlib.suppress(OSError):
                client.send(b"x")
        drips.replace(1)


def idle(http, robots, _token):
    crowds = [Crowd(1000, lambda: connect(http, "127.0.0.3")), Crowd(1000, lambda: connect(robots, "127.0.0.3"))]
    for crowd in crowds:
        crowd.fill()
    say_begun("idle")
    while True:
        for crowd in crowds:
            crowd.replace(0.2)


def repeat(name, at, source, requests, ends_each=False):
    """These requests in turn, on one connection as long as it lasts."""
    number = 0
    while True:
        try:
            with connect(at, source) as client:
                while True:
                    client.sendall(requests[number % len(requests)])
                    number += 1
                    if number == 20:
                        say_begun(name)
                    time.sleep(PAUSE_S)
                    if not client.recv(65536) or ends_each:
                        break
        except OSError:
            time.sleep(PAUSE_S)


def logins(http, _robots, _token):
    guesses = [post("/api/v1/login", f'{{"user": "user{number}", "password": "guess"}}'.encode())
               for number in range(100)]
    repeat("logins", http, "127.0.0.4", guesses)


def json(http, _robots, token):
    deep = b'{"kind":' + b"[" * 30_000 + b"]" * 30_000 + b"}"
    wide = b'{"kind":"ping","x":"' + b"x" * 60_000 + b'"}'
    commands = "/api/v1/robots/sim-1/commands"
    repeat("json", http, "127.0.0.5", [post(commands, deep, token), post(commands, wide, token),
                                       head("POST", commands, token, "Content-Length: 100000000"),
                                       head("GET", "/" + "x" * 12_000), head("GET", "/%2e%2e/" * 100)])


def frames(_http, robots, _token):
    giant = struct.pack(">H", 0xFFFF) + b"x" * 65_535
    garbage = [giant, b"\xff" * 4096, b"\x00" * 4096, b"GET / HTTP/1.1\r\n\r\n", os.urandom(1000), b"\x05\x01\x02\x03\x04\x05"]
    repeat("frames", robots, "127.0.0.6", garbage, ends_each=True)


def masked(text):
    size = len(text)
    length = bytes([0x80 | size]) if size < 126 else b"\xfe" + struct.pack(">H", size)
    return b"\x81" + length + bytes(4) + text


def silent_pages(http, _robots, token):
    """They say that they are there, and read nothing."""
    key = base64.b64encode(os.urandom(16)).decode()

    def dial():
        client = connect(http, "127.0.0.7", receive_bytes=2048)
        client.sendall(head("GET", "/live", token, "Upgrade: websocket", "Connection: Upgrade",
                            f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13"))
        return client
    pages = []
    begun = False
    while True:
        while len(pages) < 8:
            with contextlib.suppress(OSError):
                pages.append(dial())
        if not begun:
            say_begun("silent_pages")
            begun = True
        time.sleep(1)
        for page in list(pages):
            try:
                page.send(masked(b'{"type":"keep_alive"}'))
            except OSError:
                page.close()
                pages.remove(page)


def polls(http, _robots, token):
    """Questions that wait, from two addresses: more than there are places; each that is answered is asked again at once."""
    with connect(http, "127.0.0.8") as client:
        client.sendall(post("/api/v1/experiments", b'{"robot_id": "sim-1", "profile": "figure_7"}', token))
        answer = client.recv(65536).decode()
        while "\r\n\r\n" not in answer or not answer.rstrip().endswith("}"):
            answer += client.recv(65536).decode()
    waiting = json_text.loads(answer.partition("\r\n\r\n")[2])["experiment_id"]
    question = head("GET", f"/api/v1/experiments/{waiting}?wait_ms=30000", token)
    sources = itertools.cycle(("127.0.0.8", "127.0.0.9"))

    def dial():
        client = connect(http, next(sources))
        client.sendall(question)
        if has_begun:
            time.sleep(PAUSE_S)
        return client
    has_begun = False
    crowd = Crowd(400, dial)
    crowd.fill()
    has_begun = True
    say_begun("polls")
    while True:
        crowd.replace(PAUSE_S)


ATTACKS = {attack.__name__: attack for attack in (slowloris, idle, logins, json, frames, silent_pages, polls)}


def main():
    http, robots, token, *names = sys.argv[1:]
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, 8192), most))
    for name in names or ATTACKS:
        threading.Thread(target=ATTACKS[name], args=(http, robots, token), daemon=True).start()
    threading.Event().wait()


if __name__ == "__main__":
    main()
