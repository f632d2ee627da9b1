// Answered commands that carried an idempotency key: a repeated request gets the result of the first and sends nothing.
// The oldest are forgotten; the robot itself never runs one of its last 64 commands twice. Loop thread.
#pragma once

#include <deque>
#include <unordered_map>

#include "server/station/state/station_state.hpp"

namespace server::station {

// SAFETY: of a command that is known from the database only. A stop of then is no answer to a press of now.
inline constexpr std::int64_t kLongAgoUs = -3'600'000'000;

class RecentCommands {
 public:
  static constexpr std::size_t kMaxCommands = 1000;

  struct Entry {
    CommandRecord record;
    std::int64_t answered_us = 0;  // steady
  };

  void put(const CommandRecord& record, std::int64_t now_us);  // a known one is replaced and keeps its time
  const Entry* find(CommandId id) const;                       // null when it is not known, or forgotten

 private:
  std::unordered_map<CommandId, Entry> entries_;
  std::deque<CommandId> order_;  // oldest first
};

// The same request of the same actor for the same robot has the same id, also after a restart of the station. Never 0.
CommandId command_id_of(const RobotId& robot_id, const std::string& actor, const std::string& key);

// 1 to 64 characters of [A-Za-z0-9._:-].
bool is_command_key(const std::string& key);

}  // namespace server::station
