"""`rheonaut-sim proxy` and a robot whose link is broken, as programs: lines, control, and what they say of bad arguments."""
import json
import os
import pathlib
import select
import signal
import socket
import subprocess
import unittest
import urllib.request

PROGRAM = pathlib.Path(os.environ["RHEONAUT_BIN"]) / "rheonaut-sim"
TIMEOUT_S = 60


class Running:
    """The program as a process, its lines, and its control."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([PROGRAM, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, bufsize=0)
        self.waiting = b""

    def line(self):
        while b"\n" not in self.waiting:
            readable, _, _ = select.select([self.process.stdout], [], [], TIMEOUT_S)
            chunk = os.read(self.process.stdout.fileno(), 4096) if readable else b""
            if not chunk:
                raise AssertionError(f"no line came; there was {self.waiting!r}")
            self.waiting += chunk
        line, self.waiting = self.waiting.split(b"\n", 1)
        return line.decode()

    def line_with(self, text):
        while True:
            line = self.line()
            if text in line:
                return line

    def say(self, text):
        self.process.stdin.write(text.encode() + b"\n")

    def port(self):
        return int(self.line_with("listening on 127.0.0.1:").rsplit(":", 1)[1])

    def stop(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        status = self.process.wait(timeout=TIMEOUT_S)
        self.close()
        return status

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


def refused(*arguments):
    """The exit status and the words of a proxy that does not start."""
    ended = subprocess.run([PROGRAM, "proxy", *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                           timeout=TIMEOUT_S)
    return ended.returncode, ended.stdout + ended.stderr


class ProxyTest(unittest.TestCase):
    def setUp(self):
        self.target = socket.create_server(("127.0.0.1", 0))
        self.target.settimeout(TIMEOUT_S)
        self.addCleanup(self.target.close)
        self.to = "127.0.0.1:%d" % self.target.getsockname()[1]

    def start(self, *arguments):
        proxy = Running("proxy", "--to", self.to, *arguments)
        self.addCleanup(proxy.close)
        return proxy

    def connect(self, port):
        client = socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S)
        self.addCleanup(client.close)
        server, _ = self.target.accept()
        server.settimeout(TIMEOUT_S)
        self.addCleanup(server.close)
        return client, server

    def test_passes_bytes_obeys_and_ends_cleanly(self):
        proxy = self.start("--delay-ms", "5", "--split", "1")
        client, server = self.connect(proxy.port())
        client.sendall(b"hello")
        received = b""
        while len(received) < 5:
            received += server.recv(5)
        self.assertEqual(received, b"hello")
        proxy.line_with("connection 1 from 127.0.0.1:")
        proxy.say("explode")
        self.assertIn("unknown word 'explode'", proxy.line())
        proxy.say("cut")
        self.assertEqual(proxy.line(), "ok: cut")
        self.assertEqual(client.recv(1), b"")
        self.assertEqual(server.recv(1), b"")
        proxy.line_with("connection 1 ended")
        self.assertEqual(proxy.stop(signal.SIGINT), 0)

    def test_ends_cleanly_with_connections_open_and_its_input_gone(self):
        proxy = self.start("--outage", "0.05,0.05")
        client, server = self.connect(proxy.port())
        proxy.process.stdin.close()
        proxy.line_with("outage over")
        client.sendall(b"x")
        self.assertEqual(server.recv(1), b"x")
        self.assertEqual(proxy.stop(), 0)

    def test_an_unreachable_target_is_a_line_and_the_proxy_goes_on(self):
        self.target.close()
        proxy = self.start()
        port = proxy.port()
        for number in (1, 2):
            with socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S) as client:
                self.assertEqual(client.recv(1), b"")
            proxy.line_with(f"cannot reach {self.to}: connection {number} is closed")
        self.assertEqual(proxy.stop(), 0)

    def test_bad_arguments_are_named(self):
        for arguments, words in (
                ((), "--to is required"),
                (("--to", self.to, "--explode"), "--explode"),
                (("--to", "nowhere"), "--to: 'nowhere' is not ADDR:PORT"),
                (("--to", "127.0.0.1:0"), "--to: '0' is not a port"),
                (("--to", self.to, "--listen", "127.0.0.1:99999"), "--listen: '99999' is not a port"),
                (("--to", self.to, "--listen", "example:0"), "'example' is not an IP address"),
                (("--to", self.to, "--listen", self.to), f"cannot listen on {self.to}"),
                (("--to", self.to, "--loss", "1.5"), "loss_probability 1.5"),
                (("--to", self.to, "--delay-ms", "-1"), "delay_s -0.001"),
                (("--to", self.to, "--delay-ms", "soon"), "--delay-ms"),
                (("--to", self.to, "--outage", "5"), "--outage: '5' is not AT,FOR")):
            with self.subTest(arguments=arguments):
                status, said = refused(*arguments)
                self.assertNotEqual(status, 0)
                self.assertIn(words, said)


class RobotTest(unittest.TestCase):
    def ask(self, url, fault=None):
        body = json.dumps(fault).encode() if fault else None
        request = urllib.request.Request(url, body, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:
            return json.load(answer)

    def test_faults_of_link_and_robot_come_over_http(self):
        station = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(station.close)
        station.settimeout(TIMEOUT_S)
        robot = Running("--station", "127.0.0.1:%d" % station.getsockname()[1], "--faults", "127.0.0.1:0")
        self.addCleanup(robot.close)
        robot.line_with("in this process, which does the faults of the link")
        url = robot.line_with("faults at ").split("faults at ")[1]
        self.assertEqual([fault["fault"] for fault in self.ask(url)["known"] if not fault["is_in_this_run"]], [])

        def is_reset():
            connection, _ = station.accept()
            with connection:
                connection.settimeout(TIMEOUT_S)
                connection.recv(1)  # the Hello has come
                self.ask(url, {"fault": "link_reset"})
                try:
                    while connection.recv(4096):
                        pass
                except ConnectionResetError:
                    return True
            return False  # the robot was faster: nobody has welcomed it

        self.assertTrue(any(is_reset() for _ in range(5)))
        self.ask(url, {"fault": "reboot", "off_for_s": 0.1})
        self.assertEqual(self.ask(url)["boots"], 2)
        self.assertEqual(robot.stop(), 2, "no station took it in")

    def test_a_robot_says_what_is_wrong_with_its_arguments(self):
        for arguments, words in (((), "--station or --data is required"),
                                 (("--station", "nowhere"), "--station: 'nowhere' is not ADDR:PORT"),
                                 (("--station", "127.0.0.1:0"), "--station: '0' is not a port"),
                                 (("--station", "127.0.0.1:7700", "--id", "Robot 1"), "robot id 'Robot 1'")):
            with self.subTest(arguments=arguments):
                ended = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=TIMEOUT_S)
                self.assertNotEqual(ended.returncode, 0)
                self.assertIn(words, ended.stdout + ended.stderr)


if __name__ == "__main__":
    unittest.main()
