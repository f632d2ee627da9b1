// The texts of the states, and counts of them.
#include "server/storage/experiments/experiment.hpp"

#include <array>

namespace server::storage {
namespace {

constexpr std::array kExperimentStates{
    ExperimentState::waiting, ExperimentState::running, ExperimentState::paused,    ExperimentState::aborting,
    ExperimentState::done,    ExperimentState::aborted, ExperimentState::cancelled, ExperimentState::interrupted};

}  // namespace

const char* text(ExperimentState value) {
  switch (value) {
    case ExperimentState::waiting: return "waiting";
    case ExperimentState::running: return "running";
    case ExperimentState::paused: return "paused";
    case ExperimentState::aborting: return "aborting";
    case ExperimentState::done: return "done";
    case ExperimentState::aborted: return "aborted";
    case ExperimentState::cancelled: return "cancelled";
    case ExperimentState::interrupted: return "interrupted";
  }
  return "interrupted";
}

std::optional<ExperimentState> experiment_state_from(const std::string& given) {
  for (const ExperimentState state : kExperimentStates) {
    if (given == text(state)) return state;
  }
  return std::nullopt;
}

RunCounts counts_of(const std::vector<ExperimentRun>& runs) {
  RunCounts counts;
  for (const ExperimentRun& run : runs) ++counts[run.state];
  return counts;
}

}  // namespace server::storage
