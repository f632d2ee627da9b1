#!/usr/bin/env python3
"""Robots for the other stations of the comparison: each makes 100 samples a second, 10 in a frame, and obeys a stop.

    robots.py tcp|mqtt PORT COUNT PREFIX

Over TCP a frame is its length (u16), its kind (u8) and its content, little-endian: 1 hello (the robot's name), 2 samples
(first seq u32, robot time in µs u64, then six float32 for each), 3 stopped (number of the stop u32). The server sends one
thing: "S" and the number of the stop. Over MQTT the content of a frame of samples is published to robots/NAME/samples
with QoS 1, and a stop arrives on robots/NAME/stop and is answered on robots/NAME/stopped.

A robot without a connection keeps its samples, 8 s of them, and sends them later; over MQTT also those that the broker
has not acknowledged, as QoS 1 demands. Prints "connected" when all are; ends when standard input does: then it sends
what is left and prints {"made": …}.
"""
import collections
import json
import math
import selectors
import socket
import struct
import sys
import time

import mqtt_packets as mqtt

SAMPLES, PERIOD_US = 10, 10000
FRAME_S = SAMPLES * PERIOD_US / 1e6
KEPT_FRAMES = 80
RETRY_S = 0.2
ALL_SENT_WITHIN_S = 10

# One second of a robot's life, made once: the load is in the transport, not in the sine.
CHANNELS = [struct.pack("<6f", math.sin(i / 16), math.cos(i / 16), -math.sin(i / 16), math.sin(i / 50), 175 + i % 7, 0.1)
            for i in range(100)]


class Robot:
    def __init__(self, name, first_at):
        self.name, self.next_at, self.seq = name, first_at, 0
        self.frames = collections.deque()  # made and not yet sent
        self.socket, self.writing, self.retry_at = None, b"", 0.0

    def make_frame(self):
        content = struct.pack("<IQ", self.seq, self.seq * PERIOD_US)
        content += b"".join(CHANNELS[(self.seq + i) % 100] for i in range(SAMPLES))
        self.seq += SAMPLES
        if len(self.frames) == KEPT_FRAMES:
            self.frames.popleft()
        self.frames.append(content)

    def connect(self, port, now):
        if now < self.retry_at:
            return False
        try:
            self.socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        except OSError:
            self.retry_at = now + RETRY_S
            return False
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.setblocking(False)
        self.greet()
        return True

    def disconnect(self, now):
        self.socket.close()
        self.socket, self.writing, self.retry_at = None, b"", now + RETRY_S

    def flush(self):
        """False when the connection is lost."""
        try:
            while self.writing or self.next_message():
                self.writing = self.writing[self.socket.send(self.writing):]
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    def next_message(self):
        if not self.frames:
            return False
        self.writing = self.message(self.frames.popleft())
        return True

    def receive(self):
        """False when the connection is lost."""
        try:
            received = self.socket.recv(65536)
        except BlockingIOError:
            return True
        except OSError:
            return False
        if not received:
            return False
        self.obey(received)
        return self.flush()


class TcpRobot(Robot):
    ready = True

    def greet(self):
        self.writing, self.stops = self.frame(1, self.name.encode()), b""

    @staticmethod
    def frame(kind, content):
        return struct.pack("<HB", 1 + len(content), kind) + content

    def message(self, content):
        return self.frame(2, content)

    def obey(self, received):
        self.stops += received
        while len(self.stops) >= 5:
            self.writing += self.frame(3, self.stops[1:5])
            self.stops = self.stops[5:]

    def unsent(self):
        return len(self.frames)


class MqttRobot(Robot):
    def __init__(self, name, first_at):
        super().__init__(name, first_at)
        self.packet_id, self.unacknowledged, self.ready = 0, {}, False

    def greet(self):
        self.reader, self.ready = mqtt.Reader(), False
        self.writing = mqtt.connect(self.name) + mqtt.subscribe(self.take_id(), f"robots/{self.name}/stop")
        for packet_id, content in self.unacknowledged.items():
            self.writing += mqtt.publish(packet_id, f"robots/{self.name}/samples", content, again=True)

    def take_id(self):
        self.packet_id = self.packet_id % 65535 + 1
        return self.packet_id

    def message(self, content):
        packet_id = self.take_id()
        self.unacknowledged[packet_id] = content
        return mqtt.publish(packet_id, f"robots/{self.name}/samples", content)

    def obey(self, received):
        for kind, first_byte, rest in self.reader.packets(received):
            if kind == mqtt.PUBACK:
                self.unacknowledged.pop(struct.unpack(">H", rest)[0], None)
            elif kind == mqtt.SUBACK:
                self.ready = True
            elif kind == mqtt.PUBLISH:
                _, packet_id, payload = mqtt.published(first_byte, rest)
                self.writing += mqtt.publish(self.take_id(), f"robots/{self.name}/stopped", payload)
                if packet_id is not None:
                    self.writing += mqtt.puback(packet_id)

    def unsent(self):
        return len(self.frames) + len(self.unacknowledged)


def main():
    kind, port, count, prefix = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    begun = time.monotonic()
    make = TcpRobot if kind == "tcp" else MqttRobot
    robots = [make(f"{prefix}-{i + 1}", begun + 0.5 + FRAME_S * i / count) for i in range(count)]
    selector = selectors.DefaultSelector()
    selector.register(sys.stdin, selectors.EVENT_READ)
    ending_at, announced = None, False
    while ending_at is None or (time.monotonic() < ending_at and any(robot.unsent() or robot.writing for robot in robots)):
        now = time.monotonic()
        for robot in robots:
            while ending_at is None and robot.next_at <= now:
                robot.make_frame()
                robot.next_at += FRAME_S
            if robot.socket is None:
                if not robot.connect(port, now):
                    continue
                selector.register(robot.socket, selectors.EVENT_READ, robot)
            if (robot.frames or robot.writing) and not robot.flush():
                selector.unregister(robot.socket)
                robot.disconnect(now)
        if not announced and all(robot.socket is not None and robot.ready for robot in robots):
            announced = True
            print("connected", flush=True)
        next_at = min(robot.next_at for robot in robots) if ending_at is None else time.monotonic() + 0.02
        for key, _ in selector.select(min(0.05, max(0, next_at - time.monotonic()))):
            if key.data is None:
                ending_at = time.monotonic() + ALL_SENT_WITHIN_S
                selector.unregister(sys.stdin)
            elif not key.data.receive():
                selector.unregister(key.data.socket)
                key.data.disconnect(time.monotonic())
    for robot in robots:
        if robot.socket is not None:
            robot.socket.close()
    print(json.dumps({"made": sum(robot.seq for robot in robots)}))


if __name__ == "__main__":
    main()
