// The station's log: lines to standard error, through spdlog.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace server::runtime {

// `level` is trace, debug, info, warn or error.
void start_log(const std::string& level);

// Lets one line a second into the log, of what an unauthenticated peer can cause as often as they like.
class SparseLines {
 public:
  // When the line may be written: how many were left out since the one before.
  std::optional<std::uint64_t> next(std::int64_t now_us) {
    if (now_us < next_us_) {
      ++unsaid_;
      return std::nullopt;
    }
    next_us_ = now_us + 1'000'000;
    return std::exchange(unsaid_, 0);
  }
  bool is_due(std::int64_t now_us) const { return now_us >= next_us_; }

 private:
  std::int64_t next_us_ = 0;
  std::uint64_t unsaid_ = 0;
};

std::string and_before(std::uint64_t unsaid);  // " (and 19 before)", or nothing

}  // namespace server::runtime
