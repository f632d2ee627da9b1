// `rheonaut reference`: a run's position as it was measured from outside: import, show, export, remove.
//
// Asks the station that runs in the data folder, or changes its database under the folder's lock when none does.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>

#include "server/analysis/reference_import.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct ReferenceCommand {
  enum class Act : std::uint8_t { import, show, export_positions, remove };
  Act act = Act::show;
  std::filesystem::path data_dir = "rheonaut-data";
  OutputForm form;
  double timeout_s = kLongAnswer_s;
  storage::RunId run = 0;
  std::string csv_file;
  std::optional<double> sd_mm, offset_s, utc_s, at_s, clock_sd_s, search_from_s, search_to_s;
  std::string marker;  // its number, or its text
  std::optional<std::uint32_t> span;
  bool keeps_zero = false, is_in_metres = false;
  std::string reason;
};

void add_options(CLI::App& command, ReferenceCommand& options);

int run(const ReferenceCommand& options, std::ostream& out);

}  // namespace server::cli
