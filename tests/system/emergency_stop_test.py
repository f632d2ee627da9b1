"""Emergency stop with real processes: over HTTP, with the link cut, latched, and cleared only by name."""
import unittest

from processes import ApiError, lab, wait_until


class EmergencyStopTest(unittest.TestCase):
    def latest(self, station):
        return station.robot("sim-1")

    def moving_robot(self, place):
        station = place.start_station()
        place.start_robot(station)
        station.wait_for_robot("sim-1")
        station.command("sim-1", "set_mode", mode="auto", setpoint_m=0.5)
        wait_until(lambda: self.latest(station)["sample"]["duty"] > 0.5, 10, "the motor runs")
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
            first = station.post("/api/v1/robots/sim-1/emergency-stop")
            self.assertEqual(first["state"], "acknowledged")
            wait_until(lambda: self.latest(station)["mode"] == "emergency", 10, "emergency in telemetry")
            for kind, arguments in [("set_mode", {"mode": "auto", "setpoint_m": 0.1}), ("set_duty", {"duty": 0.2}),
                                    ("set_setpoint", {"setpoint_m": 0.1})]:
                self.assert_refused("latched", station.command, "sim-1", kind, **arguments)
            self.assert_refused("other_emergency", station.command, "sim-1", "clear_emergency", emergency_id="12345")

            # A clear that was overtaken by a second stop does nothing.
            second = station.post("/api/v1/robots/sim-1/emergency-stop")
            self.assertNotEqual(second["emergency_id"], first["emergency_id"])
            self.assert_refused("other_emergency", station.command, "sim-1", "clear_emergency",
                                emergency_id=first["emergency_id"])
            self.assertEqual(self.latest(station)["mode"], "emergency")

            station.command("sim-1", "clear_emergency", emergency_id=second["emergency_id"])
            cleared = wait_until(lambda: self.latest(station)["mode"] == "manual" and self.latest(station), 10, "manual")
            self.assertIsNone(cleared["setpoint_m"])
            seen = cleared["next_seq"]
            wait_until(lambda: self.latest(station)["next_seq"] > seen + 50, 10, "half a second more")
            station.post(f"/api/v1/runs/{run_id}/end")
            duties = self.duty_after(station, run_id, first["effect_at_robot_us"])
            self.assertGreater(len(duties), 50)
            self.assertEqual(set(duties), {0.0}, "duty 0 from the next sample on, and nothing moves after the clear")

    def test_a_stop_while_the_link_is_cut_is_kept_over_a_station_restart_and_delivered_first(self):
        with lab() as place:
            station = self.moving_robot(place)
            robot = place.processes[-1]
            robot_ports = station.endpoints
            robot.send_signal(19)  # SIGSTOP: the robot falls silent, as when the link is cut
            try:
                wait_until(lambda: self.latest(station)["link"] == "disconnected", 10, "the link is held for lost")
                status, _, _ = station.request("POST", "/api/v1/robots/sim-1/emergency-stop")
                self.assertEqual(status, 202)
                self.assertIsNotNone(self.latest(station)["pending_stop"])
                self.assertEqual(place.stop_station(), 0)
                station = place.start_station(http=robot_ports["http"], robots=robot_ports["robots"])
                self.assertIsNotNone(self.latest(station)["pending_stop"], "kept over the restart")
            finally:
                robot.send_signal(18)  # SIGCONT
            latched = wait_until(lambda: self.latest(station)["mode"] == "emergency" and self.latest(station), 20,
                                 "the robot is latched")
            wait_until(lambda: self.latest(station)["pending_stop"] is None, 10, "the stop is acknowledged")
            self.assertIsNotNone(latched["emergency_id"])
            self.assertEqual(latched["sample"]["duty"], 0.0)

    def test_after_a_lost_link_nothing_moves_by_itself(self):
        with lab() as place:
            station = self.moving_robot(place)
            ports = station.endpoints
            first = self.latest(station)["next_seq"]
            place.kill_station()
            station = place.start_station(http=ports["http"], robots=ports["robots"])
            station.wait_for_robot("sim-1", timeout_s=30)
            seen = self.latest(station)["next_seq"]
            after = wait_until(lambda: self.latest(station)["next_seq"] > seen + 100 and self.latest(station), 20,
                               "one second more")
            span = {"boot_id": after["boot_id"], "first_seq": first, "last_seq": after["next_seq"] - 1}
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "link loss", "span": span})["run_id"]
            events = station.get("/api/v1/robots/sim-1/events")["events"]
            lost = [event for event in events if event["kind"] == "link_lost"]
            if not lost:  # the station was back within the link time-out: the robot rightly went on
                self.assertEqual(after["mode"], "auto")
                return
            self.assertEqual(after["mode"], "manual")
            self.assertIsNone(after["setpoint_m"])
            self.assertEqual(set(self.duty_after(station, run_id, lost[0]["robot_time_us"])), {0.0})


if __name__ == "__main__":
    unittest.main()
