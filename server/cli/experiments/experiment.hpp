// `rheonaut experiment`: profiles that robots of a running station perform.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace CLI {
class App;
}

namespace server::cli {

inline constexpr int kExperimentNotDone = 5;  // exit status

struct ExperimentCommand {
  enum class Act : std::uint8_t { begin, list, show, pause, resume, abort, take_over, move };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string profile;  // a name, or a file
  std::string robot;
  std::string notes, reason;
  std::int64_t experiment = 0, before = 0, priority = 0;
  bool is_unattended = false, waits = false, json = false;
};

void add_options(CLI::App& command, ExperimentCommand& options);

// "experiment 3 (Figure 7) is aborted: the robot is in emergency", of an experiment as the API has it.
std::string outcome_of(const nlohmann::json& experiment);

// 0, or kExperimentNotDone of an experiment that was waited for and has not come to its end. While it waits, it is the
// sign of life of the one in whose name the experiment runs; SIGINT aborts the experiment. Throws std::runtime_error
// saying what the station refused.
int run(const ExperimentCommand& options, std::ostream& out);

}  // namespace server::cli
