"""What a command says when its station is gone, or is another program: one line of words, the cause in them, and the exit
status 1. No command shows a library's text."""
import contextlib
import json
import re
import socketserver
import threading
import unittest

from processes import lab

COMMANDS = """
stop sim-1|stop --all|watch --once|robot parameters sim-1|robot controller sim-1|robot reservations sim-1|fluid list
login-link|job list|job show 1|job cancel 1|metrics 1|compare 1 2|impedance-map 1|report 1 --to OUT|capsule 1 --to OUT
design list|experiment list|experiment show 1|experiment abort 1|experiment begin figure_7 --robot sim-1
""".strip().replace("\n", "|").split("|")
ANSWERS = {
    "it closes": b"",
    "half a head": b"HTTP/1.1 200 OK\r\nContent-Le",
    "half a body": b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n{",
    "no HTTP": b"SSH-2.0-OpenSSH_9.2\r\n",
    "no JSON": b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello",
    "other JSON": b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n[]",
}


@contextlib.contextmanager
def program_that_says(answer):
    """The address of one that reads a request, says this, and closes."""
    class Says(socketserver.BaseRequestHandler):
        def handle(self):
            self.request.recv(65536)
            self.request.sendall(answer)

    class Server(socketserver.ThreadingTCPServer):
        daemon_threads = True

    with Server(("127.0.0.1", 0), Says) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
        try:
            yield f"127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()


class ErrorsTest(unittest.TestCase):
    def assert_in_words(self, place, command, situation):
        words = [str(place.folder / "out") if word == "OUT" else word for word in command.split()]
        ran = place.tool(*words, "--data", place.data)
        with self.subTest(command=command, situation=situation, error=ran.stderr, output=ran.stdout):
            self.assertNotIn(ran.returncode, (0, 2))
            lines = ran.stderr.splitlines()
            self.assertEqual(len(lines), 1)
            self.assertTrue(lines[0].startswith("rheonaut: "))
            self.assertLess(len(lines[0]), 300)
            self.assertIsNone(re.search(r"::|<.*>|\.[ch]pp|\[[a-z.]*[: ]|exception|what\(\)", lines[0]))
            if command.startswith("stop"):
                self.assertRegex(lines[0], "^rheonaut: (NOTHING WAS STOPPED by this command|IT IS NOT KNOWN whether anything was stopped)"
                                           ": switch the robots off by hand; ")

    def test_each_command_says_in_one_line_why_there_is_no_answer(self):
        with lab() as place:
            place.start_station()
            place.kill_station()
            for command in COMMANDS:
                self.assert_in_words(place, command, "nothing listens")
            file = place.data / "endpoints.json"
            announced = json.loads(file.read_text())
            for situation, answer in ANSWERS.items():
                with program_that_says(answer) as http:
                    file.write_text(json.dumps(announced | {"http": http}))
                    few = ["stop --all", "fluid list", "job list"] + ["report 1 --to OUT"] * ("JSON" not in situation)  # it saves what comes
                    for command in COMMANDS if situation == "it closes" else few:
                        self.assert_in_words(place, command, situation)


if __name__ == "__main__":
    unittest.main()
