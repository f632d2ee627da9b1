// `rheonaut backup`: a verified copy of a station's database, also while the station runs.
#pragma once

#include <filesystem>
#include <iosfwd>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Backup {
  std::filesystem::path data_dir = "rheonaut-data";
  std::filesystem::path to;
  OutputForm form;
};

void add_options(CLI::App& command, Backup& options);

// Never replaces a file. Throws std::runtime_error saying why there is no backup.
int run(const Backup& options, std::ostream& out);

}  // namespace server::cli
