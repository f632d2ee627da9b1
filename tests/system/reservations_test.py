"""A robot that is reserved, with real programs: by the command line, against the API, and over kill -9."""
import json
import unittest

from processes import lab, stopped


class ReservationsTest(unittest.TestCase):
    def post(self, station, path, body=None):
        status, _, content = station.request("POST", path, body)
        return status, json.loads(content)

    def test_keeps_others_out_over_kill_9_and_everybody_stops_the_robot(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            anna = {"name": "anna", "role": "operator", "password": "correct horse"}
            self.assertEqual(self.post(station, "/api/v1/users", anna)[0], 201)
            made = place.tool("robot", "reserve", "sim-1", "--for", "1h30min", "--purpose", "bed 3", "--holder", "user:anna",
                              "--data", place.data)
            self.assertEqual(made.returncode, 0, made.stderr)
            self.assertIn("Reservation 1: robot sim-1 is reserved for user:anna from ", made.stdout)
            status, refused = self.post(station, "/api/v1/robots/sim-1/commands", {"kind": "set_duty", "duty": 0.1})
            self.assertEqual((status, refused["reason"]), (409, "reserved"))
            place.kill_station()
            station = place.start_station(robots=station.endpoints["robots"])
            station.wait_for_robot("sim-1")
            self.assertEqual(station.robot("sim-1")["reservation"]["holder"], "user:anna", "on disk before its answer")
            status, refused = self.post(station, "/api/v1/robots/sim-1/control", {"action": "take"})
            self.assertEqual((status, refused["reason"]), (409, "reserved"))
            stopped(station)
            listed = place.tool("robot", "reservations", "sim-1", "--data", place.data)
            self.assertIn("user:anna", listed.stdout)
            self.assertIn("bed 3", listed.stdout)
            cancelled = place.tool("robot", "cancel-reservation", "1", "--data", place.data)
            self.assertEqual(cancelled.stdout, "Reservation 1 of robot sim-1 is cancelled\n", cancelled.stderr)
            self.assertEqual(self.post(station, "/api/v1/robots/sim-1/control", {"action": "take"})[0], 200)
            empty = place.tool("robot", "reservations", "--data", place.data)
            self.assertEqual(empty.stdout, "No robot is reserved\n")
            self.assertIn("cancelled", place.tool("robot", "reservations", "--all", "--data", place.data).stdout)

    def test_wrong_times_are_refused_with_what_is_meant(self):
        with lab() as place:
            for option, wrong in (("--for", "2"), ("--for", "8d"), ("--for", "1h1h"), ("--for", ""), ("--from", "tomorrow"),
                                  ("--from", "2026-02-30T09:00Z"), ("--from", "2026-11-26T09:00")):
                more = () if option == "--for" else ("--for", "1h")
                refused = place.tool("robot", "reserve", "sim-1", option, wrong, *more, "--data", place.data)
                self.assertNotEqual(refused.returncode, 0, f"{option} {wrong}: {refused.stdout}")
                self.assertIn(f"{option} must be a ", refused.stderr)
            nobody = place.tool("robot", "reserve", "sim-1", "--for", "1d2h", "--from", "2026-11-26T09:00:30Z", "--data", place.data)
            self.assertEqual(nobody.returncode, 1)
            self.assertNotIn("must be", nobody.stderr)


if __name__ == "__main__":
    unittest.main()
