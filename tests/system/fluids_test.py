"""A robot's fluid and its limits, with a real station: over kill -9, and with a configuration that has changed."""

import json
import sqlite3
import unittest

from processes import PATIENT, lab, wait_until

CONFIG = PATIENT + "[limits.Water]\nduty_max = 0.5\n[fluids.oil]\n"


class FluidsTest(unittest.TestCase):
    def post(self, station, path, body):
        status, _, content = station.request("POST", path, body)
        return status, json.loads(content)

    def refused_duty(self, station):
        """What the station says to a duty of 0.8; "" when the limits allow it."""
        status, answer = self.post(station, "/api/v1/robots/sim-1/commands", {"kind": "set_duty", "duty": 0.8})
        return answer["detail"] if status == 422 else ""

    def fluid(self, station, fluid):
        return self.post(station, "/api/v1/robots/sim-1/fluid", {"fluid": fluid})

    def test_its_limits_hold_without_a_run_and_after_kill_9(self):
        with lab() as place:
            station = place.start_station(config=CONFIG)
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            self.assertIn("the robot's fluid is not known", self.refused_duty(station))
            self.assertEqual(self.fluid(station, "oil")[0], 200)
            self.assertEqual(self.refused_duty(station), "")
            self.assertEqual(self.fluid(station, "WATER ")[1]["fluid"], "water")
            place.kill_station()
            station = place.start_station(robots=station.endpoints["robots"], config=CONFIG)
            self.assertEqual(station.robot("sim-1")["fluid"], "water", "it was stored before the answer")
            station.wait_for_robot("sim-1")
            self.assertIn("limits of the fluid 'water'", self.refused_duty(station))

    def test_a_fluid_that_is_no_longer_listed_is_not_known(self):
        with lab() as place:
            station = place.start_station(config=CONFIG)
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            self.assertEqual(self.fluid(station, "oil")[0], 200)
            self.assertEqual(place.stop_station(), 0)
            station = place.start_station(robots=station.endpoints["robots"], config=CONFIG.replace("oil", "honey"))
            self.assertIsNone(station.robot("sim-1")["fluid"])
            self.assertIn("robot 'sim-1' is in the fluid 'oil', which the configuration does not list", place.log("station"))
            station.wait_for_robot("sim-1")
            self.assertIn("the robot's fluid is not known", self.refused_duty(station))
            status, answer = self.fluid(station, "oil")
            self.assertEqual((status, answer["reason"]), (422, "unknown_fluid"))
            self.assertIn("is none of honey, non_newtonian, water", answer["detail"])

    def test_an_open_run_in_a_fluid_that_is_not_listed_gives_the_strictest_limits_and_a_warning(self):
        with lab() as place:
            station = place.start_station(config=CONFIG)
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            status, run = self.post(station, "/api/v1/runs", {"robot_id": "sim-1", "name": "before the list"})
            self.assertEqual(status, 201)
            place.kill_station()
            with sqlite3.connect(place.data / "station.sqlite") as database:  # as an older station has left it
                database.execute("UPDATE run SET fluid = 'Wasser, 20 Grad'")
            database.close()
            station = place.start_station(robots=station.endpoints["robots"], config=CONFIG)
            self.assertIn(f"run {run['run_id']} of robot 'sim-1' was open in the fluid 'Wasser, 20 Grad'", place.log("station"))
            self.assertEqual(station.get(f"/api/v1/runs/{run['run_id']}")["fluid"], "Wasser, 20 Grad", "it stays readable")
            self.assertIsNone(station.robot("sim-1")["fluid"])
            station.wait_for_robot("sim-1")
            self.assertIn("the robot's fluid is not known", self.refused_duty(station))

    def test_check_config_prints_the_limits_of_each_fluid(self):
        with lab() as place:
            path = place.folder / "rheonaut.toml"
            path.write_text(CONFIG)
            printed = place.tool("check-config", "--config", path).stdout
            limits = "setpoint -1 to 1 m in steps of 2 m, duty -1 to {}, above 0.9 for 60 s, disturbance 0.5 m"
            for line in (f"limits   {limits.format(1)}", f"fluid    non_newtonian: {limits.format(1)}",
                         f"fluid    oil (of this configuration): {limits.format(1)}",
                         f"fluid    water: {limits.format(0.5)}", f"fluid    not known: {limits.format(0.5)}"):
                self.assertIn(line, printed.splitlines())

    def test_the_tool_shows_and_changes_it_and_the_audit_knows_who(self):
        with lab() as place:
            station = place.start_station(config=CONFIG)
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            tool = lambda *words: place.tool("robot", "fluid", "sim-1", *words, "--data", place.data)
            self.assertTrue(tool().stdout.startswith("fluid  not known: the strictest limits of all fluids hold\n"))
            self.assertIn("the robot's fluid is not known", self.refused_duty(station))
            done = tool("--set", " OIL")
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertRegex(done.stdout, r"^fluid  oil\nmodel  assumed")
            self.assertEqual(self.refused_duty(station), "", "its limits hold at once")
            self.assertEqual(json.loads(tool("--json").stdout)["fluid"], "oil")
            done = tool("--set", "honey")
            self.assertEqual(done.returncode, 1)
            self.assertIn("is none of non_newtonian, oil, water", done.stderr)
            entries = station.get("/api/v1/audit?limit=20")["entries"]
            changes = [(one["actor"], one["subject"]) for one in entries if one["action"] == "robot.fluid_set"]
            self.assertEqual(changes, [("token:local", "oil")])
            self.assertEqual(self.post(station, "/api/v1/robots/sim-1/fluid", {"fluid": "water"})[0], 200)
            self.assertEqual(tool().stdout.splitlines()[0], "fluid  water")
            self.assertEqual(json.loads(tool("--not-known", "--json").stdout)["fluid"], None)
            self.assertIn("the robot's fluid is not known", self.refused_duty(station))

    def test_a_model_is_given_by_the_tool_sent_to_the_robot_and_known_after_kill_9(self):
        model = {"model_gain_m_s": [0.1, -0.33333334, 0, 0.01], "model_time_constant_s": [0.03, 0.5, 3, 15],
                 "fit_error": 0.0021, "plant": {"kp": 0.13}}
        with lab() as place:
            station = place.start_station(config=CONFIG)
            file = place.data / "model.json"
            file.write_text(json.dumps(model))
            done = place.tool("fluid", "model", " OIL", file, "--data", place.data)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertEqual(done.stdout, "The fluid oil has this model from now on\n")
            file.write_text(json.dumps(model | {"fit_error": 0.02}))
            bad = place.tool("fluid", "model", "water", file, "--data", place.data)
            self.assertEqual(bad.returncode, 1)
            self.assertIn("the station refused: fit_error = 2 %", bad.stderr)
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            sent = self.fluid(station, "oil")[1]["model"]
            self.assertEqual((sent["state"], sent["fluid"], sent["fit_error"]), ("confirmed", "oil", 0.0021), sent)
            place.kill_station()
            station = place.start_station(robots=station.endpoints["robots"], config=CONFIG)
            station.wait_for_robot("sim-1")
            listed = place.tool("fluid", "list", "--data", place.data).stdout
            self.assertRegex(listed, r"oil +model with a fit error of 0.21 %, set 20.* by token:local")
            self.assertRegex(listed, r"water +no model")
            wait_until(lambda: station.robot("sim-1")["model"]["state"] == "confirmed", 60, "the robot holds it, bit for bit")
            self.assertEqual(station.robot("sim-1")["model"]["fluid"], "oil")
            done = place.tool("fluid", "remove-model", "oil", "--data", place.data)
            self.assertIn("The fluid oil has no model any more", done.stdout)
            self.assertIn("before their fluid is named again: sim-1", done.stdout)
            self.assertEqual(self.fluid(station, "oil")[1]["model"]["state"], "assumed")


if __name__ == "__main__":
    unittest.main()
