"""examples/robot.py with a real station, in real time: driven, stopped and cleared; every sample there once after a cut link
and after the station's death; a command that comes too late; TLS and a token."""
import asyncio
import json
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from example_robot import EXAMPLES  # first: it may go on in another Python

from station_link import StationLink
from processes import PATIENCE_S, PATIENT, ApiError, commanded, lab, wait_until
from recording_audit import audit

SHORT_LINK = "[robots]\nlink_timeout_ms = 2000\n"  # of a test in which it has to break
OUTAGE_S = 3
PROFILE = """
name = "A push"
purpose = "The speed of the cart at a duty."
[[step]]
kind = "rest"
for_s = 0.2
[[step]]
kind = "duty"
duty = 0.3
for_s = 1.6
[[step]]
kind = "rest"
for_s = 0.2
"""
# The same robot without events, status, stop probes, auto and all that docs/protocol.md lets a robot leave out.
LESS = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from robot import Robot, check, main, pb
from station_link import Connection
hello, set_mode = Robot.hello, Robot.do_set_mode
def hello_of_less(robot):
    message = hello(robot)
    message.answers_stop_probes = False
    return message
def set_manual(robot, wanted, *rest):
    check(wanted.mode == pb.MODE_MANUAL, "unsupported")
    set_mode(robot, wanted, *rest)
def store(*_):
    check(False, "unsupported")
Robot.hello, Robot.do_set_mode, Robot.store, Robot.note = hello_of_less, set_manual, store, lambda *_, **__: None
del Robot.do_set_setpoint, Robot.do_set_duty_schedule, Robot.do_inject_disturbance, Robot.do_zero_position
def only_signs_of_life(connection):
    return {"heartbeat": pb.Heartbeat()} if connection.robot.now_us() - connection.sent_us >= connection.heartbeat_us else None
