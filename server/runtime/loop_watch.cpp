// Looks for gaps between the turns of the loop.
#include "server/runtime/loop_watch.hpp"

#include <spdlog/spdlog.h>

namespace server::runtime {

void LoopWatch::turn(std::int64_t now_us) {
  if (last_us_ && now_us - *last_us_ > kStandstill.count()) {
    spdlog::warn("the station stood still for {} ms: a command that waited, and moves a robot, is as old as that",
                 (now_us - *last_us_) / 1000);
    if (!unread_since_us_) unread_since_us_ = last_us_;
    stood_until_us_ = now_us;
    stood_for_ = std::chrono::microseconds{now_us - *last_us_};
  }
  last_us_ = now_us;
}

std::chrono::microseconds LoopWatch::stood_still_within(std::chrono::microseconds before, std::int64_t now_us) const {
  return now_us - stood_until_us_ < before.count() ? stood_for_ : std::chrono::microseconds{0};
}

std::chrono::microseconds LoopWatch::unread_for(std::int64_t now_us) {
  turn(now_us);
  return std::chrono::microseconds{unread_since_us_ ? now_us - *unread_since_us_ : 0};
}

}  // namespace server::runtime
