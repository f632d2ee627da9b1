"""Bad input on both ports of a real station: each a clear refusal, and the station lives on."""
import http.client
import json
import select
import socket
import struct
import unittest

from processes import lab, wait_until


def varint(value):
    out = bytearray()
    while True:
        out.append((value & 0x7F) | (0x80 if value > 0x7F else 0))
        value >>= 7
        if not value:
            return bytes(out)


def field(number, wire_type, content):
    return varint(number << 3 | wire_type) + content


def text_field(number, content):
    return field(number, 2, varint(len(content)) + content)


def hello(version=1, robot_id=b"stranger", boot_id=99, period_us=10000):
    """A framed Hello, written by hand from docs/protocol.md."""
    body = (field(1, 0, varint(version)) + text_field(2, robot_id) + text_field(3, b"")
            + field(4, 1, boot_id.to_bytes(8, "little")) + field(7, 0, varint(period_us)))
    frame = field(1, 0, varint(1000)) + text_field(2, body)
    return varint(len(frame)) + frame


def robot_frame(number, body):
    frame = field(1, 0, varint(1000)) + text_field(number, body)
    return varint(len(frame)) + frame


def telemetry(disturbance_m):
    """A framed Telemetry of one sample in manual."""
    floats = b"".join(text_field(number, struct.pack("<f", 0)) for number in range(16, 22))
    return robot_frame(4, field(2, 0, varint(1000)) + field(3, 0, varint(10000)) + field(5, 0, varint(1))
                       + field(8, 5, struct.pack("<f", disturbance_m)) + floats)


class BadInputTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.context = lab()
        cls.place = cls.context.__enter__()
        cls.addClassCleanup(cls.context.__exit__, None, None, None)
        cls.station = cls.place.start_station()
        cls.place.start_robot(cls.station)
        cls.station.wait_for_robot("sim-1")

    def tearDown(self):
        robot = self.station.robot("sim-1")
        self.assertEqual(robot["link"], "connected", "the station lives on")
        self.assertEqual(robot["sample"]["duty"], 0.0, "and nothing moved")

    def http(self, method, path, body=None, headers=None):
        """One request with the token, whatever the body; returns (status, problem)."""
        host, port = self.station.endpoints["http"].split(":")
        connection = http.client.HTTPConnection(host, int(port), timeout=60)
        try:
            connection.request(method, path, body, {"Authorization": f"Bearer {self.station.token}",
                                                    "Content-Type": "application/json", **(headers or {})})
            answer = connection.getresponse()
            content = answer.read()
            if answer.status >= 400:
                self.assertEqual(answer.getheader("Content-Type"), "application/problem+json")
            return answer.status, json.loads(content or b"{}")
        finally:
            connection.close()

    def test_http(self):
        commands = "/api/v1/robots/sim-1/commands"
        cases = [
            (400, "POST", commands, "{"),
            (400, "POST", commands, '{"kind":"set_duty","duty":NaN}'),
            (400, "POST", commands, "[]"),
            (422, "POST", commands, '{"kind":"fly"}'),
            (422, "POST", commands, '{"kind":"set_duty","duty":1.5}'),
            (422, "POST", commands, '{"kind":"set_mode","mode":"auto","setpoint_m":7}'),
            (404, "POST", "/api/v1/robots/nobody/commands", '{"kind":"ping"}'),
            (404, "POST", "/api/v1/robots/nobody/emergency-stop", None),
            (404, "GET", "/api/v1/nothing", None),
            (404, "GET", "/api/v1/runs/999999", None),
            (405, "DELETE", commands, None),
        ]
        for status, method, path, body in cases:
            with self.subTest(method=method, path=path, body=body):
                got, problem = self.http(method, path, body)
                self.assertEqual(got, status, problem)
                self.assertEqual(problem["status"], status)
                self.assertTrue(problem["detail"])

    def test_a_wrong_content_type_host_or_token(self):
        commands = "/api/v1/robots/sim-1/commands"
        self.assertEqual(self.http("POST", commands, '{"kind":"ping"}', {"Content-Type": "text/plain"})[0], 415)
        self.assertEqual(self.http("GET", "/api/v1/robots", None, {"Host": "evil.example"})[0], 421)
        self.assertEqual(self.http("GET", "/api/v1/robots", None, {"Authorization": "Bearer wrong"})[0], 401)
        self.assertEqual(self.http("POST", commands, '{"kind":"ping"}', {"Origin": "http://evil.example"})[0], 403)

    def test_a_body_of_10_mb_is_refused(self):
        host, port = self.station.endpoints["http"].split(":")
        with socket.create_connection((host, int(port)), timeout=60) as connection:
            connection.sendall(f"POST /api/v1/runs HTTP/1.1\r\nHost: {host}:{port}\r\nAuthorization: Bearer "
                               f"{self.station.token}\r\nContent-Type: application/json\r\n"
                               f"Content-Length: 10000000\r\n\r\n".encode())
            for _ in range(100):  # a client that listens while it sends, and stops when it is answered
                readable, writable, _ = select.select([connection], [connection], [], 60)
                if readable:
                    break
                self.assertTrue(writable, "the station neither reads nor answers")
                connection.send(b"x" * 100_000)
            answer = connection.recv(4096)
        self.assertIn(b" 413 ", answer.split(b"\r\n")[0])

    def robot_port(self, content):
        """Sends bytes to the robot port; returns what came back until the station closed."""
        host, port = self.station.endpoints["robots"].split(":")
        with socket.create_connection((host, int(port)), timeout=60) as connection:
            connection.sendall(content)
            received = b""
            try:
                while piece := connection.recv(4096):
                    received += piece
            except ConnectionResetError:
                pass
            return received

    def test_garbage_on_the_robot_port_is_closed_without_an_answer(self):
        self.assertEqual(self.robot_port(b"GET / HTTP/1.1\r\n\r\n" * 100), b"")
        self.assertEqual(self.robot_port(bytes(range(256)) * 64), b"")
        self.assertEqual(self.robot_port(b"\xff\x7f"), b"")

    def test_telemetry_that_is_not_finite_is_counted_and_ends_no_connection(self):
        for robot_id, boot_id, value in ((b"nan-1", 4712, float("nan")), (b"inf-1", 4713, float("inf"))):
            with self.subTest(value=value):
                host, port = self.station.endpoints["robots"].split(":")
                with socket.create_connection((host, int(port)), timeout=60) as connection:
                    connection.sendall(hello(robot_id=robot_id, boot_id=boot_id))
                    self.assertTrue(connection.recv(4096), "the robot is welcome")
                    connection.sendall(telemetry(value))
                    wait_until(lambda: self.station.robot(robot_id.decode())["invalid_values"] > 0, 60, "its count")
                    self.assertEqual(self.station.robot(robot_id.decode())["link"], "connected")

    def test_another_protocol_version_is_refused_with_the_reason(self):
        answer = self.robot_port(hello(version=7))
        self.assertIn(b"protocol version", answer)

    def test_a_malformed_hello_is_refused_with_the_reason(self):
        self.assertIn(b"robot_id must be", self.robot_port(hello(robot_id=b"Not Allowed")))
        self.assertIn(b"boot_id not 0", self.robot_port(hello(boot_id=0)))
        self.assertIn(b"sample_period_us is 0; send", self.robot_port(hello(period_us=0)))

    def test_a_second_robot_of_the_same_name_is_refused_while_the_first_is_there(self):
        answer = self.robot_port(hello(robot_id=b"sim-1", boot_id=4711))
        self.assertIn(b"is connected from", answer)


if __name__ == "__main__":
    unittest.main()
