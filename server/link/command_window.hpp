// Limits the commands that a robot has not acknowledged, since it can keep 8 acknowledgements only.
//
// Two places are reserved for an emergency stop and its repetition, which are not counted here. A command takes a place
// from when it is written until it is answered. A timed command may be answered twice, the second time when the robot
// drops it, and the robot drops all of them together: so it takes two places, and one from its first answer until its
// time has passed. Pure.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "server/station/state/station_state.hpp"

namespace server::link {

class CommandWindow {
 public:
  static constexpr std::size_t kMost = 6;
  // An answer that has not come so long after the end of the command's validity never comes, and holds its place no
  // longer.
  static constexpr std::int64_t kAnswerGraceUs = 1'000'000;

  bool has_room(const protocol::Command& command, std::int64_t now_us) {
    std::erase_if(written_, [now_us](const Written& one) { return now_us >= one.deadline_us + kAnswerGraceUs; });
    std::size_t taken = places(command);
    for (const Written& one : written_) taken += one.places;
    return taken <= kMost;
  }
  void written(const protocol::Command& command, std::int64_t deadline_us) {
    written_.push_back({command.command_id, deadline_us, places(command)});
  }
  void answered(const protocol::CommandAck& ack) {
    const auto found = std::ranges::find(written_, ack.command_id, &Written::id);
    if (found == written_.end()) return;
    const bool may_be_dropped = found->places == 2 && ack.result == rheonaut_COMMAND_RESULT_ACCEPTED;
    if (!may_be_dropped) return ended(ack.command_id);
    found->places = 1;
    found->due_robot_us = ack.effect_at_robot_us;
  }
  void ended(station::CommandId id) {
    std::erase_if(written_, [id](const Written& one) { return one.id == id; });
  }
  // By a frame that robots send after every acknowledgement that is due. Two ticks after its time a command has run, or
  // was dropped.
  void robot_time_is(std::uint64_t robot_time_us, std::uint32_t tick_us) {
    std::erase_if(written_, [robot_time_us, tick_us](const Written& one) {
      return robot_time_us > one.due_robot_us && robot_time_us - one.due_robot_us > std::uint64_t{2} * tick_us;
    });
  }

 private:
  struct Written {
    station::CommandId id;
    std::int64_t deadline_us;
    std::size_t places;
    std::uint64_t due_robot_us = std::numeric_limits<std::uint64_t>::max();  // once it waits there
  };
  static std::size_t places(const protocol::Command& command) { return command.has_execute_at_robot_us ? 2 : 1; }

  std::vector<Written> written_;
};

}  // namespace server::link
