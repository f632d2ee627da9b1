"""A schedule in mid-run whose owner, station or link is gone, or whose owner's token or session has ended: the motor is
at 0 within 500 ms of the robot's time. Real processes; judged by what the robot recorded, which arrives when it is back."""
import subprocess
import time
import unittest
from concurrent.futures import ThreadPoolExecutor

from accounts_test import PASSWORD, Page
from processes import BIN, ApiError, Station, lab, wait_until

PATH = "/api/v1/robots/sim-1"
DUTY = 0.25
SCHEDULE = [{"tick": 0, "duty": DUTY}, {"tick": 3000, "duty": 0}]  # half a minute
LEASE_US, TICK_US = 500_000, 10_000
# Reasons on a machine so busy that the lease lapses, or that a request is old when it arrives.
LAPSED = ("nothing_to_renew", "no_answer", "timed_out", "expired", "stale")


class PageOwner:
    """A page that is signed in commands as a script does."""

    def __init__(self, page):
        self.page = page

    def command(self, robot_id, kind, **arguments):
        stamp_us = time.clock_gettime_ns(time.CLOCK_BOOTTIME) // 1000  # the station's clock, as /live tells it to pages
        body = {"kind": kind, "stamp_us": stamp_us, **arguments}
        status, answer = self.page.ask("POST", f"/api/v1/robots/{robot_id}/commands", body)
        if status >= 400:
            raise ApiError(status, answer)
        return answer


class SchedulesTest(unittest.TestCase):
    def setUp(self):
        self.place = self.enterContext(lab(config="[robots]\nlink_timeout_ms = 2500\n"))
        self.station = self.place.start_station()

    def start_robot(self, robots=None):
        flags = ["--station", robots or self.station.endpoints["robots"], "--id", "sim-1", "--sensor", "perfect"]
        self.place._start("sim-1", "rheonaut-sim", *flags)
        self.station.wait_for_robot("sim-1")

    def drive(self, owner=None):
        """Begins the schedule, and renews its lease until telemetry shows the motion and once more; when that was, in the
        robot's time. On a machine so busy that the lease lapses meanwhile, begins again. By default with the station's
        own token."""
        owner = owner or self.station
        while True:
            try:
                owner.command("sim-1", "set_duty_schedule", schedule=SCHEDULE)
                while self.station.robot("sim-1")["sample"]["duty"] != DUTY:
                    owner.command("sim-1", "renew_lease")
                return owner.command("sim-1", "renew_lease")["effect_at_robot_us"]
            except ApiError as error:
                self.assertIn(error.reason, LAPSED, error.problem)

    def samples_until(self, robot_time_us):
        """Every sample of the robot, once all of them have come that were made until then: live ones come before older ones
        that were held back."""
        def found():
            rows, after = [], ""
            while after is not None:
                page = self.station.get(f"{PATH}/samples?limit=10000" + (f"&after={after}" if after else ""))
                rows += page["samples"]
                after = page["next"]
            numbers = [row["seq"] for row in rows]  # not the times: a busy machine makes the robot miss ticks
            is_whole = all(b - a == 1 for a, b in zip(numbers, numbers[1:]))
            return rows if rows and rows[-1]["robot_time_us"] > robot_time_us and is_whole else None
        return wait_until(found, 60, "samples after the lease")

    def expect_stopped(self, renewed_us):
        rows = self.samples_until(renewed_us + 4 * LEASE_US)
        moving = [row for row in rows if row["duty"] != 0]
        self.assertTrue([row for row in moving if row["robot_time_us"] <= renewed_us], "the schedule ran")
        last_us = max(row["robot_time_us"] for row in moving)
        self.assertLessEqual(last_us, renewed_us + LEASE_US + TICK_US)

    def renew_until_refused(self, owner, renewed_us):
        """Goes on renewing until the station no longer knows the owner; when the last renewal was that it carried out."""
        ends_s = time.monotonic() + 60
        while True:
            self.assertLess(time.monotonic(), ends_s, "the station still obeys the owner")
            try:
                renewed_us = owner.command("sim-1", "renew_lease")["effect_at_robot_us"]
            except ApiError as error:
                if error.status == 401:
                    return renewed_us
                self.assertIn(error.reason, LAPSED, error.problem)

    def expect_stopped_by(self, end, owner):
        """`end` ends what the owner acts by, in the middle of the schedule and of its renewals."""
        renewed_us = self.drive(owner)
        with ThreadPoolExecutor(1) as other:
            renewing = other.submit(self.renew_until_refused, owner, renewed_us)
            end()
            self.expect_stopped(renewing.result())

    def test_the_owner_is_gone(self):
        self.start_robot()
        self.expect_stopped(self.drive())

    def test_the_owners_token_is_revoked(self):
        self.start_robot()
        owner = Station(self.station.data_dir)
        owner.token = self.station.post("/api/v1/tokens", {"name": "owner", "scopes": "command"})["secret"]
        self.expect_stopped_by(lambda: self.station.post("/api/v1/tokens/owner/revoke"), owner)

    def test_the_owner_signs_out(self):
        self.start_robot()
        self.station.post("/api/v1/users", {"name": "anna", "role": "operator", "password": PASSWORD})
        page = Page(self.station)
        self.assertEqual(page.log_in("anna")[0], 200)
        tab = Page(self.station, page.cookie)  # signs out in one tab while the other drives
        self.expect_stopped_by(lambda: self.assertEqual(tab.ask("POST", "/api/v1/logout")[0], 200), PageOwner(page))

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
        wait_until(lambda: self.station.get(path)["state"] == "expired", 60, "the robot has dropped it")
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
                    self.assertIn(error.reason, LAPSED, error.problem)
            if self.station.get(path)["state"] != "expired":  # as on a machine so busy that the lease lapsed
                break
        self.assertEqual(self.station.get(path)["state"], "verified")
        rows = self.samples_until(at_us)
        first_us = next(row["robot_time_us"] for row in rows if row["duty"] != 0)
        self.assertGreaterEqual(first_us, at_us)
        self.assertLess(first_us, at_us + TICK_US)


if __name__ == "__main__":
    unittest.main()
