"""A robot's connection to a Rheonaut station, as docs/protocol.md describes it: kept up, and nothing is lost over it.

What it asks of the robot: now_us(), step(), hello(), status(), on_command() and heard(); ticked_us, is_link_lost,
link_timeout_us and bad_frames; the rings `samples`, of (robot_time_us, fields of the batch, values), and `events`; the
queues `stop_acks` and `acks`.
"""
import argparse
import asyncio
import collections
import importlib
import pathlib
import random
import signal
import socket
import ssl
import subprocess
import sys
import tempfile

try:
    from google.protobuf.message import DecodeError
except ModuleNotFoundError:
    sys.exit(f"{sys.executable} has no google.protobuf: install Debian's python3-protobuf, and use /usr/bin/python3")


def compiled_messages():
    """The messages of protocol/robot.proto, as the Python module that protoc makes of them."""
    proto = pathlib.Path(__file__).resolve().parents[1] / "protocol" / "robot.proto"
    with tempfile.TemporaryDirectory() as folder:
        try:
            subprocess.run(["protoc", f"--proto_path={proto.parent}", f"--python_out={folder}", proto.name], check=True)
        except FileNotFoundError:
            sys.exit("protoc is not installed: it is in Debian's package protobuf-compiler")
        sys.path.insert(0, folder)
        try:
            return importlib.import_module("robot_pb2")
        finally:
            sys.path.remove(folder)


pb = compiled_messages()
PERIOD_US = 10_000
PER_SAMPLE = ("position_m", "velocity_m_s", "acceleration_m_s2", "duty", "impedance_mv", "reference_m")
MAX_FRAME_BYTES, MAX_BATCH, MAX_UNSENT_BYTES = 1024, 25, 4096
ATTEMPT_S = 2.0  # from dialling to the Welcome


class Ring:
    """Numbered items, kept until the station has them on disk. When it is full, the oldest is lost and counted."""

    def __init__(self, capacity):
        self.items = collections.deque(maxlen=capacity)
        self.next_seq = self.acknowledged_seq = self.lost = 0

    @property
    def oldest_seq(self):
        return self.next_seq - len(self.items)

    def is_full(self):
        return len(self.items) == self.items.maxlen

    def add(self, item):
        self.lost += self.is_full()
        self.items.append(item)
        self.next_seq += 1

    def acknowledge(self, durable_seq):
        if durable_seq > self.next_seq:
            return  # it is of no item that was made yet
        self.acknowledged_seq = max(self.acknowledged_seq, durable_seq)
        while self.oldest_seq < durable_seq:
            self.items.popleft()

    def __getitem__(self, seq):
        return self.items[seq - self.oldest_seq]


class LinkEnded(Exception):
    """Why a connection ended, in words. Any other exception is the robot's own and ends the program."""


class BadFrame(LinkEnded):
    """A frame that no station sends, or not at this point."""


