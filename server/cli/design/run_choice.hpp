// A recorded run as a tool's input: which one, from which station's folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "protocol/messages.hpp"
#include "server/analysis/run_recording.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct RunChoice {
  std::optional<std::int64_t> run;
  std::filesystem::path data_dir = "rheonaut-data";
};

void add_options(CLI::App& command, RunChoice& choice);

// Throws std::runtime_error saying what is wrong; never creates or changes anything.
std::vector<storage::StoredSample> read_samples(const RunChoice& choice);
std::optional<storage::StoredReference> read_reference(const RunChoice& choice);  // none: the run has none
analysis::RunSamples read_run_samples(const RunChoice& choice);                   // with both
// The checksum of the controller that the robot had when the run began; none: not known.
std::optional<std::uint32_t> read_controller_checksum(const RunChoice& choice);
// The controller in force at a sample of a span; none: not known.
std::optional<protocol::Controller> read_controller(const RunChoice& choice, std::uint32_t span, std::uint64_t seq);

}  // namespace server::cli
