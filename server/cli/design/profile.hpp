// `rheonaut profile`: lists experiment profiles, checks one and predicts its runs.
#pragma once

#include <optional>
#include <string>

#include "server/cli/design/control_files.hpp"
#include "server/cli/design/discretise.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {

struct ProfileQuestion {
  std::optional<std::string> profile;  // name or file; none: the list of those that come with the program
  PlantChoice plant;                   // none: (28) in water, (29) elsewhere
  ControllerChoice controller;
  Sampling sampling;
  bool prints_text = false, prints_keys = false;
  std::uint64_t run = 1;  // of the grid: whose prediction is printed sample by sample
  OutputForm form;
};

void add_options(CLI::App& command, ProfileQuestion& options);

// 3 when a predicted run leaves the limits of its profile.
int run(const ProfileQuestion& options, std::ostream& out);

}  // namespace server::cli
