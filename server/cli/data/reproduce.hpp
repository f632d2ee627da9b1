// `rheonaut reproduce`: whether the .eln archive of a run is whole, and its metrics and plots come out again.
#pragma once

#include <filesystem>
#include <iosfwd>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Reproduce {
  std::filesystem::path file;
  OutputForm form;
};

void add_options(CLI::App& command, Reproduce& options);

// 0: all is whole and comes out again; 1: a file is damaged, or a number differs; 2: it cannot be read, the reason is
// on standard error.
int run(const Reproduce& options, std::ostream& out);

}  // namespace server::cli
