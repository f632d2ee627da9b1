#!/usr/bin/python3
"""A robot of your own for a Rheonaut station, written from docs/protocol.md: a simulated cart on a track.

    examples/robot.py --station 127.0.0.1:7070 --id cart-1
    examples/robot.py --station lab-pc.local:7070 --id cart-1 --tls-ca lab-ca.crt --token-file cart-1.token

docs/your_own_robot.md explains it step by step. For a robot of yours, put its motor and sensors into Cart and its control
law into Robot.controller; station_link.py stays as it is. Both need Debian's protobuf-compiler and python3-protobuf, and
the latter belongs to Debian's own Python, which the first line names.

What it does not have, it refuses as `unsupported`: parameters, and other controllers than its own.
"""
import argparse
import asyncio
import collections
import math
import secrets
import sys
import time

from station_link import PERIOD_US, Ring, StationLink, address, authority, pb

LEASE_MS, MAX_LIFE_US, AUTO_LIMIT_S = 500, 10_000_000, 600
MAX_TIMED, MAX_SCHEDULE = 4, 64
RING_SAMPLES, RING_EVENTS = 6_000, 64  # one minute without a station loses nothing
POSITION_LIMIT_M, RETURN_M = 1.2, 0.001  # on both sides the track ends there; so far inside it the cart is back
KP_PER_M, KD_S_PER_M = 10.0, 1.0


class Cart:
    """The body: its speed follows the duty with a time constant. Yours drives a motor and reads sensors here."""

    FULL_SPEED_M_S, TIME_CONSTANT_S = 0.3, 0.2

    def __init__(self):
        self.position_m = self.velocity_m_s = self.acceleration_m_s2 = self.duty = 0.0

    def move(self, dt_s):
        target_m_s = self.FULL_SPEED_M_S * self.duty
        behind_m_s, decay = self.velocity_m_s - target_m_s, math.exp(-dt_s / self.TIME_CONSTANT_S)
        self.position_m += target_m_s * dt_s + behind_m_s * self.TIME_CONSTANT_S * (1 - decay)
        self.velocity_m_s = target_m_s + behind_m_s * decay
        self.acceleration_m_s2 = (target_m_s - self.velocity_m_s) / self.TIME_CONSTANT_S


class Refused(Exception):
    """A command that is not done; the argument is its result or reason, as docs/protocol.md spells it."""


def check(condition, otherwise):
    if not condition:
        raise Refused(otherwise)


def check_range(limit, *values):
    check(all(map(math.isfinite, values)), "not_finite")
    check(all(abs(value) <= limit for value in values), "out_of_range")


