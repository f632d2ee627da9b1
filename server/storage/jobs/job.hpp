// A job as a value: a computation that somebody asked the station for, and what became of it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace server::storage {

using JobId = std::int64_t;

enum class JobState : std::uint8_t {
  waiting,
  running,
  done,
  failed,
  cancelled,
  interrupted,  // the station stopped before it had ended
};
const char* text(JobState value);
std::optional<JobState> job_state_from(const std::string& text);
inline bool has_ended(JobState state) { return state > JobState::running; }

struct JobRequest {
  std::string kind;             // e.g. "identify"
  std::string document = "{}";  // what was asked for, as JSON
  std::string owner;            // the actor
};

struct JobProgress {
  double share = 0;   // 0 to 1
  std::string stage;  // in words
};

struct Job {
  JobId id = 0;
  JobState state = JobState::waiting;
  JobRequest request;
  std::int64_t created_at_us = 0;  // UTC, as the next
  std::optional<std::int64_t> started_at_us, ended_at_us;
  std::string error;                    // of a failed one, in words
  std::optional<JobProgress> progress;  // of a running one
  bool is_being_cancelled = false;      // it ends at its next look
};

}  // namespace server::storage
