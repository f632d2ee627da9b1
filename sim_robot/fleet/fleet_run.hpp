// Runs a fleet to its end: rates each second, a summary, and an exit status.
#pragma once

#include <chrono>
#include <iosfwd>
#include <string>
#include <vector>

#include "sim_robot/client/station_connection.hpp"
#include "sim_robot/fleet/replay.hpp"
#include "sim_robot/scenario/scenario.hpp"

namespace sim_robot {

constexpr int kMostRobots = 28'000;  // beyond, one address has no ports left

struct FleetOptions {
  StationAddress station;
  int robots = 1;
  std::string id_prefix = "sim";           // robots are PREFIX-1 to PREFIX-N
  double duration_s = 0;                   // 0: until SIGINT or SIGTERM
  bool json = false;                       // JSON lines
  std::chrono::milliseconds handshake{0};  // see RobotClient
  std::vector<TimedFault> faults;          // of each robot, in its own time
  std::string ledger;                      // replay only: a file for what each robot knows at the end; empty: none
};

// Robots of one kind: each has its own id, boot id and seed (the kind's seed and those that follow).
// Returns the exit status: 0 when nothing was lost, 2 when no robot was ever admitted, else 1; the summary says why.
int run_fleet(const FleetOptions& options, const SimulatedRobotConfig& kind, std::ostream& out);

// Robots that replay a recording, `rate` times as fast as it was made, each from its beginning.
int run_replay(const FleetOptions& options, const std::string& token, const Recording& recording, double rate,
               std::ostream& out);

}  // namespace sim_robot
