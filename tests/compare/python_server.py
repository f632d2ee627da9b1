#!/usr/bin/env python3
"""A station as a lab writes it in an afternoon in Python: asyncio, sqlite3, and an HTTP route that stops a robot.

    python_server.py DATABASE ROBOTS_PORT HTTP_PORT

Robots and their frames: robots.py. POST /stop/NAME answers when the robot has. Samples are committed each 100 ms by a
thread, so that a slow disk does not hold up a stop. Prints "ready"; SIGTERM commits what is there and ends.
"""
import asyncio
import concurrent.futures
import signal
import socket
import struct
import sys

import rows

STOP_WITHIN_S = 2


class Server:
    def __init__(self, path):
        self.database = rows.open_database(path)
        self.disk = concurrent.futures.ThreadPoolExecutor(1)
        self.frames, self.writers, self.stops, self.last_stop = [], {}, {}, 0

    async def robot(self, reader, writer):
        writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        name = None
        try:
            while True:
                length, kind = struct.unpack("<HB", await reader.readexactly(3))
                content = await reader.readexactly(length - 1)
                if kind == 2:
                    self.frames.append((name, content, rows.now_ms()))
                elif kind == 1:
                    name = content.decode()
                    self.writers[name] = writer
                elif kind == 3:
                    answer = self.stops.pop(struct.unpack("<I", content)[0], None)
                    if answer is not None and not answer.done():
                        answer.set_result(True)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            if self.writers.get(name) is writer:
                del self.writers[name]
            writer.close()

    async def stop(self, name):
        if name not in self.writers:
            return b"404 Not Found"
        self.last_stop += 1
        answer = self.stops[self.last_stop] = asyncio.get_running_loop().create_future()
        self.writers[name].write(b"S" + struct.pack("<I", self.last_stop))
        try:
            await asyncio.wait_for(answer, STOP_WITHIN_S)
            return b"200 OK"
        except asyncio.TimeoutError:
            return b"504 Gateway Timeout"

    async def http(self, reader, writer):
        writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            while True:
                head = await reader.readuntil(b"\r\n\r\n")
                method, path, _ = head.split(b"\r\n", 1)[0].decode().split(" ")
                stops = method == "POST" and path.startswith("/stop/")
                status = await self.stop(path[6:]) if stops else b"404 Not Found"
                writer.write(b"HTTP/1.1 " + status + b"\r\nContent-Length: 0\r\n\r\n")
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()

    async def record(self, ends):
        loop = asyncio.get_running_loop()
        while not ends.is_set():
            await asyncio.sleep(rows.COMMIT_S)
            frames, self.frames = self.frames, []
            if frames:
                await loop.run_in_executor(self.disk, rows.commit, self.database, frames)
        rows.commit(self.database, self.frames)


async def main():
    server, ends = Server(sys.argv[1]), asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ends.set)
    await asyncio.start_server(server.robot, "127.0.0.1", int(sys.argv[2]))
    await asyncio.start_server(server.http, "127.0.0.1", int(sys.argv[3]))
    print("ready", flush=True)
    await server.record(ends)


if __name__ == "__main__":
    asyncio.run(main())
