// `rheonaut stop`: the emergency stop of some robots, or of all, through the station that runs in the data folder.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct StopCommand {
  std::filesystem::path data_dir = "rheonaut-data";
  std::vector<std::string> robots;  // none: all robots of the station
  bool is_all = false;
  OutputForm form;
};

void add_options(CLI::App& command, StopCommand& options);

// A line for each robot: whether it has confirmed, and after how many ms; flushed at once, before the reasons of those
// that have not are asked for. As JSON it is one document, with the reasons. 0 when each has, else kNotConfirmed. Takes
// at most 8 s, whatever the station does, and asks nothing. Throws std::runtime_error when the station answers for no
// robot at all; it says whether nothing was stopped, or whether that is not known.
inline constexpr int kNotConfirmed = 5;
int run(const StopCommand& options, std::ostream& out);

}  // namespace server::cli
