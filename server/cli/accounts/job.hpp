// `rheonaut job`: computations that a running station makes on its recorded runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"

namespace CLI {
class App;
}

namespace server::cli {

inline constexpr int kJobNotDone = 5;  // exit status

struct JobCommand {
  enum class Act : std::uint8_t { begin, list, show, file, cancel };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::filesystem::path file;  // the request as JSON; "-": standard input
  std::filesystem::path to;    // where the job's file is saved
  double timeout_s = kLongAnswer_s;
  std::int64_t job = 0;
  bool waits = false;
  BusyRule busy;  // of a wait
  bool json = false;
};

void add_options(CLI::App& command, JobCommand& options);

// 0, or kJobNotDone of a job that was waited for, or shown, and has failed, was cancelled or interrupted. Throws
// std::runtime_error saying what the station refused.
int run(const JobCommand& options, std::ostream& out);

}  // namespace server::cli
