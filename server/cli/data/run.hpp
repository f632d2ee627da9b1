// `rheonaut run`: makes a run of a running station final whose robot does not come back.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>

namespace CLI {
class App;
}

namespace server::cli {

struct RunCommand {
  std::filesystem::path data_dir = "rheonaut-data";
  std::int64_t run = 0;
  std::optional<std::uint64_t> samples;  // that are missing, and are to be given up
  bool json = false;
};

void add_options(CLI::App& command, RunCommand& options);

// Without `samples` it gives up nothing, and throws std::runtime_error saying how many are missing. It also throws when
// the station refuses.
int run(const RunCommand& options, std::ostream& out);

}  // namespace server::cli
