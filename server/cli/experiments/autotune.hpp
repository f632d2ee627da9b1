// `rheonaut autotune`: from an identification experiment to a controller that was seen to work, in one command.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>

#include "server/cli/design/identify.hpp"
#include "server/cli/experiments/autotune_chain.hpp"

namespace CLI {
class App;
}

namespace server::cli {

// Exit status: nothing meets the specification; a stage did not end well.
inline constexpr int kNothingMeetsIt = 3, kStageEnded = 5;

struct Autotune {
  std::filesystem::path data_dir = "rheonaut-data";
  AutotuneRequest request;
  control::IdentificationOptions search = usual_search();
  std::string profile = "identification_set", verify_profile = "figure_7";  // names, or files in TOML or JSON
  double tone_amplitude_m = 0.02;                                           // of a model-free identification
  std::optional<std::filesystem::path> resume;
  bool json = false;
};

void add_options(CLI::App& command, Autotune& options);

// Asks the station that runs in the folder; progress goes to standard error. Throws std::runtime_error saying what the
// station refused.
int run(const Autotune& options, std::ostream& out);

// The same with any station and any place for the progress.
int run(const Autotune& options, const AskStation& ask, std::ostream& out, std::ostream& progress);

}  // namespace server::cli
