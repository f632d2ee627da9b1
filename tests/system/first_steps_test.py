"""What a person does first, with real programs: a robot that finds the station by its folder, links into the page, and
ports that are taken."""
import json
import socket
import subprocess
import unittest
import urllib.error
import urllib.request

from processes import BIN, lab, wait_until


def taken_port():
    """A socket that listens, and its address."""
    taken = socket.create_server(("127.0.0.1", 0))
    return taken, f"127.0.0.1:{taken.getsockname()[1]}"


def opened(url, body=None, **headers):
    """Status and body of the answer."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, body, headers), timeout=60) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def pressed(link):
    """The same of the button on the page of a one-time link."""
    origin, code = link.split("/login?code=")
    headers = {"Content-Type": "application/json", "Origin": origin}
    return opened(origin + "/api/v1/login", json.dumps({"code": code}).encode(), **headers)


class FirstStepsTest(unittest.TestCase):
    def test_a_robot_finds_the_station_by_its_folder(self):
        for tls in (False, True):
            with self.subTest(tls=tls), lab(config='[tls]\nmode = "on"\n' if tls else None) as place:
                if tls:
                    self.assertEqual(place.tool("certificate", "--data", place.data).returncode, 0)
                station = place.start_station()
                with open(place.folder / "out", "wb") as out, open(place.folder / "errors", "wb") as errors:
                    place.processes.append(subprocess.Popen([BIN / "rheonaut-sim", "--data", place.data, "--id", "found"],
                                                            stdout=out, stderr=errors, stdin=subprocess.DEVNULL))
                station.wait_for_robot("found")
                wait_until(lambda: "connected to 127.0.0.1:" in (place.folder / "errors").read_text(), 60,
                           "a message of the link")
                self.assertEqual((place.folder / "out").read_text(), "", "standard output is for results")

    def test_a_link_works_once_and_then_leads_to_a_page_that_says_what_to_do(self):
        with lab() as place:
            place.start_station()
            made = place.tool("login-link", "--data", place.data)
            self.assertEqual((made.returncode, made.stderr), (0, ""))
            url = made.stdout.strip()
            self.assertRegex(url, r"^http://127\.0\.0\.1:\d+/login\?code=\S{40,}$")
            for _ in range(2):  # a preview uses nothing up
                status, page = opened(url)
                self.assertEqual(status, 200)
                self.assertIn('<div id="cockpit">', page, "the cockpit, with a button")
            self.assertEqual(pressed(url)[0], 200)
            status, refusal = pressed(url)
            self.assertEqual(status, 401)
            self.assertIn("make a new one", refusal)

    def test_a_port_that_is_taken_is_one_sentence_and_is_not_replaced(self):
        taken, address = taken_port()
        text = f"cannot listen on {address}: another program listens there; stop it, or choose another port"
        with taken, lab() as place:
            for flags in (("--http", address, "--robots", "127.0.0.1:0"), ("--robots", address, "--http", "127.0.0.1:0")):
                done = place.tool("serve", "--data", place.data, *flags)
                self.assertEqual(done.returncode, 1)
                self.assertEqual(done.stderr.splitlines()[-1], f"rheonaut: {text}")
            for arguments in (("proxy", "--listen", address, "--to", "127.0.0.1:1"),
                              ("--station", "127.0.0.1:1", "--faults", address)):
                done = subprocess.run([BIN / "rheonaut-sim", *arguments], capture_output=True, text=True, timeout=60,
                                      stdin=subprocess.DEVNULL)
                self.assertEqual(done.returncode, 1)
                self.assertTrue(done.stderr.endswith(f"rheonaut-sim: {text}\n"), done.stderr)


if __name__ == "__main__":
    unittest.main()
