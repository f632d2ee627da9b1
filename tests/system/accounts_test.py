"""Users, tokens and robots of a real station: by its API, by the command line with and without it, over a restart."""
import base64
import http.client
import json
import os
import pty
import select
import socket
import subprocess
import unittest

from processes import BIN, lab, stopped, wait_until

PASSWORD = "correct horse battery"


def cli(place, *arguments, text=""):
    """One `rheonaut` command; returns (exit status, output, errors)."""
    done = subprocess.run([str(BIN / "rheonaut"), *map(str, arguments), "--data", str(place.data)], input=text,
                          capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout, done.stderr


class Page:
    """What a browser does: signs in, keeps its cookie, says where it comes from."""

    def __init__(self, station, cookie=""):
        self.host = station.endpoints["http"]
        self.cookie = cookie

    def ask(self, method, path, body=None):
        host, port = self.host.split(":")
        connection = http.client.HTTPConnection(host, int(port), timeout=60)
        headers = {"Origin": f"http://{self.host}", "Cookie": self.cookie}
        if body is not None:
            headers["Content-Type"] = "application/json"
        try:
            connection.request(method, path, None if body is None else json.dumps(body), headers)
            answer = connection.getresponse()
            content = answer.read()
            set_cookie = answer.getheader("Set-Cookie")
            if set_cookie:
                self.cookie = set_cookie.split(";")[0]
            return answer.status, json.loads(content or b"{}")
        finally:
            connection.close()

    def log_in(self, user, password=PASSWORD):
        return self.ask("POST", "/api/v1/login", {"user": user, "password": password})

    def open_live(self):
        """A WebSocket on /live, past its handshake."""
        host, port = self.host.split(":")
        connection = socket.create_connection((host, int(port)), timeout=60)
        key = base64.b64encode(os.urandom(16)).decode()
        connection.sendall(f"GET /live HTTP/1.1\r\nHost: {self.host}\r\nOrigin: http://{self.host}\r\nCookie: "
                           f"{self.cookie}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                           f"Sec-WebSocket-Key: {key}\r\n\r\n".encode())
        first = connection.recv(4096)
        assert first.startswith(b"HTTP/1.1 101"), first
        return connection


def ends(connection, timeout_s=60):
    """True when the other side closes; what it says until then is passed over."""
    connection.settimeout(timeout_s)
    try:
        while connection.recv(65536):
            pass
        return True
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False
    finally:
        connection.close()


class AccountsTest(unittest.TestCase):
    def test_a_user_over_a_restart(self):
        with lab() as place:
            station = place.start_station()
            status, out, err = cli(place, "user", "add", "anna", "--role", "operator", text=PASSWORD + "\n")
            self.assertEqual((status, out, err), (0, "User anna was added\n", ""))
            page = Page(station)
            self.assertEqual(page.log_in("anna", "wrong")[0], 401)
            self.assertEqual(page.log_in("anna"), (200, {"actor": "user:anna/session:1", "user": "anna",
                                                         "role": "operator", "scopes": "read,stop,record,command"}))
            store_id = int(station.get("/api/v1/station")["store_id"])
            self.assertTrue(page.cookie.startswith(f"rheonaut_session_{store_id:016x}="), page.cookie)
            status, problem = page.ask("GET", "/api/v1/users")
            self.assertEqual((status, problem["needs"]), (403, "admin"))
            wait_until(lambda: station.get("/api/v1/sessions")["sessions"], 60, "the session is stored")
            self.assertEqual(place.stop_station(), 0)

            # Without a station: the database itself.
            status, out, _ = cli(place, "user", "list", "--json")
            self.assertEqual([(user["name"], user["role"]) for user in json.loads(out)], [("anna", "operator")])
            self.assertEqual(cli(place, "user", "role", "anna", "viewer")[0], 0)
            again = place.start_station()
            page.host = again.endpoints["http"]
            status, me = page.ask("GET", "/api/v1/me")
            self.assertEqual((status, me.get("role")), (200, "viewer"), me)

            # With it: what is open ends.
            live = page.open_live()
            self.assertEqual(cli(place, "user", "password", "anna", text="another password\n")[0], 0)
            self.assertTrue(ends(live))
            self.assertEqual(page.ask("GET", "/api/v1/me")[0], 401)
            self.assertEqual(page.log_in("anna")[0], 401)
            self.assertEqual(page.log_in("anna", "another password")[0], 200)
            live = page.open_live()
            self.assertEqual(cli(place, "user", "remove", "anna")[0], 0)
            self.assertTrue(ends(live))
            self.assertEqual(page.log_in("anna", "another password")[0], 401)
            content = b"".join(path.read_bytes() for path in place.data.glob("station.sqlite*"))
            self.assertNotIn(PASSWORD.encode(), content)
            self.assertNotIn(PASSWORD, place.log("station"))

    def test_a_token_and_what_it_may_do(self):
        with lab() as place:
            self.assertEqual(cli(place, "token", "create", "early", "--scopes", "read")[0], 0, "before the first start")
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            local = station.token
            status, out, err = cli(place, "token", "create", "button", "--scopes", "read,stop", "--days", 2)
            self.assertEqual((status, err), (0, ""))
            station.token = out.strip()
            self.assertEqual(station.get("/api/v1/me")["actor"], "token:button")
            command = json.loads(station.request("POST", "/api/v1/robots/sim-1/commands", {"kind": "ping"})[2])
            self.assertEqual((command["status"], command["needs"]), (403, "operator"))
            stopped(station)
            self.assertEqual(station.request("POST", "/api/v1/login-links")[0], 403)
            listed = cli(place, "token", "list")[1]
            self.assertIn("button", listed)
            self.assertIn("early", listed)
            self.assertNotIn(station.token, listed)
            self.assertEqual(cli(place, "token", "revoke", "button")[0], 0)
            self.assertEqual(station.request("GET", "/api/v1/me")[0], 401)
            station.token = local
            self.assertEqual(station.get("/api/v1/me")["actor"], "token:local")
            self.assertEqual(place.stop_station(), 0)
            self.assertEqual(cli(place, "token", "revoke", "early")[0], 0)
            self.assertIn("revoked", cli(place, "token", "list")[1])

    def test_a_robot_is_enrolled_refused_and_revoked(self):
        with lab() as place:
            status, out, err = cli(place, "robot", "enrol", "rheo-1")
            self.assertEqual((status, err), (0, ""))
            token = out.split("shown only now:\n\n  ")[1].split("\n")[0]
            self.assertIn(f'"{token}",', out)
            self.assertEqual(cli(place, "robot", "enroll", "rheo-1")[0], 1, "it has a token")
            station = place.start_station()

            place.start_robot(station, "rheo-1", "--token", "x" * 43)
            refused = wait_until(lambda: [event for event in station.get("/api/v1/robots/rheo-1/events")["events"]
                                          if event["kind"] == "connection_refused"], 60, "an event of the wrong token")
            self.assertIn("wrong_token", refused[0]["detail"])
            self.assertEqual(station.robot("rheo-1")["link"], "disconnected")
            place.processes[-1].terminate()
            place.processes[-1].wait()

            place.start_robot(station, "rheo-1", "--token", token)
            station.wait_for_robot("rheo-1")
            self.assertEqual(cli(place, "robot", "revoke", "rheo-1")[0], 0)
            wait_until(lambda: station.robot("rheo-1")["link"] == "disconnected", 60, "the connection ends")
            wait_until(lambda: [event for event in station.get("/api/v1/robots/rheo-1/events")["events"]
                                if "was revoked" in event["detail"]], 60, "an event of the refusal")
            self.assertIn("revoked", cli(place, "robot", "list")[1])
            self.assertEqual(station.robot("rheo-1")["link"], "disconnected")

            made = json.loads(cli(place, "robot", "enrol", "rheo-1", "--json")[1])
            self.assertNotEqual(made["secret"], token)
            place.processes[-1].terminate()
            place.processes[-1].wait()
            place.start_robot(station, "rheo-1", "--token", made["secret"])
            station.wait_for_robot("rheo-1")

    def test_a_robot_is_retired_with_and_without_a_station(self):
        with lab() as place:
            self.assertEqual(cli(place, "robot", "enrol", "rheo-1")[0], 0)
            self.assertEqual(cli(place, "robot", "retire", "rheo-1")[1], "Robot rheo-1 was retired\n")
            station = place.start_station()
            self.assertTrue(station.robot("rheo-1")["retired"])
            self.assertIn(", retired ", cli(place, "robot", "list")[1])
            self.assertEqual(cli(place, "robot", "unretire", "rheo-1")[1], "Robot rheo-1 was put back into use\n")
            self.assertFalse(station.robot("rheo-1")["retired"])
            self.assertEqual(cli(place, "robot", "retire", "rheo-1")[0], 0)
            self.assertTrue(station.robot("rheo-1")["retired"])
            self.assertEqual(place.stop_station(), 0)
            self.assertTrue(place.start_station().robot("rheo-1")["retired"], "a restart does not change it")

    def test_mistakes_are_told_in_a_line(self):
        with lab() as place:
            self.assertIn("there is no '", cli(place, "user", "list")[2])
            self.assertFalse(place.data.exists(), "and nothing was made")
            cases = [
                (("user", "add", "Anna", "--role", "viewer"), PASSWORD, "is not 1 to 31 characters"),
                (("user", "add", "anna", "--role", "viewer"), "short", "the password has 5 bytes"),
                (("user", "add", "anna", "--role", "viewer"), "", "no password was given"),
                (("user", "add", "anna", "--role", "viewer"), "x" * 70000, "the line of the password on standard input has more than 65536 bytes"),
                (("user", "add", "anna", "--role", "boss"), PASSWORD, "must be one of viewer, operator, admin"),
                (("token", "create", "x", "--scopes", "root"), "", "scope 'root' is none of"),
                (("token", "create", "local"), "", "the station's own token"),
                (("robot", "enrol", "Rheo 1"), "", "must be 1 to 31 characters"),
            ]
            for arguments, text, expected in cases:
                with self.subTest(arguments=arguments):
                    status, out, err = cli(place, *arguments, text=text)
                    self.assertNotEqual(status, 0)
                    self.assertEqual(out, "")
                    self.assertRegex(err, r"^rheonaut: [^\n]*\n$")
                    self.assertIn(expected, err)
            self.assertEqual(cli(place, "user", "add", "anna", "--role", "viewer", text=PASSWORD)[0], 0)
            station = place.start_station()
            for command in (("user", "remove", "otto"), ("token", "revoke", "x"), ("robot", "revoke", "r9"),
                            ("robot", "retire", "r9"), ("robot", "unretire", "r9")):
                with self.subTest(command=command):
                    status, _, err = cli(place, *command)
                    self.assertEqual(status, 1)
                    self.assertRegex(err, r"^rheonaut: there is no [^\n]*\n$")
            del station

    def test_a_password_is_typed_unseen_and_twice(self):
        with lab() as place:
            self.assertIn("was added", self.type_password(place, "anna", PASSWORD, PASSWORD))
            shown = self.type_password(place, "otto", PASSWORD, "something else")
            self.assertIn("the two passwords differ", shown)
            self.assertNotIn(PASSWORD, shown)
            self.assertIn("anna", cli(place, "user", "list")[1])
            self.assertNotIn("otto", cli(place, "user", "list")[1])

    def type_password(self, place, user, first, second):
        """Adds a user at a terminal; returns all that the terminal showed."""
        command = [str(BIN / "rheonaut"), "user", "add", user, "--role", "viewer", "--data", str(place.data)]
        pid, terminal = pty.fork()
        if pid == 0:
            os.execv(command[0], command)
        shown = b""
        for question, answer in ((b"Password of", first), (b"The same again", second)):
            while question not in shown:
                shown += self.read_some(terminal)
            while not shown.endswith(b": "):
                shown += self.read_some(terminal)
            os.write(terminal, answer.encode() + b"\n")
        while piece := self.read_some(terminal):
            shown += piece
        os.waitpid(pid, 0)
        os.close(terminal)
        self.assertNotIn(first.encode(), shown)
        return shown.decode()

    def read_some(self, terminal):
        self.assertTrue(select.select([terminal], [], [], 60)[0], "the program says nothing")
        try:
            return os.read(terminal, 4096)
        except OSError:  # its end
            return b""


if __name__ == "__main__":
    unittest.main()
