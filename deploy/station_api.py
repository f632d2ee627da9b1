"""Talks to a running station: where it listens, its token, and JSON over HTTP or HTTPS. Standard library only."""
import json
import pathlib
import secrets
import ssl
import time
import urllib.error
import urllib.request


class ApiError(Exception):
    """A refusal of the station: status, reason for programs, detail for people."""

    def __init__(self, status, problem):
        self.status = status
        self.reason = problem.get("reason", "")
        self.problem = problem
        super().__init__(f"{status} {self.reason}: {problem.get('detail', problem)}")


def wait_until(condition, timeout_s, what):
    """Asks until the condition gives something; TimeoutError names what never came."""
    deadline = time.monotonic() + timeout_s
    while True:
        found = condition()
        if found:
            return found
        if time.monotonic() > deadline:
            raise TimeoutError(f"{what}: not within {timeout_s} s")
        time.sleep(0.05)


def trust(certificate):
    """Trusts exactly this certificate, whatever the address by which the station is asked."""
    context = ssl.create_default_context(cafile=certificate)
    context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    context.check_hostname = False
    return context


class Station:
    """The API of the station that keeps its things in `data_dir`."""

    def __init__(self, data_dir, timeout_s=15, endpoints=None):
        self.data_dir = pathlib.Path(data_dir)
        if endpoints is None:  # as the station announces them
            wait_until((self.data_dir / "endpoints.json").exists, timeout_s, f"endpoints.json in {data_dir}")
            endpoints = json.loads((self.data_dir / "endpoints.json").read_text())
        self.endpoints = endpoints
        self.token = (self.data_dir / "rheonaut.token").read_text().strip()
        self.database = self.data_dir / "station.sqlite"
        self.tls_certificate = endpoints.get("tls_certificate")  # none: plain HTTP
        self.client = secrets.token_hex(8)  # by which the station knows this object: its signs of life are its own

    def request(self, method, path, body=None, timeout_s=20):
        """The raw answer: (status, headers, bytes)."""
        scheme = "https" if self.tls_certificate else "http"
        request = urllib.request.Request(f"{scheme}://{self.endpoints['http']}{path}", method=method)
        request.add_header("Authorization", f"Bearer {self.token}")
        request.add_header("Rheonaut-Client", self.client)
        if body is not None:
            request.add_header("Content-Type", "application/json")
            request.data = json.dumps(body).encode()
        try:
            context = trust(self.tls_certificate) if self.tls_certificate else None
            with urllib.request.urlopen(request, timeout=timeout_s, context=context) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.headers, error.read()

    def _json(self, method, path, body=None):
        status, _, content = self.request(method, path, body)
        answer = json.loads(content or b"{}")
        if status >= 400:
            raise ApiError(status, answer)
        return answer

    def get(self, path):
        return self._json("GET", path)

    def post(self, path, body=None):
        return self._json("POST", path, body)

    def robot(self, robot_id):
        return self.get(f"/api/v1/robots/{robot_id}")

    def robots(self):
        return self.get("/api/v1/robots")["robots"]

    def command(self, robot_id, kind, **arguments):
        return self.post(f"/api/v1/robots/{robot_id}/commands", {"kind": kind, **arguments})

    def wait_for_robot(self, robot_id, timeout_s=15):
        """The robot's state once it is connected and has sent a sample."""
        def connected():
            found = [robot for robot in self.robots() if robot["robot_id"] == robot_id]
            return found and found[0]["link"] == "connected" and found[0]["sample"] and found[0]
        return wait_until(connected, timeout_s, f"robot '{robot_id}' connected")
