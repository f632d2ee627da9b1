// `rheonaut impedance-map`: impedance against position, of one run or of several together.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <vector>

#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct ImpedanceMapQuestion {
  std::filesystem::path data_dir = "rheonaut-data";
  double timeout_s = kLongAnswer_s;
  std::vector<std::int64_t> runs;
  int bin_mm = 5;
  OutputForm form;
};

void add_options(CLI::App& command, ImpedanceMapQuestion& options);

// Throws std::runtime_error saying what the station refused.
int run(const ImpedanceMapQuestion& options, std::ostream& out);

}  // namespace server::cli
