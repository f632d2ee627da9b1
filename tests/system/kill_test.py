"""kill -9 of the station in mid-run: the run is interrupted, the robot comes back, and not one of its samples is missing."""
import json
import sqlite3
import subprocess
import unittest

from processes import BIN, commanded, lab, wait_until


def verify(*flags):
    return subprocess.run([str(BIN / "rheonaut"), "verify", *map(str, flags)], capture_output=True, text=True)


class KillTest(unittest.TestCase):
    def samples_of_run(self, database, run_id):
        with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
            return connection.execute(
                "SELECT boot_id, seq FROM run_sample WHERE run_id = ? ORDER BY span, seq", (run_id,)).fetchall()

    def test_no_sample_is_lost_when_the_station_is_killed_three_times(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            before = station.wait_for_robot("sim-1")
            commanded(station, "set_mode", mode="auto", setpoint_m=0.05)
            first = station.robot("sim-1")["next_seq"]
            ports = station.endpoints
            interrupted = []
            for _ in range(3):
                run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "kill"})["run_id"]
                interrupted.append(run_id)
                seen = station.robot("sim-1")["next_seq"]
                wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 70, 60, "70 more samples")
                place.kill_station()
                station = place.start_station(http=ports["http"], robots=ports["robots"])
                self.assertEqual(station.get(f"/api/v1/runs/{run_id}")["state"], "interrupted")
                after = station.wait_for_robot("sim-1")
                self.assertEqual(after["boot_id"], before["boot_id"], "the robot did not reboot")
            seen = station.robot("sim-1")["next_seq"]
            wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 100, 60, "100 more samples")

            last = station.robot("sim-1")["next_seq"] - 1
            run = station.post("/api/v1/runs", {
                "robot_id": "sim-1", "name": "all of it",
                "span": {"boot_id": before["boot_id"], "first_seq": first, "last_seq": last}})
            certificates = {}
            for run_id in [*interrupted, run["run_id"]]:
                wait_until(lambda: station.get(f"/api/v1/runs/{run_id}/certificate")["final"], 60, "the certificate")
                certificates[run_id] = station.get(f"/api/v1/runs/{run_id}/certificate")
                self.assertEqual(certificates[run_id]["samples_lost"], 0)
            self.assertEqual(certificates[run["run_id"]]["samples_expected"], last + 1 - first)
            rows = self.samples_of_run(station.database, run["run_id"])
            self.assertEqual([row[1] for row in rows], list(range(first, last + 1)), "contiguous")
            self.assertEqual({row[0] for row in rows}, {before["boot_id"]})
            self.assertGreater(len(rows), 300)

            beside = verify("--data", place.data, "--json")  # beside the running station
            self.assertEqual(beside.returncode, 0, beside.stdout)
            self.assertEqual(json.loads(beside.stdout)["runs_verified"], 4)
            self.assertFalse(json.loads(beside.stdout)["integrity_checked"])
            self.assertEqual(place.stop_station(), 0)
            alone = verify("--data", place.data, "--json")
            self.assertEqual(alone.returncode, 0, alone.stdout)
            self.assertTrue(json.loads(alone.stdout)["integrity_checked"])
            self.damage_is_found(place, run["run_id"])

    def damage_is_found(self, place, run_id):
        database = place.data / "station.sqlite"
        with sqlite3.connect(database) as connection:
            connection.execute("UPDATE sample SET position_m = position_m + 0.001 WHERE row = 5")
        connection.close()
        found = verify("--data", place.data)
        self.assertEqual(found.returncode, 1)
        self.assertRegex(found.stderr, r"^rheonaut: \S+: \d+ faults found\n$")
        self.assertRegex(found.stdout, rf"fault: run {run_id}: its samples were changed")
        self.assertEqual(verify("--file", database, "--run", run_id).returncode, 1)

        for flags in (["--data", place.folder / "nowhere"], ["--file", place.folder / "station.log"],
                      ["--data", place.data, "--run", 99]):
            refused = verify(*flags)
            self.assertEqual((refused.returncode, refused.stdout), (2, ""), flags)
            self.assertRegex(refused.stderr, r"^rheonaut: [^\n]+\n$")

    def test_every_sample_that_was_received_is_on_disk_after_sigterm(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "term"})["run_id"]
            first = station.robot("sim-1")["next_seq"]
            wait_until(lambda: station.robot("sim-1")["next_seq"] > first + 50, 60, "50 more samples")
            seen = station.robot("sim-1")["next_seq"]
            self.assertEqual(place.stop_station(), 0)
            self.assertFalse((place.data / "endpoints.json").exists())
            database = place.data / "station.sqlite"
            rows = self.samples_of_run(database, run_id)
            self.assertGreaterEqual(rows[-1][1], seen - 1)
            with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
                self.assertEqual(connection.execute("SELECT state FROM run").fetchone()[0], "interrupted")


if __name__ == "__main__":
    unittest.main()