class Robot:
    """State, commands and the tick. It knows no sockets: what it has to say waits here for a connection."""

    def __init__(self, robot_id, token):
        self.robot_id, self.token = robot_id, token
        self.boot_id, self.started_ns = secrets.randbits(64) or 1, time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        self.cart, self.zero_m, self.is_outside = Cart(), 0.0, False
        self.samples, self.events = Ring(RING_SAMPLES), Ring(RING_EVENTS)
        self.mode, self.duty, self.setpoint_m = pb.MODE_MANUAL, 0.0, None
        self.schedule, self.schedule_began_us = collections.deque(), None  # pairs of tick and duty that are to come
        self.timed = []  # commands that wait for their time, the next one first
        self.lease_until_us = self.timed_until_us = self.auto_until_us = 0
        self.disturbance_m = 0.0
        self.has_lapsed = self.is_saturated = False
        self.emergency_id, self.emergency_cause = 0, pb.EMERGENCY_CAUSE_NONE
        self.link_timeout_us, self.heard_us, self.is_link_lost = 1_000_000, None, False  # before the first Welcome: no link
        self.recent_ids = collections.deque(maxlen=64)
        self.stop_acks, self.acks = collections.deque(maxlen=8), collections.deque(maxlen=8)
        self.ticked_us = self.missed_ticks = self.bad_frames = 0
        self.note("boot", "reset")

    def now_us(self):
        # SAFETY: this clock counts while the computer sleeps, and no command of before is valid afterwards.
        return (time.clock_gettime_ns(time.CLOCK_BOOTTIME) - self.started_ns) // 1000

    @property
    def position_m(self):
        return self.cart.position_m - self.zero_m

    @property
    def seen_m(self):
        """The position as the controller and telemetry see it."""
        return self.position_m + self.disturbance_m

    def hello(self):
        return pb.Hello(
            protocol_version=1, robot_id=self.robot_id, token=self.token, boot_id=self.boot_id,
            reset_cause=pb.RESET_CAUSE_SOFTWARE, firmware_version="examples/robot.py", sample_period_us=PERIOD_US,
            ring_capacity=RING_SAMPLES, oldest_seq=self.samples.oldest_seq, next_seq=self.samples.next_seq,
            oldest_event_seq=self.events.oldest_seq, next_event_seq=self.events.next_seq, mode=self.mode,
            emergency_id=self.emergency_id, emergency_cause=self.emergency_cause, answers_stop_probes=True,
            acknowledged_next_seq=self.samples.acknowledged_seq, acknowledged_next_event_seq=self.events.acknowledged_seq)

    def status(self):
        return pb.Status(supply_mv=math.nan, missed_ticks=self.missed_ticks, ring_fill=len(self.samples.items),
                         bad_frames=self.bad_frames, lost_samples=self.samples.lost, lost_events=self.events.lost)

    def per_batch(self):
        """The fields that all samples of a batch share."""
        flags = (pb.TELEMETRY_FLAG_SATURATED * self.is_saturated | pb.TELEMETRY_FLAG_LINK_LOSS * self.is_link_lost |
                 pb.TELEMETRY_FLAG_POSITION_LIMIT * self.is_outside | pb.TELEMETRY_FLAG_LEASE_LAPSED * self.has_lapsed)
        sub_state = pb.SUB_STATE_NAVIGATING if self.mode == pb.MODE_AUTO else pb.SUB_STATE_NONE
        return {"mode": self.mode, "sub_state": sub_state, "setpoint_m": self.setpoint_m, "flags": flags,
                "disturbance_m": self.disturbance_m, "emergency_id": self.emergency_id, "emergency_cause": self.emergency_cause}

    def note(self, kind, cause, value=0.0, command_id=0):
        """Adds an event: its kind and cause are those of docs/protocol.md."""
        self.events.add(pb.Event(
            event_seq=self.events.next_seq, event_robot_time_us=self.now_us(), sample_seq=self.samples.next_seq,
            kind=f"EVENT_KIND_{kind.upper()}", cause=f"EVENT_CAUSE_{cause.upper()}", value=value, command_id=command_id,
            position_m=self.seen_m, mode=self.mode, sub_state=self.per_batch()["sub_state"],
            emergency_id=self.emergency_id, emergency_cause=self.emergency_cause))

    def step(self, tick_us):
        """One tick: where the cart is, what time has ended, what the motor gets, and the sample of it."""
        dt_us, self.ticked_us = tick_us - self.ticked_us, tick_us
        self.missed_ticks += dt_us // PERIOD_US - 1  # they are counted, not caught up
        self.cart.move(dt_us / 1e6)
        now_us = self.now_us()  # SAFETY: a tick may be late; what has ended by now has ended
        self.watch_link(now_us)
        self.watch_time(now_us)
        self.watch_position()
        self.run_timed(tick_us)
        self.follow_schedule(tick_us)
        self.cart.duty = self.permitted(self.controller() if self.mode == pb.MODE_AUTO else self.duty)
        reference_m = math.nan if self.setpoint_m is None else self.setpoint_m
        values = (self.seen_m, self.cart.velocity_m_s, self.cart.acceleration_m_s2, self.cart.duty,
                  math.nan, reference_m)  # it has no impedance sensor
        self.samples.add((tick_us, self.per_batch(), values))

    def controller(self):
        """The duty wanted in auto, also beyond [-1, 1]: proportional on the error, derivative on the measured speed."""
        return KP_PER_M * (self.setpoint_m - self.seen_m) - KD_S_PER_M * self.cart.velocity_m_s

    def permitted(self, wanted):
        """What the motor gets of the duty wanted."""
        if not self.is_sound(wanted) and self.mode != pb.MODE_EMERGENCY:  # SAFETY: nothing steers by what is not a number
            self.stop(pb.EMERGENCY_CAUSE_INTERNAL_ERROR, "internal")
        self.is_saturated = self.mode == pb.MODE_AUTO and abs(wanted) > 1
        # SAFETY: whatever was computed before, the motor is off in an emergency, and outside the track it only leads back.
        is_outward = self.is_outside and wanted * self.cart.position_m > 0
        return 0.0 if self.mode == pb.MODE_EMERGENCY or is_outward else max(-1.0, min(1.0, wanted))

    def is_sound(self, wanted=0.0):
        return all(map(math.isfinite, (self.cart.position_m, self.cart.velocity_m_s, wanted)))

    def watch_link(self, now_us):
        # SAFETY: without a station the robot comes to rest, and nothing moves by itself when the link is back.
        is_silent = self.heard_us is not None and now_us - self.heard_us >= self.link_timeout_us
        if is_silent and not self.is_link_lost:
            self.is_link_lost = True
            self.note("link_lost", "link_loss")
            self.drop_timed("expired")
            if self.mode != pb.MODE_EMERGENCY:
                self.rest(pb.MODE_MANUAL, "link_loss")

    def heard(self, now_us):
        self.watch_link(now_us)  # a frame that ends a long silence does not hide it
        if self.is_link_lost:
            self.is_link_lost = False
            self.note("link_restored", "none", (now_us - self.heard_us) / 1e6)
        self.heard_us = now_us

    def watch_time(self, now_us):
        # SAFETY: no duty runs and no command waits longer than its lease, and auto runs no longer than its limit.
        if (self.duty or self.schedule) and now_us >= self.lease_until_us:
            lapsed, self.duty, self.has_lapsed = self.duty, 0.0, True
            self.schedule.clear()
            self.note("lease_lapsed", "time", lapsed)
            self.drop_timed("expired")
        if now_us >= self.timed_until_us:
            self.drop_timed("expired")
        if self.mode == pb.MODE_AUTO and now_us >= self.auto_until_us:
            self.note("auto_limit", "time", AUTO_LIMIT_S)
            self.rest(pb.MODE_MANUAL, "time")

    def run_timed(self, tick_us):
        while self.timed and tick_us >= self.timed[0].execute_at_robot_us:
            command, now_us = self.timed.pop(0), self.now_us()
            try:
                check(now_us <= command.valid_until_robot_us, "expired")
                self.carry_out(command, now_us)
            except Refused as refused:
                self.acknowledge(command, refused.args[0])  # for the second time

    def drop_timed(self, word):
        while self.timed:
            self.acknowledge(self.timed.pop(0), word)

    def follow_schedule(self, tick_us):
        if self.schedule and self.schedule_began_us is None:
            self.schedule_began_us = tick_us
        while self.schedule and tick_us >= self.schedule_began_us + self.schedule[0][0] * PERIOD_US:
            self.duty = self.schedule.popleft()[1]
            if not self.schedule:
                self.note("duty_schedule_ended", "time")

    def watch_position(self):
        was_outside, limit_m = self.is_outside, POSITION_LIMIT_M - RETURN_M * self.is_outside
        self.is_outside = abs(self.cart.position_m) > limit_m
        if self.is_outside and not was_outside:
            self.note("limit_hit", "limit", math.copysign(POSITION_LIMIT_M, self.cart.position_m) - self.zero_m)
            if self.mode != pb.MODE_EMERGENCY:  # SAFETY: the end of the track stops the cart
                self.stop(pb.EMERGENCY_CAUSE_POSITION_LIMIT, "limit")

    def rest(self, mode, cause, command_id=0):
        """Enters the mode with the motor off: no duty, lease, setpoint or timed command outlives a change of mode."""
        was, self.mode, self.setpoint_m = self.mode, mode, None
        self.duty = self.disturbance_m = 0.0
        self.schedule.clear()
        self.has_lapsed = self.is_saturated = False
        self.drop_timed("latched" if mode == pb.MODE_EMERGENCY else "wrong_mode")
        if was != mode and pb.MODE_EMERGENCY not in (was, mode):
            self.note("mode_changed", cause, command_id=command_id)
        self.cart.duty = 0.0  # SAFETY: off at once, also between two ticks; last, since a driver that fails ends the program

    def stop(self, emergency_cause, cause, command_id=0):
        # SAFETY: the latch comes before the motor's driver, which may fail, and stays until it is cleared.
        self.emergency_id, self.emergency_cause = secrets.randbits(64) or 1, emergency_cause
        self.rest(pb.MODE_EMERGENCY, cause)
        self.note("emergency", cause, command_id=command_id)

    def on_command(self, command, now_us):
        """Does a command, or stores it, or not, and acknowledges it."""
        try:
            self.acknowledge(command, "accepted", self.act(command, now_us))
        except Refused as refused:
            self.acknowledge(command, refused.args[0])

    def acknowledge(self, command, word, effect_at_robot_us=0):
        """Leaves an acknowledgement to be sent; the word is a result or a reason of docs/protocol.md."""
        is_result = word in ("accepted", "expired", "duplicate", "other_boot")
        acks = self.stop_acks if command.HasField("emergency_stop") else self.acks
        acks.append(pb.CommandAck(
            command_id=command.command_id, effect_at_robot_us=effect_at_robot_us, emergency_id=self.emergency_id,
            result=f"COMMAND_RESULT_{word.upper()}" if is_result else pb.COMMAND_RESULT_REJECTED,
            reason=pb.REJECT_REASON_NONE if is_result else f"REJECT_REASON_{word.upper()}"))

    def act(self, command, now_us):
        """Returns when it acts: the effect's time on the robot's clock."""
        action = command.WhichOneof("action")
        is_repeated = command.command_id != 0 and command.command_id in self.recent_ids
        if action == "emergency_stop":  # SAFETY: obeyed in every state, whatever its boot and its age
            check(not is_repeated or self.emergency_id == 0, "duplicate")
            if command.command_id != 0 and not is_repeated:
                self.recent_ids.append(command.command_id)
            self.stop(pb.EMERGENCY_CAUSE_OPERATOR, "command", command.command_id)
            return now_us
        check(command.command_id != 0 and action is not None, "malformed")
        check(command.boot_id == self.boot_id, "other_boot")
        check(not is_repeated, "duplicate")
        self.recent_ids.append(command.command_id)
        check(now_us <= command.valid_until_robot_us, "expired")  # SAFETY: what was delayed on its way moves nothing
        check(command.valid_until_robot_us - now_us <= MAX_LIFE_US, "life_too_long")
        check(command.execute_at_robot_us <= command.valid_until_robot_us, "out_of_range")
        check(hasattr(self, f"do_{action}"), "unsupported")
        if command.execute_at_robot_us > now_us:
            return self.store(command, now_us)
        self.carry_out(command, now_us)
        if action == "set_duty" and command.set_duty.duty == 0:
            self.drop_timed("expired")  # SAFETY: a motor that is stopped does not start again by what still waits
        return now_us

    def carry_out(self, command, now_us):
        action = command.WhichOneof("action")
        getattr(self, f"do_{action}")(getattr(command, action), command.command_id, now_us)

    def store(self, command, now_us):
        check(self.mode != pb.MODE_EMERGENCY, "latched")
        # SAFETY: a lease is renewed by a sender who is there now, never by one who was there when it was sent.
        check(not command.HasField("renew_lease"), "malformed")
        if now_us >= self.timed_until_us:  # SAFETY: what has outlived its lease is not revived by another
            self.drop_timed("expired")
        check(len(self.timed) < MAX_TIMED, "busy")
        self.timed = sorted([*self.timed, command], key=lambda one: one.execute_at_robot_us)
        self.timed_until_us = now_us + 1000 * LEASE_MS
        return command.execute_at_robot_us

    def check_mode(self, *modes):
        check(self.mode != pb.MODE_EMERGENCY, "latched")  # SAFETY: only clear_emergency leads out of it
        check(self.mode in modes, "wrong_mode")

    def do_set_mode(self, wanted, command_id, now_us):
        self.check_mode(pb.MODE_MANUAL, pb.MODE_AUTO)
        is_auto = wanted.mode == pb.MODE_AUTO
        check(is_auto or wanted.mode == pb.MODE_MANUAL, "malformed")
        check(wanted.HasField("setpoint_m") == is_auto, "malformed")
        if is_auto:
            self.check_setpoint(wanted.setpoint_m)
        self.rest(wanted.mode, "command", command_id)
        if is_auto:
            self.auto_until_us = now_us + AUTO_LIMIT_S * 1_000_000
            self.do_set_setpoint(wanted, command_id, now_us)

    def check_setpoint(self, setpoint_m):
        check_range(POSITION_LIMIT_M + 1e-6, self.zero_m + setpoint_m)  # as a float of 32 bits, 1.2 is a little more

    def do_set_setpoint(self, wanted, command_id, _):
        self.check_mode(pb.MODE_AUTO)
        self.check_setpoint(wanted.setpoint_m)
        self.setpoint_m = wanted.setpoint_m
        self.note("setpoint_changed", "command", self.setpoint_m, command_id)

    def check_duties(self, *duties):
        check_range(1, *duties)
        # SAFETY: beyond an end of the track only the way back is open.
        check(not self.is_outside or all(duty * self.cart.position_m <= 0 for duty in duties), "outward")

    def do_set_duty(self, wanted, _, now_us):
        self.check_mode(pb.MODE_MANUAL)
        check(wanted.lease_ms <= LEASE_MS, "out_of_range")
        self.check_duties(wanted.duty)
        self.duty, self.has_lapsed = wanted.duty, False
        self.schedule.clear()
        self.lease_until_us = now_us + 1000 * (wanted.lease_ms or LEASE_MS)

    def do_set_duty_schedule(self, wanted, _, now_us):
        self.check_mode(pb.MODE_MANUAL)
        ticks, duties = list(wanted.tick), list(wanted.duty)
        check(0 < len(ticks) == len(duties) <= MAX_SCHEDULE and duties[-1] == 0, "malformed")
        check(all(one < next_one for one, next_one in zip(ticks, ticks[1:])), "malformed")
        self.check_duties(*duties)
        self.duty, self.has_lapsed = 0.0, False
        self.schedule, self.schedule_began_us = collections.deque(zip(ticks, duties)), None
        self.lease_until_us = now_us + 1000 * LEASE_MS

    def do_inject_disturbance(self, wanted, command_id, _):
        self.check_mode(pb.MODE_AUTO)
        check_range(POSITION_LIMIT_M, wanted.disturbance_m)
        self.disturbance_m = wanted.disturbance_m
        self.note("disturbance", "command", self.disturbance_m, command_id)

    def do_renew_lease(self, wanted, _, now_us):
        check(self.mode != pb.MODE_EMERGENCY, "latched")
        check(wanted.lease_ms <= LEASE_MS, "out_of_range")
        # SAFETY: a lease that has lapsed is not renewed, not even before the tick that would notice it.
        has_duty = bool(self.duty or self.schedule) and now_us < self.lease_until_us
        has_timed = bool(self.timed) and now_us < self.timed_until_us
        check(has_duty or has_timed, "nothing_to_renew")
        until_us = now_us + 1000 * (wanted.lease_ms or LEASE_MS)
        self.lease_until_us, self.timed_until_us = has_duty and until_us, has_timed and until_us  # 0: it had lapsed

    def do_clear_emergency(self, wanted, command_id, _):
        # SAFETY: only the latch that the sender has seen is cleared, never one that came after it.
        check(self.emergency_id != 0 and wanted.emergency_id == self.emergency_id, "other_emergency")
        check(self.is_sound(), "cause_stands")
        self.emergency_id, self.emergency_cause = 0, pb.EMERGENCY_CAUSE_NONE
        self.rest(pb.MODE_MANUAL, "command")
        self.note("emergency_cleared", "command", command_id=command_id)

    def do_zero_position(self, _, command_id, __):
        """Moves the zero of setpoints and telemetry; the track ends where it ended."""
        self.check_mode(pb.MODE_MANUAL)
        check(not self.duty and not self.schedule and self.cart.duty == 0, "motor_on")
        before_m, self.zero_m = self.position_m, self.cart.position_m
        self.note("position_zeroed", "command", before_m, command_id)

    def do_drop_timed(self, *_):
        self.drop_timed("expired")

    def do_ping(self, *_):
        pass


def main():
    parser = argparse.ArgumentParser(description="A simulated cart on a track, for a Rheonaut station.")
    parser.add_argument("--station", type=address, default="127.0.0.1:7070", metavar="HOST:PORT")
    parser.add_argument("--id", default="cart-1", help="1 to 31 characters of [a-z0-9_-]")
    parser.add_argument("--token-file", type=argparse.FileType(), help="with the token that `rheonaut robot enrol` prints")
    parser.add_argument("--tls-ca", type=authority, help="TLS, with a station whose certificate this authority has signed")
    options = parser.parse_args()
    if options.token_file and not options.tls_ca and options.station[0] not in ("127.0.0.1", "::1", "localhost"):
        parser.error(f"--token-file without --tls-ca: anybody between here and {options.station[0]} could read the token")
    robot = Robot(options.id, options.token_file.read().strip() if options.token_file else "")
    try:
        asyncio.run(StationLink(robot, *options.station, options.tls_ca).run_until_signalled())
    except asyncio.CancelledError:
        return 0
    finally:
        robot.cart.duty = 0.0  # SAFETY: a program that ends leaves the motor off


if __name__ == "__main__":
    sys.exit(main())
