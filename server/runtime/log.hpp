// The station's log: lines to standard error, through spdlog; as text for people, or as a JSON object a line.
//
// One entry is one line in either format: control characters are written out (\n, \x1b), so that what a robot or
// another peer sends can neither forge an entry nor command a terminal.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace spdlog {
class formatter;
}

namespace server::runtime {

// `level` is trace, debug, info, warn or error; `format` is text or json.
void start_log(const std::string& level, const std::string& format = "text");

// How an entry becomes a line.
std::unique_ptr<spdlog::formatter> log_formatter(const std::string& format);

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
