"""Limits of the system and signals: they end no station without a word, and lose nothing."""
import os
import resource
import signal
import unittest

from processes import BIN, PATIENCE_S, lab, wait_until

NFS = {"LD_PRELOAD": str(BIN / "failing_disk.so"), "RHEONAUT_DISK_TYPE": "0x6969",
       "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"}


class LimitsTest(unittest.TestCase):
    def test_a_file_that_may_not_grow_is_a_full_disk(self):
        """Stops go on; what was not stored is stored when the limit is gone, and nothing is missing."""
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            run_id = station.post("/api/v1/runs", {"robot_id": "sim-1", "name": "limited"})["run_id"]
            pid = place.station_process.pid
            unlimited = resource.prlimit(pid, resource.RLIMIT_FSIZE)
            written = max((place.data / name).stat().st_size for name in ("station.sqlite", "station.sqlite-wal"))
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (written + 50_000, unlimited[1]))
            wait_until(lambda: station.request("GET", "/readyz")[0] == 503, 60, "the recording has failed")
            self.assertIsNone(place.station_process.poll(), "the station lives")
            self.assertEqual(station.request("POST", "/api/v1/robots/sim-1/emergency-stop")[0], 200)
            wait_until(lambda: station.robot("sim-1")["mode"] == "emergency", 30, "it is stopped")
            resource.prlimit(pid, resource.RLIMIT_FSIZE, unlimited)
            wait_until(lambda: station.request("GET", "/readyz")[0] == 200, 60, "it records again")
            station.post(f"/api/v1/runs/{run_id}/end", {})
            wait_until(lambda: station.get(f"/api/v1/runs/{run_id}/certificate")["final"], 60, "the certificate")
            self.assertEqual(station.get(f"/api/v1/runs/{run_id}/certificate")["samples_lost"], 0)
            self.assertEqual(place.stop_station(), 0)

    def test_signals_of_resources_end_nothing(self):
        with lab() as place:
            station = place.start_station()
            robot = place.start_robot(station)
            station.wait_for_robot("sim-1")
            for process in (place.station_process, robot):
                for number in (signal.SIGXFSZ, signal.SIGXCPU, signal.SIGPIPE):
                    process.send_signal(number)
            seen = station.robot("sim-1")["next_seq"]
            wait_until(lambda: station.robot("sim-1")["next_seq"] > seen + 50, 30, "50 more samples")
            self.assertEqual(place.stop_station(), 0)

    def test_signals_while_it_stops_are_ignored_with_one_line(self):
        with lab() as place:
            station = place.start_station()
            place.start_robot(station)
            station.wait_for_robot("sim-1")
            process = place.station_process
            process.send_signal(signal.SIGTERM)
            wait_until(lambda: "stopping on SIGTERM" in place.log("station"), 30, "it stops")
            while process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.send_signal(signal.SIGINT)
            self.assertEqual(process.wait(timeout=PATIENCE_S), 0)
            self.assertIn("stopped", place.log("station"))
            self.assertLessEqual(place.log("station").count("again: it is stopping"), 1)

    def test_a_new_store_on_a_network_disk_is_refused_in_words(self):
        with lab() as place:
            place.start_unannounced("127.0.0.1:0", "127.0.0.1:0", environment=NFS)
            self.assertEqual(place.station_process.wait(timeout=PATIENCE_S), 1)
            said = place.log("station")
            self.assertIn("is on NFS, where a store can be damaged", said)
            self.assertIn("--any-file-system", said)
            self.assertFalse((place.data / "station.sqlite").exists())
            self.assertFalse(place.data.exists())
            place.start_unannounced("127.0.0.1:0", "127.0.0.1:0", config="[data]\nany_file_system = true\n", environment=NFS)
            wait_until(lambda: (place.data / "endpoints.json").exists(), PATIENCE_S, "it runs")
            wait_until(lambda: place.log("station").count("is on NFS") == 2, PATIENCE_S, "it warns")
            self.assertEqual(place.stop_station(), 0)
            place.start_unannounced("127.0.0.1:0", "127.0.0.1:0", config="", environment=NFS)  # a store that is there
            wait_until(lambda: (place.data / "endpoints.json").exists(), PATIENCE_S, "it runs")
            self.assertEqual(place.stop_station(), 0)


if __name__ == "__main__":
    unittest.main()
