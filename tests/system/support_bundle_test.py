"""The support bundle of a station full of recognisable secrets: none of them is in it, in any form."""
import base64
import contextlib
import json
import re
import sqlite3
import time
import unittest
import urllib.request
import zipfile

from processes import PATIENT, lab, wait_until
from station_api import trust

PASSWORD = "hunter2-Staple-9"
PLANTED = {  # in the log and in events, as careless programs and people write them
    "in a URL": ("http://planteduser:plantedpass@plantedhost.example:8080/login?code=PlantedCode42&x=1",
                 ["planteduser", "plantedpass", "plantedhost", "PlantedCode42"]),
    "as Bearer": ("Authorization: Bearer PlantedBearer77", ["PlantedBearer77"]),
    "named": ("password = PlantedWord and token: PlantedTok", ["PlantedWord", "PlantedTok"]),
    "in JSON": ('{"secret":"PlantedJson"}', ["PlantedJson"]),
    "as a cookie": ("Cookie: rheonaut_session_8123=PlantedCookie1234567890abcdef", ["PlantedCookie"]),
    "as PEM": ("-----BEGIN PRIVATE KEY-----\nPlantedPemLine1\nPlantedPemLine2\n-----END PRIVATE KEY-----",
               ["PlantedPemLine1", "PlantedPemLine2"]),
    "as base64": ("key 3q2+7wAAAP1antedBase64xyz0123456789+/==", ["1antedBase64xyz"]),
    "as hexadecimal": ("wifi psk 8f3a1c9d7e5b2f40618293a4b5c6d7e8", ["8f3a1c9d7e5b2f40"]),
}


