// `rheonaut report`: saves the report of a run that a running station makes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>

namespace CLI {
class App;
}

namespace server::cli {

struct ReportQuestion {
  std::filesystem::path data_dir = "rheonaut-data";
  std::int64_t run = 0;
  std::filesystem::path file;
};

void add_options(CLI::App& command, ReportQuestion& options);

// Replaces the file when the report is whole. Throws std::runtime_error saying what the station refused.
int run(const ReportQuestion& options, std::ostream& out);

}  // namespace server::cli
