// `rheonaut export`: a recorded run as a file of CSV, MAT, SQLite or MCAP, read from a station's folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>

#include "server/cli/terminal/output.hpp"
#include "server/storage/export/export_format.hpp"

namespace CLI {
class App;
}

namespace server::cli {

using storage::ExportFormat;

struct Export {
  std::int64_t run = 0;
  ExportFormat format = ExportFormat::csv;
  std::filesystem::path to;
  std::filesystem::path data_dir = "rheonaut-data";
  std::optional<std::int64_t> grid_us;
  std::string channels;  // empty: all
  OutputForm form;
};

void add_options(CLI::App& command, Export& options);

// Throws std::runtime_error saying what is wrong; the file is there as a whole or not at all.
int run(const Export& options, std::ostream& out);

}  // namespace server::cli
