// `rheonaut compare`: traces of several runs on one time axis, and how far each is from the first.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "server/cli/analysis/trace_options.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct CompareQuestion {
  std::filesystem::path data_dir = "rheonaut-data";
  double timeout_s = kLongAnswer_s;
  std::vector<std::int64_t> runs;
  std::string channels = "position_m,duty";
  TraceOptions traces;
  OutputForm form;
};

void add_options(CLI::App& command, CompareQuestion& options);

// Throws std::runtime_error saying what the station refused.
int run(const CompareQuestion& options, std::ostream& out);

}  // namespace server::cli
