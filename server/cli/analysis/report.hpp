// `rheonaut report`: saves the report of a run, or of several beside each other, that a running station makes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <vector>

#include "server/cli/analysis/trace_options.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct ReportQuestion {
  std::filesystem::path data_dir = "rheonaut-data";
  double timeout_s = kLongAnswer_s;
  std::vector<std::int64_t> runs;
  TraceOptions traces;  // of several
  std::filesystem::path file;
  OutputForm form;
};

void add_options(CLI::App& command, ReportQuestion& options);

// Replaces the file when the report is whole. Throws std::runtime_error saying what the station refused.
int run(const ReportQuestion& options, std::ostream& out);

}  // namespace server::cli
