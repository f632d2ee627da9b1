// `rheonaut demo`: a station and a simulated robot on this machine, and the closed loop of the paper's Figure 7.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>

namespace CLI {
class App;
}

namespace server::cli {

struct Demo {
  std::filesystem::path data_dir = "rheonaut-demo";
  std::uint32_t seed = 21;  // of the simulated sensors' noise
  bool is_once = false;
  bool is_json = false;  // with is_once
};

void add_options(CLI::App& command, Demo& options);

// Starts both programs, prints a link to the page, performs the experiment and prints what was measured; then it waits
// for SIGINT or SIGTERM, unless is_once, and ends both. What happens is printed at once, with is_json on standard error
// and one document on `out` at the end. 0, or kExperimentNotDone, whose reason is on standard error.
// Throws std::runtime_error saying what did not start.
int run(const Demo& options, std::ostream& out);

}  // namespace server::cli
