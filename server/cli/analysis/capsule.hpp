// `rheonaut capsule`: saves a run of a running station as an .eln archive.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>

#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct CapsuleQuestion {
  std::filesystem::path data_dir = "rheonaut-data";
  double timeout_s = kLongAnswer_s;
  std::int64_t run = 0;
  std::filesystem::path file;
  OutputForm form;
};

void add_options(CLI::App& command, CapsuleQuestion& options);

// Replaces the file when the archive is whole. Throws std::runtime_error saying what the station refused.
int run(const CapsuleQuestion& options, std::ostream& out);

}  // namespace server::cli