class SupportBundleTest(unittest.TestCase):
    def collect_secrets(self, place, station):
        """Makes every kind of secret that a station knows, and returns them as bytes, each in all of its forms."""
        secrets = {"token of the station": station.token}
        secrets["token of the API"] = station.post("/api/v1/tokens", {"name": "logger", "scopes": "read", "days": 3})["secret"]
        secrets["token of a robot"] = station.post("/api/v1/enrolments", {"robot_id": "r9"})["secret"]
        station.post("/api/v1/users", {"name": "anna", "role": "operator", "password": PASSWORD})
        secrets["password"] = PASSWORD
        link = station.post("/api/v1/login-links")["url"]
        secrets["code of a link"] = link.split("code=")[1]
        secrets["session"] = self.sign_in(station)
        for name in ("station.key", "lab-ca.key"):
            for number, line in enumerate((place.data / "tls" / name).read_text().splitlines()[1:-1]):
                secrets[f"{name} line {number}"] = line
        return secrets

    def sign_in(self, station):
        request = urllib.request.Request(f"https://{station.endpoints['http']}/api/v1/login", method="POST",
                                         data=json.dumps({"user": "anna", "password": PASSWORD}).encode(),
                                         headers={"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=60, context=trust(station.tls_certificate)) as answer:
            return re.search(r"=([^;]+);", answer.headers["Set-Cookie"]).group(1)

    def secrets_of_database(self, path):
        """Hashes: of users, tokens, sessions and robots."""
        with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
            for table, column in (("user", "password_hash"), ("api_token", "hash"), ("page_session", "hash"),
                                  ("robot", "token_hash")):
                for (value,) in database.execute(f"SELECT {column} FROM {table} WHERE {column} IS NOT NULL"):
                    yield f"{table}.{column}", value

    def forms(self, secret):
        raw = secret if isinstance(secret, bytes) else secret.encode()
        yield raw
        yield raw.hex().encode()
        yield base64.b64encode(raw).rstrip(b"=")
        yield base64.urlsafe_b64encode(raw).rstrip(b"=")

    def plant_events(self, path):
        with contextlib.closing(sqlite3.connect(path)) as database:
            columns = [row[1] for row in database.execute("PRAGMA table_info(event)")]
            row = dict(zip(columns, database.execute("SELECT * FROM event LIMIT 1").fetchone()))
            for text, _ in PLANTED.values():
                row.update(event_row=None, boot_key=None, event_seq=None, kind="note", detail=text,
                           received_at_us=int(time.time() * 1e6))
                database.execute(f"INSERT INTO event VALUES ({','.join('?' * len(columns))})", list(row.values()))
            database.commit()

    def bundle(self, place, *flags):
        done = place.tool("support-bundle", "--data", place.data, "--to", place.folder / "bundle.zip", *flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((place.folder / "bundle.zip").stat().st_mode & 0o777, 0o600)
        with zipfile.ZipFile(place.folder / "bundle.zip") as archive:
            return {name.removeprefix("rheonaut-support/"): archive.read(name) for name in archive.namelist()}

    def expect_without(self, files, what, secret):
        for form in self.forms(secret):
            for name, content in files.items():
                self.assertNotIn(form.lower(), content.lower(), f"{what} is in {name}")

    def test_no_secret_is_in_it(self):
        with lab(config=PATIENT + '[tls]\nmode = "on"\n[http]\nhosts = ["plantedhost.example"]\n') as place:
            made = place.tool("certificate", "--data", place.data).stdout
            station = place.start_station()
            pin = re.search(r"^pin +([0-9a-f]{64})$", made, re.M).group(1)
            place.start_robot(station, "sim-1", "--tls-pin", pin)
            wait_until(lambda: station.get("/api/v1/recording")["counters"]["samples_written"] > 0, 60, "samples")
            secrets = self.collect_secrets(place, station)
            self.plant_events(place.data / "station.sqlite")
            log = place.folder / "planted.log"
            station_log = place.log("station")  # has the login link that it printed at the start
            self.assertIn("/login?code=", station_log)
            secrets["code of the first link"] = re.search(r"code=(\S+)", station_log).group(1)
            log.write_text(station_log + "\n".join(text for text, _ in PLANTED.values()) + f"\ntoken {station.token}\n")
            said = place.tool("support-bundle", "--data", place.data, "--to", place.folder / "said.zip", "--json")
            answer = json.loads(said.stdout)
            self.assertIsInstance(answer.pop("problems"), int)
            self.assertEqual(answer, {"file": str(place.folder / "said.zip"),
                                      "size_bytes": (place.folder / "said.zip").stat().st_size})
            files = self.bundle(place, "--log", log, "--config", place.folder / "rheonaut.toml")
            self.assertEqual(set(files), {"README.txt", "doctor.txt", "doctor.json", "versions.json", "config.json",
                                          "metrics.txt", "schema.sql", "tables.json", "parameters.json",
                                          "events.jsonl", "log.txt"})
            for what, secret in [*secrets.items(), *self.secrets_of_database(place.data / "station.sqlite")]:
                self.expect_without(files, what, secret)
            for what, (_, words) in PLANTED.items():
                for word in words:
                    self.expect_without(files, f"what was planted {what}", word)
            self.expect_useful(files)

    def expect_useful(self, files):
        self.assertIn(b"rheonaut_samples_written_total ", files["metrics.txt"])
        self.assertIn(b"rheonaut_commit_seconds_bucket", files["metrics.txt"])
        self.assertIn(b"CREATE TABLE sample", files["schema.sql"])
        self.assertGreater(json.loads(files["tables.json"])["sample"], 0)
        parameters = json.loads(files["parameters.json"])["sim-1"]["parameters"]
        self.assertIn("acceleration_bias_m_s2", parameters)
        self.assertGreater(json.loads(files["versions.json"])["schema"], 1)
        self.assertEqual(json.loads(files["config.json"])["tls.mode"], "on")
        self.assertTrue(json.loads(files["doctor.json"])["findings"])
        events = [json.loads(line) for line in files["events.jsonl"].decode().splitlines()]
        self.assertIn("[removed]", " ".join(event["detail"] for event in events))
        self.assertIn(b"ready: page https://[removed]", files["log.txt"])

    def test_works_without_a_running_station_and_without_a_folder(self):
        with lab() as place:
            place.start_station()
            place.stop_station()
            files = self.bundle(place)
            self.assertIn(b"no station runs", files["metrics.txt"])
            self.assertIn(b"CREATE TABLE sample", files["schema.sql"])
        with lab() as place:
            files = self.bundle(place)
            self.assertIn(b"there is no data folder", files["doctor.txt"])

    def test_a_damaged_database_is_in_the_bundle_as_a_finding(self):
        with lab() as place:
            place.start_station()
            place.stop_station()
            (place.data / "station.sqlite").write_bytes(b"nothing" * 5000)
            place.is_damaged = True
            self.assertIn(b"problem  database", self.bundle(place)["doctor.txt"])


if __name__ == "__main__":
    unittest.main()
