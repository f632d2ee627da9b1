#!/usr/bin/env python3
"""Shows each rule of check_rules.py a snippet that breaks it, and look-alikes that do not."""
import pathlib
import tempfile
import unittest

import check_rules

FIRST = "// A file of the test.\n"


def long_file(lines, opening=FIRST):
    return opening + "int a;\n" * (lines - 1)


BAD = [
    ("include", "protocol/frame.hpp", FIRST + '#include "server/runtime/clock.hpp"\n'),
    ("include", "control/tuning/tune.cpp", FIRST + '#include "protocol/messages.hpp"\n'),
    ("include", "control/tuning/tune.cpp", FIRST + "#include <boost/asio.hpp>\n"),
    ("include", "robot_fw/core/robot.cpp", FIRST + '#include "control/tuning/tune.hpp"\n'),
    ("include", "robot_fw/core/robot.cpp", FIRST + "#include <vector>\n"),
    ("include", "robot_fw/core/robot.cpp", FIRST + "#include <Arduino.h>\n"),
    ("include", "robot_fw/core/robot.cpp", FIRST + '#include "robot_fw/esp8266/motor.hpp"\n'),
    ("include", "robot_fw/esp8266/motor.cpp", FIRST + '#include "control/tuning/tune.hpp"\n'),
    ("include", "robot_fw/esp8266/motor.cpp", FIRST + "#include <string>\n"),
    ("include", "sim_robot/world/plant.cpp", FIRST + '#include "robot_fw/esp8266/motor.hpp"\n'),
    ("include", "protocol/frame.cpp", FIRST + "#include <chrono>\n"),
    ("include", "sim_robot/world/plant.cpp", FIRST + '#include "server/runtime/clock.hpp"\n'),
    ("include", "server/link/robot_session.cpp", FIRST + '#include "robot_fw/core/robot.hpp"\n'),
    ("include", "server/link/robot_session.cpp", FIRST + '#include "server/storage/ingest/recorder.hpp"\n'),
    ("include", "server/station/station.cpp", FIRST + '#include "server/link/robot_session.hpp"\n'),
    ("include", "server/api/routes/routes_runs.cpp", FIRST + '#include "control/tuning/tune.hpp"\n'),
    ("include", "server/runtime/clock.cpp", FIRST + '#include "server/storage/ingest/recorder.hpp"\n'),
    ("include", "server/new/thing.cpp", FIRST + '#include "server/runtime/clock.hpp"\n'),
    ("include", "server/link/robot_session.cpp", FIRST + '#include "robot_session.hpp"\n'),
    ("seam", "server/runtime/tasks.cpp", FIRST + '#include "server/runtime/real_time.hpp"\n'),
    ("seam", "server/link/robot_session.cpp", FIRST + '#include "server/net/poll_set.hpp"\n'),
    ("link", "protocol/CMakeLists.txt", "# Links.\ntarget_link_libraries(protocol PUBLIC server)\n"),
    ("link", "server/CMakeLists.txt", "# Links.\ntarget_link_libraries(server\n  PUBLIC protocol robot_fw_core)\n"),
    ("include", "control/models/a.cpp", FIRST + '#include "control/tuning/tune.hpp"\n'),
    ("include", "sim_robot/world/a.cpp", FIRST + '#include "sim_robot/robot/robot_life.hpp"\n'),
    ("link", "server/link/CMakeLists.txt", "# Links.\nrheonaut_room(server_link\n  USES\n    server_api)\n"),
    ("room", "server/link/CMakeLists.txt", "# Sources.\nrheonaut_room(server_link\n  SOURCES a.cpp b.cpp)\n"),
    ("co_await", "server/a.cpp", FIRST + "if (co_await f()) g();\n"),
    ("co_await", "server/a.cpp", FIRST + "while (x &&\n       co_await f()) g();\n"),
    ("co_await", "server/a.cpp", FIRST + "switch (co_await f()) { default: break; }\n"),
    ("co_await", "sim_robot/a.cpp", FIRST + "co_await run([id] { return id; });\n"),
    ("co_await", "sim_robot/a.cpp", FIRST + "co_await run([&](int x) { return x; });\n"),
    ("co_await", "server/a.cpp", FIRST + "co_await run(Request{1, 2});\n"),
    ("co_await", "server/a.cpp", FIRST + "const auto x = co_await run(\n    {1, 2});\n"),
    ("task", "server/api/a.cpp", FIRST + "asio::co_spawn(loop, f(), token);\n"),
    ("task", "sim_robot/a.cpp", FIRST + "asio::co_spawn(loop, f(), asio::detached);\n"),
    ("clock", "server/api/a.cpp", FIRST + "auto t = std::chrono::steady_clock::now();\n"),
    ("clock", "server/api/a.cpp", FIRST + "asio::steady_timer timer{loop};\n"),
    ("clock", "server/api/a.cpp", FIRST + "std::this_thread::sleep_for(1s);\n"),
    ("clock", "server/net/a.cpp", FIRST + "stream.expires_after(1s);\n"),
    ("thread", "server/station/a.cpp", FIRST + "std::mutex guard;\n"),
    ("secret", "server/api/a.cpp", FIRST + "return entry.hash == hash_of(text);\n"),
    ("secret", "server/api/a.cpp", FIRST + "if (given != session.secret) return;\n"),
    ("secret", "server/recording/a.cpp", FIRST + "return token == stored;\n"),
    ("secret", "server/a.cpp", FIRST + "return std::memcmp(a, b, 32) == 0;\n"),
    ("words", "server/a.cpp", FIRST + "try {\n} catch (const std::exception& error) {\n  log(error.what());\n}\n"),
    ("size", "server/a.cpp", long_file(601, FIRST + "// LONG: no reason is enough.\n")),
    ("size", "server/a.cpp", long_file(401)),
    ("size", "server/main.cpp", long_file(81)),
    ("name", "server/link/session_manager.cpp", FIRST),
    ("name", "server/utils/text.cpp", FIRST),
    ("name", "server/a.hpp", FIRST + "class RequestHandler;\n"),
    ("name", "web/src/store.ts", FIRST + "interface RobotInfo {}\n"),
    ("text", "server/a.cpp", FIRST + "\tint a;\n"),
    ("text", "docs/a.md", "TODO: write this\n"),
    ("first-line", "server/a.cpp", "#include <vector>\n"),
    ("first-line", "server/a.cpp", "// nothing here\nint a;\n"),
    ("first-line", "tests/a.py", "#!/usr/bin/env python3\nimport sys\n"),
    ("first-line", "server/CMakeLists.txt", "add_library(server STATIC a.cpp)\n"),
]

