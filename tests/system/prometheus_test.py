"""What Prometheus, its alert rules and the Grafana dashboard see of a real station, checked by promtool."""
import json
import re
import shutil
import subprocess
import unittest
import urllib.request

from processes import PATIENT, ROOT, lab, wait_until
from station_api import trust

RULES = ROOT / "deploy/prometheus/rheonaut.rules.yml"
RULE_TESTS = ROOT / "deploy/prometheus/rheonaut.rules.test.yml"
DASHBOARD = ROOT / "deploy/grafana/rheonaut.json"
SUFFIXES = ("_bucket", "_sum", "_count")


def promtool():
    """The path of promtool; None where neither the system has it nor Debian's mirror can be reached."""
    found = subprocess.run([ROOT / "deploy/promtool"], capture_output=True, text=True, timeout=240)
    return found.stdout.strip() if found.returncode == 0 else None


PROMTOOL = promtool()
needs_promtool = unittest.skipUnless(PROMTOOL, "promtool is not installed and deploy/promtool could not fetch it")


def names_in(text):
    """The names of figures that a query names."""
    names = re.findall(r"\brheonaut_\w+", text)
    return {re.sub(r"_(bucket|sum|count)$", "", name) if name.endswith(SUFFIXES) else name for name in names}


def expressions(value):
    """Every query of a dashboard, however deep it stands."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key in ("expr", "query") and isinstance(inner, str):
                yield inner
            else:
                yield from expressions(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from expressions(inner)


class PrometheusTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # One station that speaks TLS and has a robot: it exposes everything.
        with lab(config=PATIENT + '[tls]\nmode = "on"\n') as place:
            made = place.tool("certificate", "--data", place.data).stdout
            station = place.start_station()
            pin = re.search(r"^pin +([0-9a-f]{64})$", made, re.M).group(1)
            place.start_robot(station, "sim-1", "--tls-pin", pin)
            wait_until(lambda: station.get("/api/v1/recording")["counters"]["samples_written"] > 0, 60, "samples")
            cls.metrics = cls.fetch(station, "/metrics", place)
            cls.ready = cls.fetch(station, "/readyz", place, with_token=False)
            cls.alive = cls.fetch(station, "/healthz", place, with_token=False)

    @staticmethod
    def fetch(station, path, place, with_token=True):
        request = urllib.request.Request(f"https://{station.endpoints['http']}{path}")
        if with_token:
            request.add_header("Authorization", f"Bearer {(place.data / 'rheonaut.token').read_text().strip()}")
        context = trust(station.endpoints["tls_certificate"])
        with urllib.request.urlopen(request, timeout=60, context=context) as answer:
            return answer.read().decode()

    def exposed(self):
        return set(re.findall(r"^# TYPE (\w+)", self.metrics, re.M))

    def check(self, *arguments, text=None):
        done = subprocess.run([PROMTOOL, *map(str, arguments)], input=text, capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_a_station_with_a_robot_is_alive_and_ready(self):
        self.assertEqual(json.loads(self.alive), {"alive": True})
        self.assertEqual(json.loads(self.ready), {"ready": True, "problems": []})

    def test_the_histograms_count(self):
        for name in ("commit_seconds", "queued_samples_at_commit", "link_round_trip_seconds", "loop_lateness_seconds"):
            count = re.search(rf"^rheonaut_{name}_count (\d+)$", self.metrics, re.M)
            self.assertGreater(int(count.group(1)), 0, name)
        self.assertIn("\nrheonaut_robots_connected 1\n", self.metrics)

    @needs_promtool
    def test_promtool_finds_nothing_wrong_with_the_metrics(self):
        self.check("check", "metrics", text=self.metrics)

    @needs_promtool
    def test_promtool_finds_nothing_wrong_with_the_rules_and_their_tests_pass(self):
        self.check("check", "rules", RULES)
        self.check("test", "rules", RULE_TESTS)

    @needs_promtool
    def test_a_rule_that_is_wrong_is_found(self):
        with lab() as place:
            wrong = RULES.read_text().replace("rheonaut_recording_failing == 1", "rheonaut_recording_failing == 2")
            (place.folder / RULES.name).write_text(wrong)
            shutil.copy(RULE_TESTS, place.folder)
            done = subprocess.run([PROMTOOL, "test", "rules", place.folder / RULE_TESTS.name], capture_output=True,
                                  text=True, timeout=120)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("RheonautRecordingFailing", done.stdout + done.stderr)

    def test_every_alert_is_tested_both_ways(self):
        alerts = re.findall(r"- alert: (\w+)", RULES.read_text())
        tests = RULE_TESTS.read_text()
        self.assertGreaterEqual(len(alerts), 15)
        for alert in alerts:
            self.assertIn(f"name: {alert} fires\n", tests)
            self.assertIn(f"name: {alert} does not fire\n", tests)

    def test_rules_and_dashboard_name_what_the_station_exposes(self):
        exposed = self.exposed()
        for query in re.findall(r"expr: (.*(?:\n {10,}.*)*)", RULES.read_text()):
            self.assertLessEqual(names_in(query), exposed, query)
        queries = list(expressions(json.loads(DASHBOARD.read_text())))
        self.assertGreaterEqual(len(queries), 25)
        for query in queries:
            self.assertLessEqual(names_in(query), exposed, query)

    def test_every_figure_of_a_histogram_is_shown(self):
        histograms = set(re.findall(r"^# TYPE (\w+) histogram", self.metrics, re.M))
        shown = set().union(*map(names_in, expressions(json.loads(DASHBOARD.read_text()))))
        self.assertLessEqual(histograms, shown)


if __name__ == "__main__":
    unittest.main()
