"""Emergency stop with real processes: over HTTP, with the link cut, latched, and cleared only by name."""
import time
import unittest

from processes import ApiError, cleared, commanded, lab, stopped, swimming, wait_until

LINK_TIMEOUT_S = 1  # of a station as it comes


class EmergencyStopTest(unittest.TestCase):
    def latest(self, station):
        return station.robot("sim-1")

    def moving_robot(self, place):
        station = place.start_station()
        place.start_robot(station)
        station.wait_for_robot("sim-1")
        swimming(station)
        return station

    def assert_refused(self, reason, call, *arguments, **named):
        with self.assertRaises(ApiError) as refused:
            call(*arguments, **named)
        self.assertEqual(refused.exception.reason, reason)

    def duty_after(self, station, run_id, robot_time_us):
        samples = station.get(f"/api/v1/runs/{run_id}/samples?limit=10000")["samples"]
        return [sample["duty"] for sample in samples if sample["robot_time_us"] > robot_time_us]

    def test_the_next_sample_after_a_stop_has_duty_0_and_only_a_clear_by_name_ends_it(self):
        with lab() as place:
            station = self.moving_robot(place)
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "stop"})["run_id"]
            first = stopped(station)
            wait_until(lambda: self.latest(station)["mode"] == "emergency", 60, "emergency in telemetry")
            for kind, arguments in [("set_mode", {"mode": "auto", "setpoint_m": 0.1}), ("set_duty", {"duty": 0.2}),
                                    ("set_setpoint", {"setpoint_m": 0.1})]:
                self.assert_refused("latched", commanded, station, kind, **arguments)
            self.assert_refused("other_emergency", commanded, station, "clear_emergency", emergency_id="12345")

            # A clear that was overtaken by a second stop does nothing.
            second = stopped(station)
            self.assertNotEqual(second["emergency_id"], first["emergency_id"])
            self.assert_refused("other_emergency", commanded, station, "clear_emergency",
                                emergency_id=first["emergency_id"])
            self.assertEqual(self.latest(station)["mode"], "emergency")

            manual = cleared(station, second["emergency_id"])
            self.assertIsNone(manual["setpoint_m"])
            seen = manual["next_seq"]
            wait_until(lambda: self.latest(station)["next_seq"] > seen + 50, 60, "half a second more")
            station.post(f"/api/v1/runs/{run_id}/end")
            duties = self.duty_after(station, run_id, first["effect_at_robot_us"])
            self.assertGreater(len(duties), 50)
            self.assertEqual(set(duties), {0.0}, "duty 0 from the next sample on, and nothing moves after the clear")

    def test_a_stop_while_the_link_is_cut_is_kept_over_a_station_restart_and_delivered_first(self):
        with lab(config=None) as place:
            station = self.moving_robot(place)
            robot = place.processes[-1]
            robot_ports = station.endpoints
            robot.send_signal(19)  # SIGSTOP: the robot falls silent, as when the link is cut
            try:
                wait_until(lambda: self.latest(station)["link"] == "disconnected", 60, "the link is held for lost")
                status, _, _ = station.request("POST", "/api/v1/robots/sim-1/emergency-stop")
                self.assertEqual(status, 202)
                self.assertIsNotNone(self.latest(station)["pending_stop"])
                self.assertEqual(place.stop_station(), 0)
                station = place.start_station(http=robot_ports["http"], robots=robot_ports["robots"])
                self.assertIsNotNone(self.latest(station)["pending_stop"], "kept over the restart")
            finally:
                robot.send_signal(18)  # SIGCONT
            def is_latched():
                robot = self.latest(station)
                return robot["mode"] == "emergency" and robot["emergency_id"] and robot["sample"]["duty"] == 0.0
            wait_until(is_latched, 60, "the robot is latched, with duty 0")
            wait_until(lambda: self.latest(station)["pending_stop"] is None, 60, "the stop is acknowledged")

    def test_after_a_lost_link_nothing_moves_by_itself(self):
        with lab(config=None) as place:
            station = self.moving_robot(place)
            ports = station.endpoints
            first = self.latest(station)["next_seq"]
            place.kill_station()
            time.sleep(LINK_TIMEOUT_S)  # the outage is the input of this test
            station = place.start_station(http=ports["http"], robots=ports["robots"])
            station.wait_for_robot("sim-1")
            seen = self.latest(station)["next_seq"]
            after = wait_until(lambda: self.latest(station)["next_seq"] > seen + 100 and self.latest(station), 60,
                               "one second more")
            span = {"boot_id": after["boot_id"], "first_seq": first, "last_seq": after["next_seq"] - 1}
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "link loss", "span": span})["run_id"]

            def lost():
                events = station.get("/api/v1/robots/sim-1/events?limit=1000")["events"]
                return [event["robot_time_us"] for event in events if event["kind"] == "link_lost"]
            lost_us = max(wait_until(lost, 60, "the robot's word of the loss"))
            self.assertEqual(after["mode"], "manual")
            self.assertIsNone(after["setpoint_m"])
            self.assertEqual(set(self.duty_after(station, run_id, lost_us)), {0.0})


if __name__ == "__main__":
    unittest.main()