GOOD = [
    ("server/link/robot_session.cpp", FIRST + '#include "server/net/byte_stream.hpp"\n#include "server/runtime/clock.hpp"\n'),
    ("server/analysis/job.cpp", FIRST + '#include "control/tuning/tune.hpp"\n#include "server/storage/database/database.hpp"\n'),
    ("server/link/robot_listener.hpp", FIRST + '#include "server/net/poll_set.hpp"\n'),
    ("server/main.cpp", FIRST + '#include "server/link/a.hpp"\n#include "server/api/b.hpp"\n'),
    ("robot_fw/esp8266/motor.cpp", FIRST + '#include <Arduino.h>\n#include "robot_fw/core/robot.hpp"\n'),
    ("robot_fw/core/robot.cpp", FIRST + '#include <array>\n#include "protocol/messages.hpp"\n'),
    ("robot_fw/CMakeLists.txt", "# Links.\ntarget_link_libraries(robot_fw PUBLIC protocol PRIVATE project_warnings)\n"),
    ("server/a.cpp", FIRST + "return token == nullptr || size == hash.size() || sodium_memcmp(a, b, 32) == 0;\n"),
    ("server/a.cpp", FIRST + "const bool ok = co_await f();\nif (ok) g();\n"),
    ("server/a.cpp", FIRST + "auto job = [id] { return id; };\nco_await disk.run(std::move(job));\n"),
    ("server/a.cpp", FIRST + "co_await (f(list[i](3)) || clock.sleep_for(time));\nWait w{1};\n"),
    ("server/a.cpp", FIRST + '// if (co_await f()), detached\nlog("if (co_await std::mutex");\n'),
    ("server/runtime/tasks.cpp", FIRST + "asio::co_spawn(loop, f(), token);\n"),
    ("server/runtime/clock.cpp", FIRST + "auto t = std::chrono::steady_clock::now();\n"),
    ("server/runtime/precompiled.hpp", FIRST + "#include <boost/asio/steady_timer.hpp>\n"),
    ("sim_robot/a.cpp", FIRST + "asio::steady_timer timer{loop};\n"),
    ("server/runtime/worker.cpp", FIRST + "std::thread t;\n"),
    ("server/a.cpp", FIRST + "try {\n} catch (const std::invalid_argument& error) {\n  log(error.what());\n}\n"),
    ("server/a.cpp", long_file(450, FIRST + "// LONG: one table.\n")),
    ("web/src/api_types.ts", long_file(900, "// Generated from openapi.yaml.\n")),
    ("tests/CMakeLists.txt", "add_test(a)\n" * 31),
    ("tests/system/process_test.cpp", FIRST),
    ("server/a.hpp", FIRST + "class Processor;\nint handler_count;\n"),
    ("deploy/a.py", '#!/usr/bin/env python3\n"""Says what it does."""\n'),
    ("web/src/style.css", "/* The look of the cockpit. */\n"),
    ("web/node_modules/x/utils.ts", "\tTODO\n"),
]


