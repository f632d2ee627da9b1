"""The audit of a real station: commands, refusals, a kill -9, tools without a station; and everything done to it is found."""
import json
import os
import pwd
import sqlite3
import unittest

from processes import ApiError, cleared, commanded, lab, stopped, wait_until


class AuditTest(unittest.TestCase):
    def verify(self, place, *flags, file=None):
        source = ["--data", place.data] if file is None else ["--file", file]
        done = place.tool("verify", "--audit", "--json", *source, *flags)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        found = json.loads(done.stdout)
        self.assertEqual(done.returncode, 1 if found["faults"] else 0)
        return found

    def assert_whole(self, place, *flags, file=None):
        found = self.verify(place, *flags, file=file)
        self.assertEqual(found["faults"], [])
        return found

    def refused(self, station, kind, **arguments):
        with self.assertRaises(ApiError):
            commanded(station, kind, **arguments)

    def drive(self, station):
        """A command of each kind, a stop and its clear."""
        commanded(station, "ping")
        commanded(station, "zero_position")
        self.drive_under_lease(station)
        commanded(station, "set_mode", mode="auto", setpoint_m=0.05)
        commanded(station, "set_setpoint", setpoint_m=0.02)
        commanded(station, "inject_disturbance", disturbance_m=0.001)
        self.refused(station, "set_setpoint", setpoint_m=1e6)
        stop = stopped(station)
        wait_until(lambda: station.get(f"/api/v1/commands/{stop['command_id']}")["state"] == "verified", 60,
                   "the stop is seen in telemetry")
        self.refused(station, "set_duty", duty=0.2)
        cleared(station, stop["emergency_id"])
        newest = lambda: station.get("/api/v1/robots/sim-1/commands?limit=1")["commands"][0]
        wait_until(lambda: newest()["ended_at_us"], 60, "the clear's end")
        return stop

    def drive_under_lease(self, station):
        """A duty and its renewal; both again where a machine that stood still has let the lease lapse."""
        while True:
            commanded(station, "set_duty", duty=0.2)
            try:
                return commanded(station, "renew_lease")
            except ApiError as error:
                self.assertEqual(error.reason, "nothing_to_renew")

    def entries(self, station, query=""):
        return station.get(f"/api/v1/audit?limit=1000{query}")["entries"]

    def test_everything_is_in_it_over_a_kill_and_what_is_changed_is_found(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "audited"})["run_id"]
            stop = self.drive(station)
            by_action = {}
            for entry in self.entries(station):
                by_action.setdefault(entry["action"], []).append(entry)
                if entry["action"].startswith(("command.", "run.")):
                    self.assertEqual((entry["actor"], entry["peer"]), ("token:local", "127.0.0.1"), entry)
            kinds = {entry["detail"]["kind"] for entry in self.entries(station, "&action=command")
                     if entry["detail"].get("ended_at_us")}
            self.assertEqual(kinds, {"ping", "zero_position", "set_duty", "renew_lease", "set_mode", "set_setpoint",
                                     "inject_disturbance", "emergency_stop", "clear_emergency"})
            refused = {entry["detail"].get("reason") for entry in by_action["command.refused"]}
            self.assertEqual(refused - {"too_old_on_arrival"}, {"out_of_range", "latched"})  # the third: the machine stood still
            verified = [entry for entry in by_action["command.verified"] if entry["subject"] == stop["command_id"]][0]
            times = [verified["detail"][f"{stage}_after_us"] for stage in ("sent", "acknowledged", "verified")]
            self.assertEqual(times, sorted(times))
            self.assertIn("robot.enrolled", by_action)
            self.assertEqual(by_action["run.made"][0]["subject"], str(run_id))
            beside = self.assert_whole(place)  # beside the running station
            self.assertGreaterEqual(beside["audit_commands"], 9)
            head = station.get("/api/v1/audit?limit=1")["head"]
            self.assert_whole(place, "--expect", head)

            place.kill_station()
            killed = self.assert_whole(place, "--expect", head)
            station = place.start_station(robots=station.endpoints["robots"])
            self.assertIn(f"audit: goes on from {killed['audit_head']}", place.log("station"))
            self.assertEqual(station.get(f"/api/v1/runs/{run_id}")["state"], "interrupted")
            wait_until(lambda: self.entries(station, "&action=run.interrupted"), 60, "the interrupted run")
            station.wait_for_robot("sim-1")
            run = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "exported"})["run_id"]
            self.drive(station)
            station.post(f"/api/v1/runs/{run}/end")
            self.exported(place, station, run)
            self.assertEqual(place.stop_station(), 0)
            at_the_end = self.assert_whole(place, "--expect", head)
            self.assertIn(f"audit: ends with {at_the_end['audit_head']}", place.log("station"))
            self.tools(place)
            self.tampering(place)

    def exported(self, place, station, run):
        file = place.folder / "run.sqlite"
        status, _, content = station.request("GET", f"/api/v1/runs/{run}/samples.sqlite")
        self.assertEqual(status, 200)
        file.write_bytes(content)
        found = self.assert_whole(place, file=file)
        self.assertGreater(found["audit_entries"], 9)
        self.assert_whole(place, "--expect", found["audit_head"])
        self.assertIn("--audit verifies", place.tool("verify", "--file", file).stderr)
        other = place.folder / "run-2.sqlite"
        self.assertEqual(place.tool("export", "--run", run, "--format", "sqlite", "--to", other, "--data",
                                    place.data).returncode, 0)
        self.assertEqual(self.assert_whole(place, file=other)["audit_head"], found["audit_head"])
        with sqlite3.connect(other) as connection:
            connection.execute("UPDATE audit SET detail = replace(detail, '0.02', '0.03')")
        connection.close()
        self.assertRegex(self.verify(place, file=other)["faults"][0], r"entry \d+ was changed")

    def tools(self, place):
        """Without a station: the tool's own user is the actor."""
        self.assertEqual(place.tool("robot", "enrol", "rheo-9", "--data", place.data).returncode, 0)
        self.assertEqual(place.tool("robot", "revoke", "rheo-9", "--data", place.data).returncode, 0)
        with sqlite3.connect(f"file:{place.data / 'station.sqlite'}?mode=ro", uri=True) as connection:
            latest = connection.execute("SELECT actor, action, robot_id FROM audit ORDER BY entry DESC LIMIT 2").fetchall()
        connection.close()
        actor = f"cli:{pwd.getpwuid(os.geteuid()).pw_name}"
        self.assertEqual(latest, [(actor, "robot.revoked", "rheo-9"), (actor, "robot.enrolled", "rheo-9")])
        self.assert_whole(place)
        restored = place.folder / "restored"
        backup = place.folder / "backup.sqlite"
        self.assertEqual(place.tool("backup", "--to", backup, "--data", place.data).returncode, 0)
        self.assertEqual(place.tool("restore", "--from", backup, "--data", restored).returncode, 0)
        done = place.tool("verify", "--audit", "--data", restored)
        self.assertEqual((done.returncode, done.stderr), (0, ""), done.stdout)

    def tampering(self, place):
        database = place.data / "station.sqlite"
        head = self.assert_whole(place)["audit_head"]
        content = database.read_bytes()

        def after(*statements):
            database.write_bytes(content)
            connection = sqlite3.connect(database)
            for statement in ("DROP TRIGGER audit_unchanged", "DROP TRIGGER audit_kept", *statements):
                connection.execute(statement)
            connection.commit()
            connection.close()
            return self.verify(place, "--expect", head)["faults"]

        self.assertEqual(after(), [], "without its triggers it is as whole as with them")
        self.assertEqual(after("UPDATE audit SET actor = 'nobody' WHERE entry = 7"),
                         ["audit: entry 7 was changed: its content is not that of its content_hash"])
        self.assertRegex(after("DELETE FROM audit WHERE entry = 7")[0], "entry 7 is missing")
        cut = after("DELETE FROM audit WHERE entry > 7")
        self.assertRegex(cut[0], "the database has lost commits", "the head beside it says so")
        self.assertRegex("\n".join(cut[1:]), "ends with entry 7")
        self.assertRegex(after("UPDATE audit SET entry = -1 WHERE entry = 7", "UPDATE audit SET entry = 7 WHERE entry = 8",
                               "UPDATE audit SET entry = 8 WHERE entry = -1")[0], "entry 7 does not follow on entry 6")
        self.assertRegex(after("UPDATE command SET actor = 'nobody' WHERE kind = 'ping'")[0], "command .* does not say")
        whole = place.tool("verify", "--data", place.data)
        self.assertEqual(whole.returncode, 1, "without --audit, too")
        self.assertIn("fault: command", whole.stdout)
        database.write_bytes(content)
        connection = sqlite3.connect(database)
        with self.assertRaises(sqlite3.IntegrityError):
            connection.execute("UPDATE audit SET actor = 'nobody'")
        connection.close()
        for bad in ("7", "7:ab", "x"):
            refused = place.tool("verify", "--audit", "--data", place.data, "--expect", bad)
            self.assertNotEqual(refused.returncode, 0)
            self.assertRegex(refused.stderr, r"^rheonaut: [^\n]*ENTRY:HASH[^\n]*\n$")


if __name__ == "__main__":
    unittest.main()
