// Moments of a run on the clock of its robot: what the robot reported as events, and what people marked.
//
// On the thread that owns the handle; one statement each, over the index of a boot.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string>
#include <vector>

#include "server/storage/runs/run.hpp"

namespace server::storage {

inline constexpr std::size_t kMaxRunMoments = 10'000;  // read at once

struct RunMoment {
  std::uint32_t span = 0;  // of the run
  std::uint64_t seq = 0;   // of the sample that was made then
  std::uint64_t robot_time_us = 0;
  std::string name;      // the kind of an event, or the text of a marker
  float position_m = 0;  // of an event, as the robot believed; NaN of a marker
  float value = 0;       // of an event, in the unit of docs/protocol.md; NaN of a marker
};

// Whether a robot can report events of this kind, e.g. "detection".
bool is_event_kind(const std::string& kind);

// In order of time, the first kMaxRunMoments; those that the robot reported of samples of the run. `kinds`: one or
// more.
std::vector<RunMoment> read_run_events(SQLite::Database& database, RunId run, const std::vector<std::string>& kinds);

// In order of time, the first kMaxRunMoments; without those whose boot has nothing stored.
std::vector<RunMoment> read_run_markers(SQLite::Database& database, RunId run);

}  // namespace server::storage
