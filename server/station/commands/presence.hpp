// When each actor gave its last fresh sign of life: whether a person, or a script, is there now.
//
// SAFETY: a sign of life is worth no more than the state of the robots that its sender saw with it; one of an older
// state than kOldestSight does not count. Loop thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "server/runtime/clock.hpp"

namespace server::station {

class Presence {
 public:
  explicit Presence(runtime::Clock& clock) : clock_{clock} {}

  // `age`: of what the actor has seen of the robots.
  void note(const std::string& actor, microseconds age);

  // Steady time of what the actor saw last; none: not within kForgottenAfter.
  std::optional<std::int64_t> seen_us(const std::string& actor) const;

  static constexpr microseconds kForgottenAfter{3'600'000'000};

 private:
  void forget_old();

  runtime::Clock& clock_;
  std::map<std::string, std::int64_t> seen_us_;
  std::int64_t forgotten_at_us_ = 0;
};

}  // namespace server::station
