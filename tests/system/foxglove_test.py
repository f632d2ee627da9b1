"""A real station and simulated robots, watched by @foxglove/ws-protocol: what arrives live is what a file and the API say
later; without a ticket nobody is let in; and nothing can be changed."""
import json
import queue
import subprocess
import pathlib
import threading
import time
import unittest
import urllib.error
import urllib.request

from export_test import read_mcap
from processes import PATIENT, commanded, lab, wait_until

ON = PATIENT + "[foxglove]\nenabled = true\n"
OF_A_RUN = ("span", "t_s", "gap_before", "gap_after", "missed_ticks_before")
OF_A_SEGMENT = ("first_received_at_us", "received_at_us", "clock_uncertainty_us", "utc_us")


class Client:
    """foxglove_client.mjs with a link."""

    def __init__(self, url, origin="https://app.foxglove.dev", protocol=""):
        script = pathlib.Path(__file__).with_name("foxglove_client.mjs")
        self.process = subprocess.Popen(["node", script, url, origin, protocol], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self.lines = queue.Queue()
        self.messages = {}  # of channels, by topic
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(json.loads(line))
        self.lines.put({"what": "end"})

    def next(self, what, timeout_s=60):
        """The next thing of this kind; messages of channels are kept on the way."""
        deadline = time.monotonic() + timeout_s
        while True:
            found = self.lines.get(timeout=max(0.01, deadline - time.monotonic()))
            if found["what"] == "message":
                self.messages.setdefault(found["topic"], []).append((int(found["timestamp"]), json.loads(found["text"])))
            if found["what"] == what:
                return found
            if found["what"] == "end":
                raise AssertionError(f"the client ended before {what}")

    def say(self, **what):
        self.process.stdin.write(json.dumps(what) + "\n")
        self.process.stdin.flush()

    def until(self, condition):
        while not condition(self.messages):
            self.next("message")

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


class FoxgloveTest(unittest.TestCase):
    def client(self, *arguments):
        client = Client(*arguments)
        self.addCleanup(client.close)
        return client

    def link(self, station, **body):
        return station.post("/api/v1/foxglove-links", body)["url"]

    def test_what_is_seen_live_is_what_a_file_and_the_api_say(self):
        with lab(config=ON) as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            client = self.client(self.link(station, robot_id="sim-1"))
            self.assertEqual(client.next("serverInfo")["capabilities"], [])
            client.next("advertise")
            channels = {each["topic"]: each for each in client.next("advertise")["channels"]}
            self.assertEqual(set(channels), {"/telemetry", "/event", "/command"})
            run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "watched"})["run_id"]
            for topic in channels:
                client.say(subscribe=topic)
            client.until(lambda seen: len(seen.get("/telemetry", [])) > 10)
            commanded(station, "set_mode", mode="auto", setpoint_m=0.02)
            client.until(lambda seen: len(seen["/telemetry"]) > 300 and any(
                values["state"] == "verified" for _, values in seen.get("/command", [])))
            client.say(unsubscribe="/telemetry")
            last = max(values["seq"] for _, values in client.messages["/telemetry"])
            wait_until(lambda: station.robot("sim-1")["durable_next_seq"] > last + 50, 60, "later samples")
            station.post(f"/api/v1/runs/{run}/end", {})
            client.say(close=True)
            client.next("close")

            path = place.folder / "run.mcap"
            status, _, content = station.request("GET", f"/api/v1/runs/{run}/samples.mcap", timeout_s=90)
            self.assertEqual(status, 200)
            path.write_bytes(content)
            stored = read_mcap(path)["channels"]
            self.compare_channels(channels, stored)
            self.compare_samples(client.messages["/telemetry"], stored["/telemetry"], station)
            self.compare_rows(client.messages["/event"], stored["/event"], "event_seq")
            self.compare_rows(client.messages["/command"], stored["/command"], "command_id")

    def compare_channels(self, live, stored):
        for topic, channel in live.items():
            other = stored[topic]
            self.assertEqual((channel["encoding"], channel["schemaEncoding"], channel["schemaName"]),
                             (other["encoding"], other["schema_encoding"], other["schema_name"]))
            schema = json.loads(channel["schema"])
            if topic == "/event":
                del other["schema"]["properties"]["event_row"]  # only the database knows it
            self.assertEqual(schema, other["schema"], topic)

    def compare_samples(self, live, stored, station):
        by_seq = {message["sequence"]: json.loads(message["text"]) for message in stored["messages"]}
        of_api = {sample["seq"]: sample for sample in station.get("/api/v1/robots/sim-1/samples?limit=10000")["samples"]}
        compared = 0
        for timestamp, values in live:
            self.assertEqual(timestamp, 1000 * values["utc_us"])
            self.assertIn("position_sd_m", values, "a believed position has its ±")
            seq = values["seq"]
            for name in ("position_m", "velocity_m_s", "duty", "position_sd_m", "robot_time_us", "mode"):
                self.assertEqual(values[name], of_api[seq][name], name)
            if seq not in by_seq:  # before the run began
                continue
            expected = by_seq[seq]
            doubt_us = expected["clock_uncertainty_us"] + values["clock_uncertainty_us"]  # more where the machine stood still
            self.assertLessEqual(abs(expected["utc_us"] - values["utc_us"]), 10_000 + doubt_us)
            for name in OF_A_RUN + OF_A_SEGMENT:
                self.assertIn(name, expected)
                del expected[name]
                self.assertEqual(values.pop(name, None) is None, name in OF_A_RUN, name)
            self.assertEqual(values, expected)
            compared += 1
        self.assertGreater(compared, 200)

    def compare_rows(self, live, stored, key):
        rows = {values[key]: values for values in (json.loads(message["text"]) for message in stored["messages"])
                if key in values}
        newest = {values[key]: values for _, values in live if key in values}
        self.assertGreater(len(newest), 0)
        for name, values in newest.items():
            rows[name].pop("event_row", None)
            self.assertEqual(values, rows[name])

    def test_who_is_let_in_and_what_a_client_cannot_do(self):
        with lab(config=ON) as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            url = self.link(station)
            wrong = self.client(url, "", "foxglove.websocket.v0").next("refused")
            self.assertEqual((wrong["status"], wrong["reason"]), (400, "unknown_protocol"))
            ticket = url.partition("ticket=")[2]
            self.assertEqual(self.client(url.partition("?")[0]).next("refused")["status"], 401)
            live = url.replace("/foxglove?", "/live?")
            self.assertIn(self.client(live).next("refused")["status"], (401, 403))
            request = urllib.request.Request(f"http://{station.endpoints['http']}/api/v1/robots",
                                             headers={"Authorization": f"Bearer {ticket}"})
            with self.assertRaises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request, timeout=60)
            refused.exception.close()
            self.assertEqual(refused.exception.code, 401)

            client = self.client(url)
            self.assertEqual(client.next("open")["protocol"], "foxglove.websocket.v1")
            used = self.client(url).next("refused")
            self.assertEqual((used["status"], used["reason"]), (401, "bad_ticket"))
            client.next("advertise")
            topics = [each["topic"] for each in client.next("advertise")["channels"]]
            self.assertEqual(topics, ["/sim-1/telemetry", "/sim-1/event", "/sim-1/command"])
            checksum = station.robot("sim-1")["parameters_checksum"]
            for attempt in ({"advertise": {"topic": "/duty", "encoding": "json", "schemaName": "x"}}, {"publish": "{}"},
                            {"call": 1}, {"parameters": [{"name": "duty", "value": 1}]}, {"text": "]"}, {"bytes": "AAAA"}):
                client.say(**attempt)
                self.assertEqual(client.next("status")["level"], 2, attempt)
            self.assertEqual(station.robot("sim-1")["parameters_checksum"], checksum)
            self.assertEqual(station.robot("sim-1")["control"], None)

            second = place.start_robot(station, "sim-2")
            self.assertEqual(client.next("advertise")["channels"][0]["topic"], "/sim-2/telemetry")
            second.terminate()
            second.wait(timeout=60)
            wait_until(lambda: station.robot("sim-2")["link"] == "disconnected", 60, "the end of the link")
            station.post("/api/v1/robots/sim-2/retire", {"retired": True})
            self.assertEqual(client.next("unadvertise")["topics"][0], "/sim-2/telemetry")
            self.assertNotIn(ticket, place.log("station"), "a ticket is never logged")

    def test_it_is_off_as_it_comes(self):
        with lab() as place:
            station = place.start_station()
            for method, path in (("POST", "/api/v1/foxglove-links"), ("GET", "/foxglove?ticket=x")):
                status, _, content = station.request(method, path)
                self.assertEqual((status, json.loads(content)["reason"]), (404, "foxglove_off"))
                self.assertIn("[foxglove]", json.loads(content)["detail"])
            refused = self.client(f"ws://{station.endpoints['http']}/foxglove?ticket=x").next("refused")
            self.assertEqual((refused["status"], refused["reason"]), (404, "foxglove_off"))


if __name__ == "__main__":
    unittest.main()
