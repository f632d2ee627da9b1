// The names of the states.
#include "server/storage/jobs/job.hpp"

#include <array>

namespace server::storage {

const char* text(JobState value) {
  switch (value) {
    case JobState::waiting: return "waiting";
    case JobState::running: return "running";
    case JobState::done: return "done";
    case JobState::failed: return "failed";
    case JobState::cancelled: return "cancelled";
    case JobState::interrupted: return "interrupted";
  }
  return "";
}

std::optional<JobState> job_state_from(const std::string& given) {
  constexpr std::array kStates{JobState::waiting, JobState::running,   JobState::done,
                               JobState::failed,  JobState::cancelled, JobState::interrupted};
  for (const JobState state : kStates) {
    if (given == text(state)) return state;
  }
  return std::nullopt;
}

}  // namespace server::storage
