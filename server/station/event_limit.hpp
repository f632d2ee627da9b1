// Bounds how often the same event is published: at most once in a period; the others are counted.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

namespace server::station {

class EventLimit {
 public:
  explicit EventLimit(std::int64_t period_us) : period_us_{period_us} {}

  // `count` of them have happened at this steady time. How many were withheld since the last that was published, if one
  // may be published now; none: they are withheld.
  std::optional<std::uint64_t> admit(std::int64_t now_us, std::uint64_t count = 1) {
    if (published_at_us_ != 0 && now_us - published_at_us_ < period_us_) {
      withheld_ += count;
      return std::nullopt;
    }
    published_at_us_ = now_us;
    return std::exchange(withheld_, 0);
  }

 private:
  std::int64_t period_us_;
  std::int64_t published_at_us_ = 0;  // steady; 0: never
  std::uint64_t withheld_ = 0;        // since
};

}  // namespace server::station
