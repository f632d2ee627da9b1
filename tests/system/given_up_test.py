"""A robot loses its link with samples unsent and does not come back: its run is given up, and is final. When the robot comes
back all the same, the run's digest is what it was, and what it still held is counted. Real processes."""
import contextlib
import signal
import socket
import sqlite3
import threading
import unittest

from processes import PATIENCE_S, ApiError, lab, wait_until
from recording_audit import audit


class Relay:
    """Stands between robots and the station. `open`: carries everything; `hello`: of the robot only its first frame, so that
    the station knows what it has made and gets none of it; `shut`: nobody is let in."""

    def __init__(self, station_address):
        host, port = station_address.rsplit(":", 1)
        self.station = (host, int(port))
        self.mode = "open"
        self.sockets = []
        self.guard = threading.Lock()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.accept, daemon=True).start()

    def set(self, mode):
        """Ends what is carried; the next connection is as `mode` says."""
        with self.guard:
            self.mode = mode
            for one in self.sockets:
                with contextlib.suppress(OSError):
                    one.shutdown(socket.SHUT_RDWR)
            self.sockets.clear()

    def close(self):
        self.set("shut")
        with contextlib.suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()

    def accept(self):
        while True:
            try:
                robot, _ = self.listener.accept()
            except OSError:
                return
            with self.guard:
                if self.mode == "shut":
                    robot.close()
                    continue
                to_station = socket.create_connection(self.station)
                self.sockets += [robot, to_station]
                carry = self.carry if self.mode == "open" else self.carry_hello
            threading.Thread(target=carry, args=(robot, to_station), daemon=True).start()
            threading.Thread(target=self.carry, args=(to_station, robot), daemon=True).start()

    @staticmethod
    def carry(source, into):
        with contextlib.suppress(OSError):
            while chunk := source.recv(65536):
                into.sendall(chunk)
        with contextlib.suppress(OSError):
            into.shutdown(socket.SHUT_RDWR)

    @staticmethod
    def carry_hello(source, into):
        """A frame is its length, seven bits a byte, and that many bytes."""
        with contextlib.suppress(OSError):
            length = shift = 0
            head = b""
            while not head or head[-1] & 0x80:
                head += source.recv(1)
                length |= (head[-1] & 0x7F) << shift
                shift += 7
            into.sendall(head + source.recv(length, socket.MSG_WAITALL))
            while source.recv(65536):
                pass


class GivenUpTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab())
        self.station = self.place.start_station()
        self.relay = Relay(self.station.endpoints["robots"])
        self.addCleanup(self.relay.close)
        self.robot = self.place._start("sim-1", "rheonaut-sim", "--station", self.relay.address, "--id", "sim-1")
        self.station.wait_for_robot("sim-1", PATIENCE_S)

    def state(self):
        return self.station.robot("sim-1")

    def events(self, kind):
        found = self.station.get("/api/v1/robots/sim-1/events?limit=1000")["events"]
        return [event for event in found if event["kind"] == kind]

    def record_and_lose_robot(self):
        """Run 1, of which samples are missing. The robot stands still with them, and its link is gone."""
        self.station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "lost"})
        wait_until(lambda: self.state()["durable_next_seq"] > 100, PATIENCE_S, "samples on disk")
        self.relay.set("shut")
        wait_until(lambda: self.state()["link"] != "connected", PATIENCE_S, "the loss of the link")
        self.relay.set("hello")
        wait_until(lambda: len(self.events("connected")) >= 2, PATIENCE_S, "the robot's hello")
        self.robot.send_signal(signal.SIGSTOP)  # it makes no samples, so its ring does not run over
        self.addCleanup(self.robot.send_signal, signal.SIGCONT)
        self.relay.set("shut")
        wait_until(lambda: self.state()["link"] != "connected", PATIENCE_S, "the loss of the link")
        self.station.post("/api/v1/runs/1/end")

    def certificate(self):
        return self.station.get("/api/v1/runs/1/certificate")

    def come_back(self):
        self.relay.set("open")
        self.robot.send_signal(signal.SIGCONT)
        wait_until(lambda: self.events("given_up_samples_returned"), PATIENCE_S, "the event that counts them")

    def rows(self, sql):
        with contextlib.closing(sqlite3.connect(f"file:{self.station.database}?mode=ro", uri=True)) as database:
            return database.execute(sql).fetchall()

    def test_a_run_that_was_given_up_stays_what_it_was(self):
        self.record_and_lose_robot()
        missing = self.certificate()["samples_missing"]
        self.assertGreater(missing, 0)
        said = self.place.tool("run", "finalize", "1", "--data", self.place.data)
        self.assertEqual((said.returncode, said.stdout), (1, ""))
        self.assertIn(f"{missing} samples of run 1 are missing", said.stderr)
        with self.assertRaises(ApiError) as refused:
            self.station.post("/api/v1/runs/1/finalize", {"samples_missing": missing + 1})
        self.assertEqual(refused.exception.reason, "missing_changed")
        self.assertFalse(self.certificate()["final"])

        done = self.place.tool("run", "finalize", "1", "--samples", missing, "--data", self.place.data)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"Run 1 is final: {missing} samples were given up now", done.stdout)
        final = self.certificate()
        self.assertEqual((final["final"], final["lost_by_cause"]), (True, {"given_up": missing}))

        self.come_back()
        held = int(self.events("given_up_samples_returned")[0]["detail"].split()[0])
        self.assertTrue(0 < held <= missing, f"{held} of {missing}")
        newest = self.state()["durable_next_seq"]
        wait_until(lambda: self.state()["durable_next_seq"] > newest + 200, PATIENCE_S, "samples that it makes now")
        self.assertEqual(self.certificate(), final)
        counters = self.station.get("/api/v1/recording")["counters"]
        self.assertEqual((counters["samples_given_up"], counters["samples_returned"]), (missing, held))
        self.assertEqual(self.rows("SELECT sum(last_seq - first_seq + 1) FROM gap WHERE cause = 'given_up'"), [(missing,)])
        self.assertEqual(self.place.stop_station(), 0)
        self.assertEqual(audit(self.station.database)[0], [])
        verified = self.place.tool("verify", "--data", self.place.data)
        self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)

    def test_a_robot_that_is_revoked_makes_its_run_final(self):
        self.record_and_lose_robot()
        missing = self.certificate()["samples_missing"]
        done = self.place.tool("robot", "revoke", "sim-1", "--data", self.place.data)
        self.assertIn(f"{missing} samples that it has not sent are given up", done.stdout, done.stderr)
        wait_until(lambda: self.certificate()["final"], PATIENCE_S, "the run's digest")
        self.assertEqual(self.certificate()["lost_by_cause"], {"given_up": missing})


if __name__ == "__main__":
    unittest.main()
