"""TLS on both ports with real processes, as an independent client (openssl s_client, Python's ssl) sees it."""
import base64
import contextlib
import json
import os
import re
import socket
import ssl
import subprocess
import unittest
import urllib.error
import urllib.request

from processes import PATIENCE_S, PATIENT, lab, stopped, swimming, wait_until
from station_api import trust

TLS_ON = PATIENT + '[tls]\nmode = "on"\n'
SILENT_CLIENTS = 40


def address(text):
    host, port = text.rsplit(":", 1)
    return host, int(port)


def s_client(at, *flags, text=b""):
    """What openssl s_client says of a connection, all of it."""
    done = subprocess.run(["openssl", "s_client", "-connect", at, *flags], input=text, capture_output=True,
                          timeout=PATIENCE_S)
    return (done.stdout + done.stderr).decode(errors="replace")


def serial(at):
    shown = s_client(at)
    certificate = re.search(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", shown, re.S).group(0)
    return subprocess.run(["openssl", "x509", "-noout", "-serial"], input=certificate, capture_output=True, text=True,
                          check=True).stdout.strip()


def answer_of(at, request):
    """What the port says to these bytes, to the end."""
    with socket.create_connection(address(at), timeout=PATIENCE_S) as client:
        client.sendall(request)
        received = b""
        with contextlib.suppress(ConnectionResetError):
            while piece := client.recv(4096):
                received += piece
        return received.decode(errors="replace")


def is_held(client):
    """Whether the port has not let go of it; reads what has come."""
    client.setblocking(False)
    try:
        while client.recv(4096):
            pass
        return False
    except BlockingIOError:
        return True
    except ConnectionResetError:
        return False


def client_hello():
    outgoing = ssl.MemoryBIO()
    client = trust(None).wrap_bio(ssl.MemoryBIO(), outgoing, server_hostname="localhost")
    with contextlib.suppress(ssl.SSLWantReadError):
        client.do_handshake()
    return outgoing.read()


class TlsTest(unittest.TestCase):
    def make_certificate(self, place, *flags):
        """What the command printed; the pin stands in it."""
        done = place.tool("certificate", "--data", place.data, *flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def secure_lab(self, place, config=TLS_ON):
        """(station, pin): both ports in TLS."""
        pin = re.search(r"^pin +([0-9a-f]{64})$", self.make_certificate(place), re.M).group(1)
        return place.start_station(config=config), pin

    def test_versions_ciphers_and_what_is_refused(self):
        with lab() as place:
            station, _ = self.secure_lab(place)
            authority = str(place.data / "tls" / "lab-ca.crt")
            for port in (station.endpoints["http"], station.endpoints["robots"]):
                for version, name in (("-tls1_2", "TLSv1.2"), ("-tls1_3", "TLSv1.3")):
                    with self.subTest(port=port, version=version):
                        said = s_client(port, version, "-CAfile", authority, "-verify_return_error", "-verify_ip",
                                        "127.0.0.1", "-brief")
                        self.assertIn(f"Protocol version: {name}", said)
                        self.assertIn("Verification: OK", said)
                        self.assertRegex(said, r"Ciphersuite: \S*(GCM|CHACHA20)")
                old = s_client(port, "-tls1_1", "-cipher", "DEFAULT@SECLEVEL=0", "-brief")
                self.assertIn("alert protocol version", old)
                for suite in ("ECDHE-ECDSA-AES128-SHA", "ECDHE-ECDSA-AES128-SHA256", "AES128-SHA", "ADH-AES128-SHA",
                              "NULL-SHA"):
                    with self.subTest(port=port, suite=suite):
                        weak = s_client(port, "-tls1_2", "-cipher", suite + ":@SECLEVEL=0", "-brief")
                        self.assertIn("alert handshake failure", weak)
                again = s_client(port, "-tls1_2", text=b"R\n")
                self.assertIn("no renegotiation", again)
                self.assertIn("Compression: NONE", s_client(port, "-tls1_2", "-comp"))

    def test_a_session_is_resumed(self):
        with lab() as place:
            station, _ = self.secure_lab(place)
            kept = str(place.folder / "session.pem")
            for flags in ((), ("-no_ticket",)):  # by ticket, and as the ESP8266 does it
                self.assertIn("New, TLSv1.2", s_client(station.endpoints["robots"], "-tls1_2", *flags, "-sess_out", kept))
                self.assertIn("Reused, TLSv1.2",
                              s_client(station.endpoints["robots"], "-tls1_2", *flags, "-sess_in", kept))

    def test_a_robot_resumes_its_session_after_a_lost_link(self):
        with lab() as place:
            station, pin = self.secure_lab(place, TLS_ON.removeprefix(PATIENT))
            robot = place.start_robot(station, "sim-1", "--tls-pin", pin)
            station.wait_for_robot("sim-1", PATIENCE_S)
            robot.send_signal(19)  # SIGSTOP: it falls silent, and the station hangs up
            try:
                wait_until(lambda: station.robot("sim-1")["link"] == "disconnected", PATIENCE_S,
                           "the link is held for lost")
            finally:
                robot.send_signal(18)  # SIGCONT
            station.wait_for_robot("sim-1", PATIENCE_S)
            resumed, links = self.metric(station, "tls_resumed_total"), place.log("sim-1").count("connected to")
            self.assertGreaterEqual(links, 2)
            self.assertEqual(resumed, links - 1, "each link after the first")

    def test_short_records_for_a_robot_that_asks_for_them(self):
        with lab() as place:
            station, _ = self.secure_lab(place)
            said = s_client(station.endpoints["robots"], "-tls1_2", "-maxfraglen", "512", "-tlsextdebug")
            self.assertIn('TLS server extension "max fragment length"', said)

    def test_plain_http_on_the_tls_port_is_told_to_use_https(self):
        with lab() as place:
            station, _ = self.secure_lab(place)
            self.assertEqual(answer_of(station.endpoints["robots"], b"\x05hello"), "")
            self.assertIn("robot port: no TLS with 127.0.0.1:", place.log("station"))
            said = answer_of(station.endpoints["http"], b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            self.assertTrue(said.startswith("HTTP/1.1 400 "), said)
            self.assertIn("https://", said)
            self.assertEqual(station.get("/api/v1/station")["security"]["http"], "tls", "it lives on")

    def test_a_robot_in_tls_is_stopped_at_once(self):
        with lab() as place:
            station, pin = self.secure_lab(place)
            place.start_robot(station, "sim-1", "--tls-pin", pin)
            place.start_robot(station, "sim-2", "--tls-ca", place.data / "tls" / "lab-ca.crt")
            for robot_id in ("sim-1", "sim-2"):
                station.wait_for_robot(robot_id, PATIENCE_S)
                swimming(station, robot_id)
                stopped(station, robot_id)
                def is_latched():
                    robot = station.robot(robot_id)
                    return robot["mode"] == "emergency" and robot["sample"]["duty"] == 0
                wait_until(is_latched, PATIENCE_S, "emergency with duty 0")

    def test_a_robot_does_not_talk_to_a_station_that_is_not_the_right_one(self):
        with lab() as place, lab() as other:
            station, pin = self.secure_lab(place)
            self.make_certificate(other)
            wrong = {"pinned": ("--tls-pin", "0" * 64), "authority": ("--tls-ca", other.data / "tls" / "lab-ca.crt")}
            for robot_id, flags in wrong.items():
                self.stays_out(place, station, robot_id, "the station is not trusted", *flags)
            self.stays_out(place, station, "plain", "the station closed the connection before its welcome")
            self.assertIn(pin, place.log("pinned"), "says which key it found")
            self.assertEqual(station.robots(), [])
            place.stop_station()
            plain_station = place.start_station()
            self.stays_out(place, plain_station, "strict", "speaks no TLS", "--tls-pin", pin)
            self.assertEqual(plain_station.robots(), [])

    def stays_out(self, place, station, robot_id, why, *flags):
        """A robot that has tried and says why not, and has not been welcome until it is ended then."""
        robot = place.start_robot(station, robot_id, *flags)
        wait_until(lambda: why in place.log(robot_id), PATIENCE_S, f"'{why}' of {robot_id}")
        robot.terminate()
        self.assertEqual(robot.wait(timeout=PATIENCE_S), 2, "no station has taken it in")

    def test_a_renewed_certificate_comes_into_force_without_dropping_a_robot(self):
        with lab() as place:
            station, pin = self.secure_lab(place)
            place.start_robot(station, "sim-1", "--tls-pin", pin)
            station.wait_for_robot("sim-1", PATIENCE_S)
            port = station.endpoints["robots"]
            first = serial(port)
            self.assertIn(f"pin      {pin}", self.make_certificate(place, "--renew"), "the key, and so the pin, stays")
            wait_until(lambda: serial(port) != first, PATIENCE_S, "the new certificate")
            second = serial(port)

            certificate = place.data / "tls" / "station.crt"
            good = certificate.read_bytes()
            certificate.write_bytes(b"not a certificate")
            wait_until(lambda: "the one before stays in force" in place.log("station"), PATIENCE_S,
                       "the error in the log")
            self.assertEqual(serial(port), second)
            certificate.write_bytes(good)

            self.make_certificate(place, "--renew", "--new-key")
            wait_until(lambda: serial(port) != second, PATIENCE_S, "the certificate with the new key")
            self.stays_out(place, station, "sim-2", "the station is not trusted", "--tls-pin", pin)
            seen = station.robot("sim-1")["next_seq"]
            wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 100, PATIENCE_S,
                       "the first robot goes on")
            self.assertNotIn("connection lost", place.log("sim-1"))
            self.assertEqual(place.log("sim-1").count("connected to"), 1)

    def test_silent_clients_keep_nobody_out(self):
        with lab() as place:
            station, pin = self.secure_lab(place)
            with contextlib.ExitStack() as open_sockets:
                silent = [client for port in (station.endpoints["http"], station.endpoints["robots"])
                          for client in self.silent_clients(port, open_sockets)]
                place.start_robot(station, "sim-1", "--tls-pin", pin)
                station.wait_for_robot("sim-1", PATIENCE_S)
                for port in (station.endpoints["http"], station.endpoints["robots"]):
                    wait_until(lambda: self.is_served_before_silent_clients(station, port), PATIENCE_S,
                               "a client is served while those that came before it are silent")
                # The time limit of a handshake.
                wait_until(lambda: not any(map(is_held, silent)), PATIENCE_S, "all of them are let go")
                self.assertGreaterEqual(self.metric(station, "tls_failed_total"), len(silent))

    def silent_clients(self, port, open_sockets):
        hello = client_hello()
        clients = [open_sockets.enter_context(socket.create_connection(address(port), timeout=PATIENCE_S))
                   for _ in range(SILENT_CLIENTS)]
        for client in clients[::2]:
            client.sendall(hello)  # and never the rest
        return clients

    def is_served_before_silent_clients(self, station, port):
        """Whether a handshake ends before the station lets go of the latest silent clients, which came before it. False
        also on a machine so slow that the station's limit of 10 s has passed meanwhile."""
        with contextlib.ExitStack() as open_sockets:
            silent = self.silent_clients(port, open_sockets)
            plain = open_sockets.enter_context(socket.create_connection(address(port), timeout=PATIENCE_S))
            open_sockets.enter_context(trust(station.tls_certificate).wrap_socket(plain))
            return all(map(is_held, silent[-2:]))

    def metric(self, station, name):
        _, _, text = station.request("GET", "/metrics")
        return int(re.search(rf"^rheonaut_{name} (\d+)$", text.decode(), re.M).group(1))

    def test_pages_and_tools_over_https(self):
        with lab() as place:
            station, _ = self.secure_lab(place)
            host, port = address(station.endpoints["http"])
            self.assertIn(f"  https://{host}:{port}/login?code=", place.log("station"))
            url = station.post("/api/v1/login-links")["url"]
            self.assertTrue(url.startswith(f"https://{host}:{port}/login"), url)

            opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=ssl.create_default_context(
                cafile=str(place.data / "tls" / "lab-ca.crt"))))
            origin, code = url.split("/login?code=")
            headers = {"Content-Type": "application/json", "Origin": origin}
            signed_in = opener.open(urllib.request.Request(f"{origin}/api/v1/login", json.dumps({"code": code}).encode(),
                                                           headers))
            cookie = signed_in.headers["Set-Cookie"]
            self.assertIn("; Secure", cookie)
            self.assertIn("max-age=", signed_in.headers["Strict-Transport-Security"])

            def stop_all(origin):
                request = urllib.request.Request(f"https://{host}:{port}/api/v1/emergency-stop", method="POST")
                request.add_header("Cookie", cookie.split(";")[0])
                request.add_header("Origin", origin)
                try:
                    return opener.open(request).status
                except urllib.error.HTTPError as refused:
                    return refused.code
            self.assertLess(stop_all(f"https://{host}:{port}"), 300)
            self.assertEqual(stop_all(f"http://{host}:{port}"), 403)

            copied = place.tool("backup", "--data", place.data, "--to", place.folder / "copy.sqlite")
            self.assertEqual(copied.returncode, 0, copied.stderr)
            self.live_speaks(station)

    def live_speaks(self, station):
        """A WebSocket in TLS: the upgrade, and the welcome as its first message."""
        with socket.create_connection(address(station.endpoints["http"]), timeout=PATIENCE_S) as plain, \
                trust(station.tls_certificate).wrap_socket(plain) as client:
            key = base64.b64encode(os.urandom(16)).decode()
            client.sendall((f"GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
                            f"Authorization: Bearer {station.token}\r\n\r\n").encode())
            received = b""
            while b'"type":"welcome"' not in received:
                received += client.recv(4096)
            self.assertTrue(received.startswith(b"HTTP/1.1 101 "), received[:100])

    def test_the_token_goes_to_no_other_program_on_the_port(self):
        with lab() as place, lab() as other:
            station, _ = self.secure_lab(place)
            self.make_certificate(other)
            endpoints = dict(station.endpoints, tls_certificate=str(other.data / "tls" / "station.crt"))
            (place.data / "endpoints.json").write_text(json.dumps(endpoints))
            copied = place.tool("backup", "--data", place.data, "--to", place.folder / "copy.sqlite")
            self.assertEqual(copied.returncode, 1)
            self.assertIn("its key is not that of", copied.stderr)

    def test_an_address_that_others_reach_needs_tls_or_a_clear_word(self):
        with lab() as place:
            for flags in (("--http", "0.0.0.0:0"), ("--robots", "0.0.0.0:0"), ("--robots", "[::]:0")):
                refused = place.tool("serve", "--data", place.data, *flags)
                self.assertEqual(refused.returncode, 1)
                self.assertRegex(refused.stderr, r"^rheonaut: [^\n]*rheonaut certificate[^\n]*tls\.insecure[^\n]*\n$")
            self.assertFalse((place.data / "station.sqlite").exists(), "it has touched nothing")


if __name__ == "__main__":
    unittest.main()
