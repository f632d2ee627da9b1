// What the database must hold by the acknowledgements to robots and people; and the comparison.
//
// A RecordingTruth is kept outside the station. The audit reads tables, not the recorder, and returns a sentence for
// each fault: empty is good.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/station/state/station_state.hpp"
#include "server/storage/samples/interval_set.hpp"

namespace server {

struct BootTruth {
  station::RobotId robot_id;
  float impedance_mv = 0;          // of all its samples, and of no other boot's
  std::uint64_t made = 0;          // samples; sample n has position_m n/1000
  std::uint64_t acknowledged = 0;  // the robot was sent that all below is durable
  storage::IntervalSet let_go;     // samples that the robot lost before they were acknowledged
  std::uint64_t events_made = 0;   // event n has the value n
  std::uint64_t events_acknowledged = 0;
  storage::IntervalSet events_let_go;
  bool ended = false;  // the robot has rebooted
};

struct CommandTruth {
  bool is_stop = false;
  station::CommandState latest = station::CommandState::queued;
  std::optional<station::CommandState> flushed;  // the latest that was said to be durable
};

struct RecordingTruth {
  std::uint64_t store_id = 0;  // 0: no robot was sent one
  std::map<station::BootId, BootTruth> boots;
  std::map<station::CommandId, CommandTruth> commands;
  std::set<std::uint64_t> station_events;  // that were said to be durable; by sample_seq
  std::set<std::int64_t> runs;             // that were answered
};

using Faults = std::vector<std::string>;

// After a restart, before any robot has said what it still holds.
Faults audit(SQLite::Database& database, const RecordingTruth& truth);

// At the end, when every robot has sent all it held: also nothing is missing.
Faults audit_complete(SQLite::Database& database, const RecordingTruth& truth);

}  // namespace server
