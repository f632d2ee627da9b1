"""The tables that check_rules.py holds includes and links to: folders, rooms and seams, as ARCHITECTURE.md gives them."""
FOLDERS = ("base", "protocol", "control", "robot_fw", "sim_robot", "server")

# Who may include whom. A folder may always include itself; inside it the order of ROOMS holds.
MAY_INCLUDE = {
    "base": set(),
    "protocol": set(),
    "control": {"base"},
    "robot_fw": {"protocol"},
    "sim_robot": {"base", "robot_fw", "protocol", "control"},
    "server": {"base", "protocol"},  # ROOMS_WITH_CONTROL also control
}
# Rooms from the lowest to the highest: each may include those before it, if its CMakeLists.txt says that it uses them.
# ARCHITECTURE.md lists them in this order. server/main.cpp and sim_robot/main.cpp stand above all.
ROOMS = """
base base/command_line base/failures base/tls
control/models control/responses control/sensor control/search control/evidence control/identification control/discretisation
control/tuning sim_robot/world sim_robot/robot sim_robot/network sim_robot/faults sim_robot/scenario sim_robot/lab
sim_robot/client sim_robot/fleet sim_robot/proxy sim_robot/cli
server/runtime server/config server/tls server/net
server/station/state server/station/commands server/station server/station/models server/link server/live server/live/foxglove
server/storage/database server/storage/audit server/storage/samples server/storage/commits server/storage/ingest server/storage/groups
server/storage/runs server/storage/finalizing server/storage/jobs server/storage/designs server/storage/experiments server/storage/reservations
server/storage/query server/storage/export server/storage/export/mat server/storage/export/mcap server/storage/upkeep server/storage
server/analysis/metrics server/analysis/comparison server/analysis/report server/analysis/capsule server/analysis/search server/analysis server/analysis/tuning
server/analysis/documents server/experiments server/experiments/adaptive server/experiments/runner server/identity server/http
server/api/bodies server/api/routes server/api/analysis server/api/experiments server/api server/cli/terminal server/cli/design
server/cli/accounts server/cli/robots server/cli/analysis server/cli/data server/cli/experiments server/cli/commission server/cli/health server/cli server/exporter
""".split()
ROOMS_WITH_CONTROL = {"server/" + room for room in "analysis analysis/metrics analysis/search analysis/tuning experiments experiments/adaptive experiments/runner cli/design".split()}
# What decides only about the order of work, and the files of server/ that know it ("Threads of the station").
SEAMS = {
    "server/net/poll_set.hpp": {"server/net/poll_set.cpp", "server/net/byte_stream.cpp", "server/link/robot_listener.hpp"},
    "server/runtime/turns.hpp": {"server/runtime/turns.cpp", "server/live/robot_texts.hpp", "server/api/live_messages.hpp"},
    "server/runtime/real_time.hpp": {"server/runtime/real_time.cpp", "server/main.cpp"},
}
MOST_FILES_IN_A_ROOM = 26  # .cpp and .hpp
# Libraries that a folder must not see (beginnings of <...>).
FOREIGN = {
    "base": ("boost/", "Eigen/", "spdlog/", "SQLiteCpp/", "pb"),
    "base/failures": ("Eigen/", "spdlog/", "SQLiteCpp/", "pb"),  # it names the causes of Asio and Beast
    "protocol": ("boost/", "Eigen/", "nlohmann/", "spdlog/", "SQLiteCpp/"),
    "control": ("boost/", "nlohmann/", "spdlog/", "SQLiteCpp/", "pb"),
    "robot_fw/core": ("boost/", "Eigen/", "nlohmann/", "spdlog/", "SQLiteCpp/", "Arduino", "ESP8266", "Wire", "WiFi"),
    "robot_fw/esp8266": ("boost/", "Eigen/", "nlohmann/", "spdlog/", "SQLiteCpp/"),
}
# What a robot has not: heap, streams, threads, clocks.
NOT_ON_THE_ROBOT = set("vector string map set list deque unordered_map unordered_set memory functional iostream sstream "
                       "fstream chrono thread mutex future atomic new any regex".split())
