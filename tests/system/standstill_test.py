"""A station that is halted for 1.5 s: what waited in its sockets moves no robot, and a stop is obeyed. Real processes."""
import json
import pathlib
import signal
import socket
import time
import unittest

from hostile_clients import post
from processes import lab, wait_until

HALT_S = 1.5  # time has to pass: this is what is tested
COMMANDS = "/api/v1/robots/sim-1/commands"
DUTY = json.dumps({"kind": "set_duty", "duty": 0.5, "life_ms": 500}).encode()
LASTING_DUTY = json.dumps({"kind": "set_duty", "duty": 0.5, "life_ms": 10_000}).encode()  # a busy machine may be late


class StandstillTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab())
        self.station = self.place.start_station()  # the robot's link outlives the halt
        self.place.start_robot(self.station, "sim-1", "--sensor", "perfect")
        self.station.wait_for_robot("sim-1")

    def dial(self):
        host, port = self.station.endpoints["http"].rsplit(":", 1)
        client = socket.create_connection((host, int(port)), timeout=60)
        self.addCleanup(client.close)
        return client

    @staticmethod
    def answer(client):
        """Status and body of the next answer."""
        said = b""
        while b"\r\n\r\n" not in said:
            said += client.recv(65536)
        head, body = said.split(b"\r\n\r\n", 1)
        length = next(int(line.split(b":")[1]) for line in head.split(b"\r\n") if line.lower().startswith(b"content-length"))
        while len(body) < length:
            body += client.recv(65536)
        return int(head.split()[1]), json.loads(body)

    def send_during_a_halt(self, *requests):
        """Each by its client, which was connected before, or (None) dials while nobody listens. Their answers."""
        process = self.place.station_process
        process.send_signal(signal.SIGSTOP)
        try:
            stat = pathlib.Path(f"/proc/{process.pid}/stat")
            wait_until(lambda: stat.read_text().rsplit(")", 1)[1].split()[0] == "T", 60, "the station halted")
            clients = []
            for client, request in requests:
                clients.append(client or self.dial())
                clients[-1].sendall(request)
            time.sleep(HALT_S)
        finally:
            process.send_signal(signal.SIGCONT)
        return [self.answer(client) for client in clients]

    def duties(self, run_id):
        rows = self.station.get(f"/api/v1/runs/{run_id}/samples?limit=10000")["samples"]
        return {row["duty"] for row in rows}

    def test_what_waited_moves_nothing_and_what_comes_then_does(self):
        known = self.dial()
        known.sendall(post(COMMANDS, b'{"kind":"ping"}', self.station.token))
        self.assertEqual(self.answer(known)[0], 200)
        run_id = self.station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "halt"})["run_id"]
        command = post(COMMANDS, DUTY, self.station.token)
        for status, said in self.send_during_a_halt((known, command), (None, command)):
            self.assertEqual((status, said["reason"]), (504, "too_old_on_arrival"), said)
        robot = self.station.robot("sim-1")
        self.assertIsNone(robot["control"], "nobody took control by it")
        wait_until(lambda: self.station.robot("sim-1")["next_seq"] > robot["next_seq"] + 50, 60, "samples")
        self.station.post(f"/api/v1/runs/{run_id}/end")
        self.assertEqual(self.duties(run_id), {0.0})
        self.assertIn("stood still for", self.place.log("station"))

        def is_taken():
            known.sendall(post(COMMANDS, LASTING_DUTY, self.station.token))
            status, said = self.answer(known)
            if status == 504:  # the machine itself stood still
                return None
            self.assertEqual((status, said["kind"]), (200, "set_duty"), said)
            return True
        wait_until(is_taken, 60, "a command that is not old")

    def test_a_stop_that_waited_is_obeyed(self):
        stop = post("/api/v1/emergency-stop", b"why=halted", self.station.token)
        (status, said), = self.send_during_a_halt((None, stop))
        self.assertEqual(status, 200, said)
        wait_until(lambda: self.station.robot("sim-1")["emergency_id"], 60, "the latch")


if __name__ == "__main__":
    unittest.main()
