// The commands that were written to a robot and are not answered: never more than it can acknowledge.
//
// A robot keeps 8 acknowledgements that it could not send yet. Two places are for an emergency stop and its repetition,
// which ask nobody and are not counted here. Pure.
#pragma once

#include <cstdint>
#include <vector>

#include "server/station/station_state.hpp"

namespace server {

class CommandWindow {
 public:
  static constexpr std::size_t kMost = 6;
  // An answer that has not come so long after the end of the command's validity never comes, and holds its place no
  // longer.
  static constexpr std::int64_t kAnswerGraceUs = 1'000'000;

  bool has_room(std::int64_t now_us) {
    std::erase_if(written_, [now_us](const Written& one) { return now_us >= one.deadline_us + kAnswerGraceUs; });
    return written_.size() < kMost;
  }
  void written(CommandId id, std::int64_t deadline_us) { written_.push_back({id, deadline_us}); }
  void answered(CommandId id) {
    std::erase_if(written_, [id](const Written& one) { return one.id == id; });
  }

 private:
  struct Written {
    CommandId id;
    std::int64_t deadline_us;
  };
  std::vector<Written> written_;
};

}  // namespace server
