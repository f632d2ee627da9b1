"""kill -9 of the station in mid-run: the robot comes back and not one sample of the run is missing."""
import sqlite3
import unittest

from processes import lab, wait_until


class KillTest(unittest.TestCase):
    def samples_of_run(self, database, run_id):
        with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
            return connection.execute(
                "SELECT boot_id, seq FROM run_sample WHERE run_id = ? ORDER BY span, seq", (run_id,)).fetchall()

    def test_no_sample_of_a_run_is_lost_when_the_station_is_killed_three_times(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            before = station.wait_for_robot("sim-1")
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "kill"})["run_id"]
            station.command("sim-1", "set_mode", mode="auto", setpoint_m=0.05)
            ports = station.endpoints
            for _ in range(3):
                seen = station.robot("sim-1")["next_seq"]
                wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 70, 30, "70 more samples")
                place.kill_station()
                station = place.start_station(http=ports["http"], robots=ports["robots"])
                after = station.wait_for_robot("sim-1", timeout_s=30)
                self.assertEqual(after["boot_id"], before["boot_id"], "the robot did not reboot")
            seen = station.robot("sim-1")["next_seq"]
            wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 100, 30, "100 more samples")
            run = station.post(f"/api/v1/runs/{run_id}/end")

            self.assertEqual(run["samples_lost"], 0)
            self.assertEqual(run["samples_stored"], run["samples_expected"])
            rows = self.samples_of_run(station.database, run_id)
            self.assertEqual(len(rows), run["samples_expected"])
            self.assertGreater(len(rows), 300)
            self.assertEqual({row[0] for row in rows}, {rows[0][0]}, "one boot, so one span of numbers")
            first = rows[0][1]
            self.assertEqual([row[1] for row in rows], list(range(first, first + len(rows))), "contiguous")
            self.assertEqual(place.stop_station(), 0)
            with sqlite3.connect(station.database) as connection:
                self.assertEqual(connection.execute("PRAGMA integrity_check").fetchone()[0], "ok")

    def test_every_sample_that_was_received_is_on_disk_after_sigterm(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "term"})["run_id"]
            first = station.robot("sim-1")["next_seq"]
            wait_until(lambda: station.robot("sim-1")["next_seq"] > first + 50, 30, "50 more samples")
            seen = station.robot("sim-1")["next_seq"]
            self.assertEqual(place.stop_station(), 0)
            self.assertFalse((place.data / "endpoints.json").exists())
            rows = self.samples_of_run(place.data / "station.sqlite", run_id)
            self.assertGreaterEqual(rows[-1][1], seen - 1)


if __name__ == "__main__":
    unittest.main()
