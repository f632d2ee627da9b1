// `rheonaut metrics`: the metrics of runs, as a running station computes and keeps them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <vector>

#include "server/cli/terminal/options.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct MetricsQuestion {
  std::filesystem::path data_dir = "rheonaut-data";
  double timeout_s = kLongAnswer_s;
  std::vector<std::int64_t> runs;
  bool json = false;
};

void add_options(CLI::App& command, MetricsQuestion& options);

// Prints the metrics of one run, or of several side by side. Throws std::runtime_error saying what the station refused.
int run(const MetricsQuestion& options, std::ostream& out);

}  // namespace server::cli
