// The station of a data folder as the doctor sees it from outside: whether it runs, answers, and what it says.
//
// Every wait ends within some seconds. Errors: none are thrown; what could not be asked is in `problem`.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "server/cli/health/findings.hpp"
#include "server/config/config.hpp"

namespace server::cli {

struct RunningStation {
  bool is_running = false;                        // the folder is locked
  bool has_announcement = false;                  // endpoints.json is there
  bool answers = false;                           // its loop answered within 5 s
  int pid = 0;                                    // of endpoints.json; 0: not known
  std::string http, robots;                       // addresses of endpoints.json
  std::string problem;                            // why it was not asked; empty: it was
  nlohmann::json station, recording, robot_list;  // its answers; null: none
};

RunningStation look_for_station(const std::filesystem::path& data_dir);

// Whether it runs and answers, its version, what it says of its recording; a stale endpoints.json.
void check_station(const RunningStation& running, const std::filesystem::path& data_dir, Findings& findings);

// Who listens on the ports of the station, or of the configuration where none runs.
void check_ports(const RunningStation& running, const config::Config& config, Findings& findings);

}  // namespace server::cli