Connection.next_status = only_signs_of_life
main()
"""


class ExampleRobotTest(unittest.TestCase):
    """With a real station, in real time."""

    def started(self, config=PATIENT):
        self.place = self.enterContext(lab(config=config))
        self.station = self.place.start_station()
        return self.station

    def start_robot(self, address, *flags, program=(EXAMPLES / "robot.py",)):
        robot = self.begin_robot(address, *flags, program=program)
        self.station.wait_for_robot("cart-1", PATIENCE_S)
        return robot

    def begin_robot(self, address, *flags, program=(EXAMPLES / "robot.py",), robot_id="cart-1"):
        return self.place._start(robot_id, sys.executable, "-B", *program, "--station", address, "--id", robot_id, *flags)

    def robot(self):
        return self.station.robot("cart-1")

    def verified(self, kind, **arguments):
        """The station has seen the command's effect in the robot's telemetry. What a machine that stood still has let end
        too early, such as a lease, is given again."""
        def attempt():
            ended = self.ended(commanded(self.station, kind, "cart-1", **arguments))
            return ended if ended["state"] == "verified" else None
        return wait_until(attempt, PATIENCE_S, f"{kind} verified")

    def ended(self, command):
        """The record of a command once it has ended."""
        def record():
            found = self.station.get(f"/api/v1/commands/{command['command_id']}")
            return found if found["ended_at_us"] else None
        return wait_until(record, PATIENCE_S, f"{command['kind']} has an end")

    def stopped(self):
        stopped = self.ended(self.station.post("/api/v1/robots/cart-1/emergency-stop"))
        self.assertEqual(stopped["state"], "verified")
        return stopped

    def refusal(self, kind, **arguments):
        with self.assertRaises(ApiError) as refused:
            commanded(self.station, kind, "cart-1", **arguments)
        return refused.exception.reason

    def more_samples(self, count=100):
        seen = self.robot()["next_seq"]
        wait_until(lambda: self.robot()["next_seq"] > seen + count, PATIENCE_S, f"{count} more samples")

    def event(self, kind, after_us=0):
        """The first of this kind since this time of the robot."""
        events = reversed(self.station.get("/api/v1/robots/cart-1/events?limit=1000")["events"])
        return next((event for event in events if event["kind"] == kind and event["robot_time_us"] > after_us), None)

    def samples_from(self, first_seq, robot_time_us=0):
        """Of the boot, from this number and this time on, to the latest."""
        robot = self.robot()
        span = {"boot_id": robot["boot_id"], "first_seq": first_seq, "last_seq": robot["next_seq"] - 1}
        run = self.station.post("/api/v1/runs", {"robot_id": "cart-1", "name": "look", "span": span})["run_id"]
        wait_until(lambda: self.station.get(f"/api/v1/runs/{run}/certificate")["final"], PATIENCE_S, "all of it on disk")
        samples = self.station.get(f"/api/v1/runs/{run}/samples?limit=10000")["samples"]
        self.assertEqual([sample["seq"] for sample in samples], list(range(first_seq, robot["next_seq"])))
        return [sample for sample in samples if sample["robot_time_us"] >= robot_time_us]

    def assert_nothing_moves(self, robot_time_us):
        """From this time of the robot on, in each of more than 50 samples."""
        self.more_samples(50)
        duties = [sample["duty"] for sample in self.samples_from(0, robot_time_us)]
        self.assertGreater(len(duties), 50)
        self.assertEqual(set(duties), {0.0})

    def assert_all_is_recorded(self):
        """Every number of the one boot is there once. Ends the station."""
        made = self.robot()["next_seq"]
        wait_until(lambda: self.robot()["durable_next_seq"] >= made, PATIENCE_S, "what was made until now is on disk")
        wait_until(lambda: self.robot()["oldest_seq"] >= made, PATIENCE_S, "the robot has dropped what is on disk")
        self.assertEqual(self.place.stop_station(), 0)
        faults, stored, lost = audit(self.place.data / "station.sqlite")
        self.assertEqual((faults, lost), ([], 0))
        self.assertGreaterEqual(stored, made)

    def test_it_is_driven_stopped_and_cleared(self):
        station = self.started()
        robot = self.start_robot(station.endpoints["robots"])
        self.assertIsNone(self.robot()["sample"]["impedance_mv"], "it has no such sensor")
        wait_until(lambda: self.robot()["stop_path"]["is_open"], PATIENCE_S, "the way of a stop is open")
        wait_until(lambda: self.robot()["clock"], PATIENCE_S, "its clock is known")

        driven_us = self.verified("set_duty", duty=0.4)["effect_at_robot_us"]
        lapsed = wait_until(lambda: self.event("lease_lapsed", driven_us), PATIENCE_S, "the lease lapses")
        self.assertAlmostEqual(lapsed["value"], 0.4, places=6)
        self.assertGreater(self.robot()["sample"]["position_m"], 0.01)
        self.assert_nothing_moves(lapsed["robot_time_us"])

        self.verified("set_mode", mode="auto", setpoint_m=0.2)
        wait_until(lambda: abs(self.robot()["sample"]["position_m"] - 0.2) < 0.002, PATIENCE_S, "it is there")
        self.verified("set_setpoint", setpoint_m=-0.5)
        wait_until(lambda: self.robot()["sample"]["velocity_m_s"] < -0.1, PATIENCE_S, "it moves")
        stopped = self.stopped()
        self.assertEqual(self.robot()["mode"], "emergency")
        self.assertEqual(self.refusal("set_duty", duty=0.1), "latched", "by the station; the robot's own rule has a test")
        self.verified("clear_emergency", emergency_id=self.robot()["emergency_id"])
        self.assertEqual((self.robot()["mode"], self.robot()["setpoint_m"]), ("manual", None))
        self.assert_nothing_moves(stopped["effect_at_robot_us"])

        self.assertEqual(self.refusal("set_parameter", name="kp", value=1), "unsupported")
        commanded(station, "zero_position", "cart-1")
        wait_until(lambda: abs(self.robot()["sample"]["position_m"]) < 0.005, PATIENCE_S, "its place is the new 0")
        self.assert_all_is_recorded()
        robot.send_signal(signal.SIGTERM)
        self.assertEqual(robot.wait(timeout=PATIENCE_S), 0, "it ends in order")

    def test_a_command_that_comes_too_late_is_refused_and_moves_nothing(self):
        station = self.started()
        robot = self.start_robot(station.endpoints["robots"])
        robot.send_signal(signal.SIGSTOP)  # what is sent to it now waits in its socket
        try:
            with self.assertRaises(ApiError) as unanswered:
                station.command("cart-1", "set_duty", duty=0.5, life_ms=200)
            self.assertEqual(unanswered.exception.status, 504)
            command_id = station.get("/api/v1/robots/cart-1/commands?limit=1")["commands"][0]["command_id"]
            time.sleep(1)  # the standstill is the input of this test
        finally:
            robot.send_signal(signal.SIGCONT)
        def answer():
            record = self.station.get(f"/api/v1/commands/{command_id}")
            return record if record["state"] not in ("sent", "unknown") else None
        late = wait_until(answer, PATIENCE_S, "its late answer")
        self.assertEqual((late["state"], late["reason"], late["effect_at_robot_us"]), ("expired", "expired", None))
        wait_until(lambda: (self.robot()["status"] or {}).get("missed_ticks", 0) > 90, PATIENCE_S,
                   "it counts the ticks of that second")
        self.assert_nothing_moves(0)

    def test_after_a_cut_link_every_sample_is_there_once(self):
        station = self.started(SHORT_LINK)
        proxy = subprocess.Popen([self.place.bin / "rheonaut-sim", "proxy", "--to", station.endpoints["robots"]],
                                 stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self.addCleanup(proxy.communicate)
        self.addCleanup(proxy.terminate)
        address = proxy.stdout.readline().split()[-1]
        self.start_robot(address)
        def moves():
            if self.robot()["mode"] != "auto":  # also after a standstill of this machine that has broken the link
                self.verified("set_mode", mode="auto", setpoint_m=1.0)
            return self.robot()["sample"]["velocity_m_s"] > 0.1
        wait_until(moves, PATIENCE_S, "it moves")
        print("outage", OUTAGE_S, file=proxy.stdin, flush=True)
        wait_until(lambda: self.robot()["link"] == "disconnected", PATIENCE_S, "the link is cut")
        wait_until(lambda: self.robot()["link"] == "connected", PATIENCE_S, "the robot has dialled again")
        self.more_samples()
        lost = wait_until(lambda: self.event("link_lost"), PATIENCE_S, "it noticed")
        self.assertEqual((self.robot()["mode"], self.robot()["setpoint_m"]), ("manual", None))
        self.assert_nothing_moves(lost["robot_time_us"])
        flags = {sample["flags"] for sample in self.samples_from(0)}
        self.assertTrue({flag for flag in flags if flag & 1 and flag & 4}, f"backfill of the time without link: {flags}")
        self.assert_all_is_recorded()

    def test_a_station_that_was_killed_misses_no_sample(self):
        station = self.started()
        ports = station.endpoints
        self.start_robot(ports["robots"])
        before = self.robot()
        for _ in range(2):
            self.more_samples()
            self.place.kill_station()
            time.sleep(1)  # the outage is the input of this test
            self.station = self.place.start_station(http=ports["http"], robots=ports["robots"])
            self.station.wait_for_robot("cart-1", PATIENCE_S)
        self.assertEqual(self.robot()["boot_id"], before["boot_id"])
        self.assert_all_is_recorded()

    def test_a_robot_that_lost_its_latch_is_stopped_again_when_it_returns(self):
        station = self.started()
        robot = self.start_robot(station.endpoints["robots"])
        boot = self.robot()["boot_id"]
        self.verified("set_mode", mode="auto", setpoint_m=1.0)
        self.stopped()
        robot.kill()
        robot.wait()
        self.start_robot(station.endpoints["robots"])
        wait_until(lambda: self.robot()["mode"] == "emergency" and self.robot()["boot_id"] != boot, PATIENCE_S,
                   "it is latched in its new boot")
        self.assertEqual(self.refusal("set_duty", duty=0.5), "latched")
        self.verified("clear_emergency", emergency_id=self.robot()["emergency_id"])
        self.assert_nothing_moves(0)
        self.verified("set_duty", duty=0.5)

    def test_a_robot_that_has_less(self):
        station = self.started()
        self.start_robot(station.endpoints["robots"], program=("-c", LESS, EXAMPLES))
        for part, content in (("parameters", "parameters"), ("controller", "controller")):
            self.assertIsNone(station.get(f"/api/v1/robots/cart-1/{part}")[content])
        self.verified("set_duty", duty=0.3)
        self.assertEqual(self.refusal("set_mode", mode="auto", setpoint_m=0.1), "unsupported")
        self.assertIn("is aborted: zero_position: rejected unsupported", self.experiment().stderr)
        stopped = self.stopped()
        self.verified("clear_emergency", emergency_id=self.robot()["emergency_id"])
        self.verified("set_mode", mode="manual")
        self.assert_nothing_moves(stopped["effect_at_robot_us"])
        self.assertEqual((self.robot()["status"], self.robot()["stop_path"]), (None, None))
        self.assert_all_is_recorded()

    def experiment(self):
        profile = self.place.folder / "push.toml"
        profile.write_text(PROFILE)
        return self.place.tool("experiment", "begin", profile, "--robot", "cart-1", "--wait", "--data", self.place.data)

    def test_an_experiment_runs_to_its_end(self):
        station = self.started()
        self.start_robot(station.endpoints["robots"])
        for _ in range(3):  # a machine that stands still has an experiment aborted, as it must be
            done = self.experiment()
            if done.returncode == 0:
                break
            self.verified("set_mode", mode="auto", setpoint_m=0.0)  # back, since each of them goes on where it stands
            wait_until(lambda: abs(self.robot()["sample"]["position_m"]) < 0.01, PATIENCE_S, "it is back")
            self.verified("set_mode", mode="manual")
        self.assertIn("is done", done.stdout, done.stderr)
        run = station.get("/api/v1/runs?limit=1")["runs"][0]["run_id"]  # an attempt that was aborted early has none
        wait_until(lambda: station.get(f"/api/v1/runs/{run}/certificate")["final"], PATIENCE_S, "all of the run on disk")
        self.assertEqual(station.get(f"/api/v1/runs/{run}/certificate")["samples_lost"], 0)
        samples = station.get(f"/api/v1/runs/{run}/samples?limit=10000")["samples"]
        duty = max(sample["duty"] for sample in samples)
        self.assertGreater(duty, 0.1)
        speed_m_s = max(sample["velocity_m_s"] for sample in samples)
        self.assertAlmostEqual(speed_m_s, 0.3 * duty, places=3, msg="the cart came to the speed of this duty")
        self.assertEqual(samples[-1]["duty"], 0)

    def test_a_station_that_hangs_is_dialled_again(self):
        self.started()
        with socket.create_server(("127.0.0.1", 0)) as hanging:
            hanging.settimeout(PATIENCE_S)
            self.begin_robot("127.0.0.1:%d" % hanging.getsockname()[1])
            first, _ = hanging.accept()
            with first, hanging.accept()[0] as second:
                self.assertIn(b"cart-1", second.recv(1024), "its Hello")
                self.assertIn(b"cart-1", first.recv(1024), "and the first connection was one of the robot's, too")
        wait_until(lambda: "no answer" in self.place.log("cart-1"), PATIENCE_S, "it says so")

    def taken_below(self, server_tls=None, **tls):
        """How many bytes a connection to a station that reads nothing takes, before what follows waits in its order."""
        async def fill(link):
            _, writer = await link.dial()
            taken = 0
            while writer.transport.get_write_buffer_size() == 0:
                writer.write(bytes(1000))
                taken += 1000
            writer.transport.abort()
            return taken
        ends = threading.Event()
        with socket.socket() as listener:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            listener.bind(("127.0.0.1", 0))
            listener.listen()

            def hang():
                peer, _ = listener.accept()
                with server_tls.wrap_socket(peer, server_side=True) if server_tls else peer:
                    ends.wait(PATIENCE_S)
            station = threading.Thread(target=hang)
            station.start()
            try:
                return asyncio.run(fill(StationLink(None, "localhost", listener.getsockname()[1], **tls)))
            finally:
                ends.set()
                station.join()

    def test_buffers_below_take_little_ahead_of_the_answer_to_a_stop(self):
        with lab() as place:
            place.tool("certificate", "--data", place.data)
            certificate = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            certificate.load_cert_chain(place.data / "tls" / "station.crt", place.data / "tls" / "station.key")
            trust = ssl.create_default_context(cafile=place.data / "tls" / "lab-ca.crt")
            self.assertLess(self.taken_below(), 30_000)
            self.assertLess(self.taken_below(certificate, tls=trust), 30_000)

    def other_authority(self):
        with lab() as other:
            self.assertEqual(other.tool("certificate", "--data", other.data).returncode, 0)
            copy = self.place.folder / "other-ca.crt"
            copy.write_bytes((other.data / "tls" / "lab-ca.crt").read_bytes())
        return copy

    def test_it_ends_in_order_when_its_terminal_is_closed_unless_nohup_has_it_go_on(self):
        self.started()
        for prefix, status in (((), 0), (("/usr/bin/nohup",), None)):
            robot = self.place._start("ends", *prefix, sys.executable, "-B", EXAMPLES / "robot.py", "--id", "ends",
                                      "--station", self.station.endpoints["robots"])
            self.station.wait_for_robot("ends", PATIENCE_S)
            robot.send_signal(signal.SIGHUP)
            if status is None:
                seen = self.station.robot("ends")["next_seq"]
                wait_until(lambda: self.station.robot("ends")["next_seq"] > seen + 50, PATIENCE_S, "it goes on")
                robot.send_signal(signal.SIGTERM)  # a shell's job in the background would ignore SIGINT
            self.assertEqual(robot.wait(timeout=PATIENCE_S), 0)

    def test_it_sends_no_token_in_clear_text_to_another_machine(self):
        with tempfile.NamedTemporaryFile() as token:
            refused = subprocess.run([sys.executable, "-B", EXAMPLES / "robot.py", "--station", "lab-pc.local:7070",
                                      "--token-file", token.name], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("could read the token", refused.stderr)

    def test_over_tls_with_a_token(self):
        with lab() as place:
            self.place = place
            self.assertEqual(place.tool("certificate", "--data", place.data).returncode, 0)
            self.station = place.start_station(config=f'{PATIENT}enrol_on_loopback = false\n[tls]\nmode = "on"\n')
            address = self.station.endpoints["robots"]
            token = place.folder / "cart-1.token"
            enrolled = place.tool("robot", "enroll", "cart-1", "--json", "--data", place.data)
            token.write_text(json.loads(enrolled.stdout)["secret"])
            trusted = ("--tls-ca", place.data / "tls" / "lab-ca.crt")
            self.start_robot(address, *trusted, "--token-file", token)
            self.verified("set_duty", duty=0.1)
            self.assertEqual(self.place.log("cart-1").count("connected to"), 1)
            for robot_id, why, flags in (("stranger", "robot 'stranger' is not enrolled", trusted),
                                         ("plain", f"{address}: ", ()),  # reset or closed, as it happens
                                         ("deceived", "CERTIFICATE_VERIFY_FAILED", ("--tls-ca", self.other_authority()))):
                self.begin_robot(address, *flags, robot_id=robot_id)
                wait_until(lambda: why in place.log(robot_id), PATIENCE_S, f"'{why}' of {robot_id}")
            for robot_id in ("stranger", "plain", "deceived"):
                self.assertNotIn("connected to", place.log(robot_id))


if __name__ == "__main__":
    unittest.main()
