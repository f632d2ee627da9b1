// Detects that the loop was halted: the bytes that it reads first have then waited meanwhile.
//
//   turn, turn, … , rest, (waits) turn, … , rest, (halted) turn: what is read now may be as old as the turn before it
//
// The process may be halted, or the machine suspended or overloaded: the loop cannot know which, but it measures the
// gap between two of its turns. All bytes that arrived meanwhile are read before it rests again. Times are steady and
// go on in a suspend (server/runtime/clock.hpp). Owned by the code that runs the loop. Loop thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace server::runtime {

class LoopWatch {
 public:
  static constexpr std::chrono::microseconds kStandstill{200'000};  // a loop that is merely busy is faster

  // The loop runs. Called in each turn, at most some 50 ms apart.
  void turn(std::int64_t now_us);
  // It has worked off all that there was: what it reads from now on has not waited.
  void rest() { unread_since_us_.reset(); }

  // How long the latest standstill lasted that ended less than so long ago; 0: there was none.
  std::chrono::microseconds stood_still_within(std::chrono::microseconds before, std::int64_t now_us) const;

  // For how long what is read now may have lain unread because the loop stood still; 0: it has just come.
  std::chrono::microseconds unread_for(std::int64_t now_us);

 private:
  std::optional<std::int64_t> last_us_;          // turn
  std::optional<std::int64_t> unread_since_us_;  // after a standstill, until it rests
  std::int64_t stood_until_us_ = 0;              // the latest standstill
  std::chrono::microseconds stood_for_{0};
};

}  // namespace server::runtime
