"""A schedule in mid-run whose owner, station or link is gone: the motor is at 0 within 500 ms of the robot's time. Real
processes; judged by what the robot recorded, which arrives when it is back."""
import subprocess
import unittest

from processes import BIN, ApiError, lab, wait_until

PATH = "/api/v1/robots/sim-1"
DUTY = 0.25
SCHEDULE = [{"tick": 0, "duty": DUTY}, {"tick": 3000, "duty": 0}]  # half a minute
LEASE_US, TICK_US = 500_000, 10_000


class SchedulesTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab())
        self.station = self.place.start_station()

    def start_robot(self, robots=None):
        flags = ["--station", robots or self.station.endpoints["robots"], "--id", "sim-1", "--sensor", "perfect"]
        self.place._start("sim-1", "rheonaut-sim", *flags)
        self.station.wait_for_robot("sim-1")

    def drive(self):
        """Begins the schedule, and renews its lease until telemetry shows the motion and once more; when that was, in the
        robot's time. On a machine so busy that the lease lapses meanwhile, begins again."""
        while True:
            try:
                self.station.command("sim-1", "set_duty_schedule", schedule=SCHEDULE)
                while self.station.robot("sim-1")["sample"]["duty"] != DUTY:
                    self.station.command("sim-1", "renew_lease")
                return self.station.command("sim-1", "renew_lease")["effect_at_robot_us"]
            except ApiError as error:
                self.assertIn(error.reason, ("nothing_to_renew", "timed_out", "expired"), error.problem)

    def samples_until(self, robot_time_us):
        """Every sample of the robot, once all of them have come that were made until then: live ones come before older ones
        that were held back."""
        def found():
            rows, after = [], ""
            while after is not None:
                page = self.station.get(f"{PATH}/samples?limit=10000" + (f"&after={after}" if after else ""))
                rows += page["samples"]
                after = page["next"]
            times = [row["robot_time_us"] for row in rows]
            is_whole = all(b - a == TICK_US for a, b in zip(times, times[1:]))
            return rows if rows and times[-1] > robot_time_us and is_whole else None
        return wait_until(found, 60, "samples after the lease")

    def expect_stopped(self, renewed_us):
        rows = self.samples_until(renewed_us + 4 * LEASE_US)
        moving = [row for row in rows if row["duty"] != 0]
        self.assertTrue([row for row in moving if row["robot_time_us"] <= renewed_us], "the schedule ran")
        last_us = max(row["robot_time_us"] for row in moving)
        self.assertLessEqual(last_us, renewed_us + LEASE_US + TICK_US)

    def test_the_owner_is_gone(self):
        self.start_robot()
        self.expect_stopped(self.drive())

    def test_the_station_is_killed(self):
        self.start_robot()
        renewed_us = self.drive()
        robots = self.station.endpoints["robots"]
        self.place.kill_station()
        self.station = self.place.start_station(robots=robots)
        self.station.wait_for_robot("sim-1")
        self.expect_stopped(renewed_us)

    def test_the_link_is_cut(self):
        proxy = subprocess.Popen([BIN / "rheonaut-sim", "proxy", "--to", self.station.endpoints["robots"]],
                                 stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.addCleanup(proxy.communicate)
        self.addCleanup(proxy.terminate)
        listening = proxy.stdout.readline()
        self.start_robot(listening.split()[-1])
        renewed_us = self.drive()
        proxy.stdin.write("half-open\n")  # what is connected stays so and says nothing; new connections are well
        proxy.stdin.flush()
        self.expect_stopped(renewed_us)

    def test_what_waits_does_not_outlive_its_owners_control(self):
        self.start_robot()
        at_us = self.station.robot("sim-1")["latest_robot_time_us"] + 9_000_000
        sent = self.station.command("sim-1", "set_duty", duty=DUTY, execute_at_robot_us=at_us, life_ms=10_000)
        self.assertEqual(sent["effect_at_robot_us"], at_us)
        self.station.post(f"{PATH}/control", {"action": "release"})
        path = f"/api/v1/commands/{sent['command_id']}"
        wait_until(lambda: self.station.get(path)["state"] == "expired", 20, "the robot has dropped it")
        kinds = [one["kind"] for one in self.station.get(f"{PATH}/commands")["commands"]]
        self.assertEqual(kinds, ["drop_timed", "set_duty"])

    def test_what_waits_acts_at_its_time_while_it_is_renewed(self):
        self.start_robot()
        while True:
            at_us = self.station.robot("sim-1")["latest_robot_time_us"] + 1_500_000
            sent = self.station.command("sim-1", "set_duty", duty=DUTY, execute_at_robot_us=at_us, life_ms=10_000)
            path = f"/api/v1/commands/{sent['command_id']}"
            while self.station.get(path)["state"] == "acknowledged":
                try:
                    self.station.command("sim-1", "renew_lease")
                except ApiError as error:
                    self.assertIn(error.reason, ("nothing_to_renew", "timed_out", "expired"), error.problem)
            if self.station.get(path)["state"] != "expired":  # as on a machine so busy that the lease lapsed
                break
        self.assertEqual(self.station.get(path)["state"], "verified")
        rows = self.samples_until(at_us)
        first_us = next(row["robot_time_us"] for row in rows if row["duty"] != 0)
        self.assertGreaterEqual(first_us, at_us)
        self.assertLess(first_us, at_us + TICK_US)


if __name__ == "__main__":
    unittest.main()
