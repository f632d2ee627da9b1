// `rheonaut watch`: the robots of the running station at this moment, in a table that is drawn again and again.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct WatchCommand {
  std::filesystem::path data_dir = "rheonaut-data";
  std::vector<std::string> robots;  // none: all
  bool is_once = false;
  double every_s = 0.2;
  OutputForm form;
};

void add_options(CLI::App& command, WatchCommand& options);

// With --once to `out`; else to standard output, until an interrupt, `q`, or an output that nobody reads. Returns 0, or
// 1 when the station does not answer --once. A terminal is as it was when this returns.
int run(const WatchCommand& options, std::ostream& out);

// The table of robots as the API has them, in lines of at most `columns` characters; `with_colours`: with ANSI colours.
// A position stands with its ±. SAFETY: what is older than 1 s, or of a robot that is not connected, stands in
// brackets.
std::vector<std::string> watch_lines(const nlohmann::json& robots, std::int64_t now_us, std::size_t columns,
                                     bool with_colours);

}  // namespace server::cli
