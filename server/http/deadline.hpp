// Until when what a connection waits for must have happened.
#pragma once

#include <cstdint>
#include <limits>

#include "server/runtime/clock.hpp"

namespace server::http {

class Deadline {
 public:
  explicit Deadline(runtime::Clock& clock) : clock_{clock} {}
  void allow(microseconds duration) { at_us_ = clock_.steady_us() + duration.count(); }  // from now
  void lift() { at_us_ = kNever; }
  bool has_passed() const { return clock_.steady_us() >= at_us_; }

 private:
  static constexpr auto kNever = std::numeric_limits<std::int64_t>::max();
  runtime::Clock& clock_;
  std::int64_t at_us_ = kNever;
};

}  // namespace server::http