class Connection:
    """One connection: Hello, what is received, and what is sent, the most urgent first."""

    def __init__(self, robot, reader, writer):
        self.robot, self.reader, self.writer = robot, reader, writer
        self.is_welcome, self.sent_us, self.status_us = False, 0, 0
        self.probe_answers, self.clock_answers = collections.deque(maxlen=4), collections.deque(maxlen=4)
        self.answers = (("command_ack", robot.stop_acks), ("stop_probe_answer", self.probe_answers),
                        ("command_ack", robot.acks), ("heartbeat", self.clock_answers))  # the most urgent first
        self.send(hello=robot.hello())

    async def receive(self):
        """Reads one frame: its length, a varint of one or two bytes, and its payload."""
        size = (await self.reader.readexactly(1))[0]
        if size >= 0x80:
            size += ((await self.reader.readexactly(1))[0] - 1) << 7
        if size > MAX_FRAME_BYTES:
            raise BadFrame(f"a frame of {size} bytes: this is no Rheonaut station")
        try:
            return pb.StationFrame.FromString(await self.reader.readexactly(size))
        except DecodeError as error:
            raise BadFrame(f"a frame that cannot be decoded: {error}") from error

    def on_frame(self, frame, now_us):
        body = frame.WhichOneof("body")
        if self.is_welcome:
            self.robot.heard(now_us)  # every frame is a sign of life
        # SAFETY: before the Welcome there is no link that could be lost, so nothing but a stop is obeyed.
        if body == "command" and (self.is_welcome or frame.command.WhichOneof("action") == "emergency_stop"):
            self.robot.on_command(frame.command, now_us)
        elif body == "welcome" and not self.is_welcome:
            self.on_welcome(frame.welcome, now_us)
        elif body == "stop_probe" and self.is_welcome:
            self.probe_answers.append(pb.StopProbeAnswer(echo_station_time_us=frame.stop_probe.station_time_us))
        elif body == "heartbeat" and self.is_welcome:
            self.on_heartbeat(frame.heartbeat, now_us)
        else:
            raise BadFrame(f"{body or 'a frame without a body'} {'after' if self.is_welcome else 'before'} the Welcome")
        self.flush()

    def on_welcome(self, welcome, now_us):
        if welcome.refusal:
            raise LinkEnded(f"refused: {welcome.detail}")
        if welcome.protocol_version != 1:
            raise LinkEnded(f"the station speaks version {welcome.protocol_version} of the protocol, this robot version 1")
        robot = self.robot
        robot.link_timeout_us = 1000 * max(100, min(5000, welcome.link_timeout_ms or 1000))
        self.heartbeat_us = min(1000 * (welcome.heartbeat_interval_ms or 200), robot.link_timeout_us // 2)
        self.samples_per_frame = max(1, min(MAX_BATCH, welcome.samples_per_frame or 5))
        self.acknowledge(welcome)
        self.event_seq, self.live_seq = robot.events.oldest_seq, robot.samples.next_seq
        self.backfill_seq, self.backfill_end_seq, self.credit = robot.samples.oldest_seq, self.live_seq, 0
        self.is_welcome = True
        robot.heard(now_us)

    def acknowledge(self, durable):
        self.robot.samples.acknowledge(durable.durable_next_seq)
        self.robot.events.acknowledge(durable.durable_next_event_seq)

    def on_heartbeat(self, heartbeat, now_us):
        self.acknowledge(heartbeat)
        if heartbeat.resend_first_seq < heartbeat.resend_next_seq:
            if self.backfill_seq >= self.backfill_end_seq:  # no other backfill is under way
                self.backfill_seq = self.backfill_end_seq = heartbeat.resend_first_seq
            self.backfill_seq = min(self.backfill_seq, heartbeat.resend_first_seq)
            self.backfill_end_seq = max(self.backfill_end_seq, min(heartbeat.resend_next_seq, self.live_seq))
        if heartbeat.resend_events:
            self.event_seq = self.robot.events.oldest_seq
        if heartbeat.station_time_us:
            self.clock_answers.append(pb.Heartbeat(echo_station_time_us=heartbeat.station_time_us,
                                                   echo_received_at_robot_us=now_us))

    def on_tick(self):
        if self.is_welcome and self.robot.is_link_lost:
            return self.reader.set_exception(TimeoutError("no frame within the link time-out"))  # dial again
        if self.is_welcome:
            self.credit = min(self.credit + 2, MAX_BATCH)  # backfill takes at most twice the rate of live samples
        self.flush()

    def flush(self):
        """Sends what is due. While the network is behind, it waits here in its order, and the ticks go on."""
        while self.writer.transport.get_write_buffer_size() == 0 and (body := self.next_body()):
            self.send(**body)

    def send(self, **body):
        self.sent_us = self.robot.now_us()
        payload = pb.RobotFrame(robot_time_us=self.sent_us, **body).SerializeToString()
        size = len(payload)
        prefix = bytes([size]) if size < 0x80 else bytes([size & 0x7F | 0x80, size >> 7])
        self.writer.write(prefix + payload)

    def next_body(self):
        """What to send next, in the order of docs/protocol.md: a body of RobotFrame, or None."""
        for body, waiting in self.answers if self.is_welcome else self.answers[:1]:  # until then only a stop is acknowledged
            if waiting:
                return {body: waiting.popleft()}
        if not self.is_welcome:
            return None
        return self.next_event() or self.next_live() or self.next_status() or self.next_backfill()

    def next_event(self):
        events = self.robot.events
        self.event_seq = max(self.event_seq, events.oldest_seq)
        if self.event_seq == events.next_seq:
            return None
        event = events[self.event_seq]
        event.oldest_event_seq = events.oldest_seq
        self.event_seq += 1
        return {"event": event}

    def next_live(self):
        """A batch that is full, that a change of what its samples share has closed, or that such a change has opened now."""
        samples = self.robot.samples
        self.live_seq = max(self.live_seq, samples.oldest_seq)
        batch = self.batch(self.live_seq, min(samples.next_seq, self.live_seq + self.samples_per_frame))
        end_seq = self.live_seq + len(batch.duty)
        has_changed = len(samples.items) > 1 and samples.items[-2][1] != samples.items[-1][1]
        if end_seq == samples.next_seq and len(batch.duty) < self.samples_per_frame and not (batch.duty and has_changed):
            return None
        self.live_seq = end_seq
        return {"telemetry": batch}

    def next_status(self):
        now_us = self.robot.now_us()
        if now_us - self.status_us >= 1_000_000:
            self.status_us = now_us
            return {"status": self.robot.status()}
        return {"heartbeat": pb.Heartbeat()} if now_us - self.sent_us >= self.heartbeat_us else None

    def next_backfill(self):
        self.backfill_seq = max(self.backfill_seq, self.robot.samples.oldest_seq)
        count = min(self.backfill_end_seq - self.backfill_seq, MAX_BATCH)
        if count <= 0 or self.credit < count:
            return None
        batch = self.batch(self.backfill_seq, self.backfill_seq + count)
        batch.flags |= pb.TELEMETRY_FLAG_BACKFILL
        self.backfill_seq += len(batch.duty)
        self.credit -= len(batch.duty)
        return {"telemetry": batch}

    def batch(self, first_seq, end_seq):
        """The samples from the first on, as far as they share the fields of a batch and follow each other in time."""
        samples, rows, first_us, shared = self.robot.samples, [], 0, {}
        for seq in range(first_seq, end_seq):
            robot_time_us, own, values = samples[seq]
            if not rows:
                first_us, shared = robot_time_us, own
            if own != shared or robot_time_us != first_us + len(rows) * PERIOD_US:
                break
            rows.append(values)
        return pb.Telemetry(first_seq=first_seq, first_robot_time_us=first_us, period_us=PERIOD_US,
                            oldest_seq=samples.oldest_seq, **shared, **dict(zip(PER_SAMPLE, zip(*rows))))


class StationLink:
    """Dials the station, again and again, while the robot ticks."""

    def __init__(self, robot, host, port, tls=None):
        self.robot, self.host, self.port, self.tls = robot, host, port, tls
        self.connection, self.said = None, ""

    def say(self, line):
        if line != self.said:  # not again at each attempt
            print(f"robot.py: {line}", flush=True)
        self.said = line

    async def run_until_signalled(self):
        """A signal cancels the link between two of its steps, and never in the middle of one."""
        for end in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(end) != signal.SIG_IGN:  # nohup ignores SIGHUP
                asyncio.get_running_loop().add_signal_handler(end, asyncio.current_task().cancel)
        await self.run()

    async def run(self):
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.keep_ticking())
            tasks.create_task(self.stay_connected())

    async def keep_ticking(self):
        while True:
            await asyncio.sleep((self.robot.ticked_us + PERIOD_US - self.robot.now_us()) / 1e6)
            self.tick_if_due()

    def tick_if_due(self):
        due_us, now_us = self.robot.ticked_us + PERIOD_US, self.robot.now_us()
        if now_us < due_us:
            return
        # A multiple of the period, also after a standstill; what was missed then is not caught up.
        self.robot.step(max(due_us, now_us // PERIOD_US * PERIOD_US))
        if self.connection:
            self.connection.on_tick()

    async def stay_connected(self):
        while True:
            try:
                await self.connect_and_serve()
            except LinkEnded as ended:
                self.robot.bad_frames += isinstance(ended, BadFrame)
                self.say(f"{self.host}:{self.port}: {ended}")
            self.connection = None
            pause_s = random.uniform(0.1, 0.6)
            await asyncio.sleep(4 * pause_s if self.robot.samples.is_full() else pause_s)

    async def connect_and_serve(self):
        deadline_s = asyncio.get_running_loop().time() + ATTEMPT_S
        reader, writer = await from_network(self.dial(), deadline_s)
        try:
            self.connection = Connection(self.robot, reader, writer)
            while True:
                frame = await from_network(self.connection.receive(), None if self.connection.is_welcome else deadline_s)
                self.tick_if_due()  # a sample that is late shows no command of after its time
                self.connection.on_frame(frame, self.robot.now_us())
                if frame.HasField("welcome"):
                    self.say(f"connected to {self.host}:{self.port} as {self.robot.robot_id}")
                await asyncio.sleep(0)  # frames that have come together do not delay the tick
        finally:
            writer.transport.abort()

    async def dial(self):
        reader, writer = await asyncio.open_connection(self.host, self.port)
        # SAFETY: the answer to a stop overtakes what waits here, but not what a buffer below has taken already.
        writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT_BYTES)
        writer.transport.set_write_buffer_limits(0)
        if self.tls:
            await writer.start_tls(self.tls, server_hostname=self.host)
        return reader, writer


async def from_network(reading, deadline_s):
    """What dialling or reading gives; its errors end the link, and only they."""
    try:
        async with asyncio.timeout_at(deadline_s):
            return await reading
    except EOFError as error:
        raise LinkEnded("the station closed the connection") from error
    except (OSError, ValueError) as error:
        raise LinkEnded(str(error) or "no answer") from error


def address(text):
    """HOST:PORT, an option of the command line."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is not HOST:PORT")
    return host.strip("[]"), int(port)


def authority(path):
    """TLS that trusts this file's certificate, an option of the command line."""
    try:
        return ssl.create_default_context(cafile=path)
    except OSError as error:
        raise argparse.ArgumentTypeError(f"'{path}' is no file with a certificate: {error}") from error
