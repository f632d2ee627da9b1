// Knows when the loop has stood still: then what it reads first has waited meanwhile.
//
//   turn, turn, … , rest, (waits) turn, … , rest, (halted) turn: what is read now may be as old as the turn before it
//
// A program that is halted, a machine that is suspended or has no time for it: the loop cannot know which, but it sees
// the gap between two of its turns. All that lay in its sockets meanwhile is read before it rests again. Times are
// steady, which goes on in a suspend (server/runtime/clock.hpp). Kept by who runs the loop. Loop thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace server {

class LoopWatch {
 public:
  static constexpr std::chrono::microseconds kStandstill{200'000};  // a loop that is merely busy is faster

  // The loop runs. Called in each turn, at most some 50 ms apart.
  void turn(std::int64_t now_us);
  // It has worked off all that there was: what it reads from now on has not waited.
  void rest() { unread_since_us_.reset(); }

  // For how long what is read now may have lain unread because the loop stood still; 0: it has just come.
  std::chrono::microseconds unread_for(std::int64_t now_us);

 private:
  std::optional<std::int64_t> last_us_;          // turn
  std::optional<std::int64_t> unread_since_us_;  // after a standstill, until it rests
};

}  // namespace server
