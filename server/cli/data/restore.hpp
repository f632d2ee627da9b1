// `rheonaut restore`: a backup becomes the database of a data folder that has none.
#pragma once

#include <filesystem>
#include <iosfwd>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Restore {
  std::filesystem::path from;
  std::filesystem::path data_dir = "rheonaut-data";
  OutputForm form;
};

void add_options(CLI::App& command, Restore& options);

// Never replaces a database. Throws std::runtime_error saying why nothing was restored.
int run(const Restore& options, std::ostream& out);

}  // namespace server::cli