def rules_broken_by(path, text):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder).resolve()
        file = root / path
        file.parent.mkdir(parents=True)
        file.write_text(text, encoding="utf-8")
        return [fault.split(": ")[1] for fault in check_rules.faults(root)]


class CheckRules(unittest.TestCase):
    def test_finds_each_broken_rule(self):
        for rule, path, text in BAD:
            with self.subTest(rule=rule, path=path, text=text[:120]):
                self.assertEqual(rules_broken_by(path, text), [rule])

    def test_holds_includes_to_the_rooms_that_a_room_says_it_uses(self):
        for uses, broken in (("server_runtime", ["include"]), ("server_runtime\n    server_net", [])):
            with self.subTest(uses=uses), tempfile.TemporaryDirectory() as folder:
                room = pathlib.Path(folder).resolve() / "server/live"
                room.mkdir(parents=True)
                (room / "live_feed.cpp").write_text(FIRST + '#include "server/net/listener.hpp"\n', encoding="utf-8")
                (room / "CMakeLists.txt").write_text(f"# Live.\nrheonaut_room(server_live\n  SOURCES\n    live_feed.cpp\n  USES\n    {uses})\n",
                                                     encoding="utf-8")
                faults = check_rules.faults(pathlib.Path(folder).resolve())
                self.assertEqual([fault.split(": ")[1] for fault in faults], broken)

    def test_bounds_the_files_of_a_room(self):
        with tempfile.TemporaryDirectory() as folder:
            room = pathlib.Path(folder).resolve() / "server/live"
            room.mkdir(parents=True)
            for number in range(check_rules.MOST_FILES_IN_A_ROOM + 1):
                (room / f"part_{number}.hpp").write_text(FIRST, encoding="utf-8")
            (room / "CMakeLists.txt").write_text("# Live.\nrheonaut_room(server_live)\n", encoding="utf-8")
            faults = check_rules.faults(pathlib.Path(folder).resolve())
            self.assertEqual([fault.split(": ")[1] for fault in faults], ["room"])

    def test_knows_the_rooms_of_the_architecture(self):
        text = (pathlib.Path(__file__).parents[1] / "ARCHITECTURE.md").read_text(encoding="utf-8")
        text = text[text.index("## Rooms"):]
        rows = [line.split("|")[1].strip().strip("`/") for line in text.splitlines() if line.startswith("| `")]
        self.assertEqual([row for row in rows if row in check_rules.ROOMS], check_rules.ROOMS)

    def test_finds_nothing_in_sound_files(self):
        for path, text in GOOD:
            with self.subTest(path=path, text=text[:120]):
                self.assertEqual(rules_broken_by(path, text), [])

    def test_has_an_example_for_every_rule(self):
        names = {rule.__doc__.split(":")[0] for rule in check_rules.RULES}
        self.assertEqual(names, {rule for rule, _, _ in BAD})


if __name__ == "__main__":
    unittest.main()
