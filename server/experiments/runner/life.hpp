// The last sign of life of the client in whose hands an experiment is: a page, or a script, that began it, resumed it
// or took it over.
//
// SAFETY: of that client alone, and for that experiment alone. It is worth no more than the state of the robots that
// its sender saw with it. Plain value; the owner is the loop's.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "server/station/commands/requests.hpp"

namespace server::experiments {

struct Life {
  std::optional<std::int64_t> seen_us;  // steady: when its client saw what it saw last; none: it gave no sign yet
  std::int64_t since_us = 0;            // steady: since when it is in the hands of its client, and not held

  std::int64_t silent_for_us(std::int64_t now_us) const {
    return seen_us ? now_us - *seen_us : std::numeric_limits<std::int64_t>::max();
  }
  bool is_fresh(std::int64_t now_us) const { return silent_for_us(now_us) <= station::kOldestSight.count(); }
  // Longer than this nobody of whom it is was there.
  std::int64_t absent_for_us(std::int64_t now_us) const {
    return now_us - (seen_us && *seen_us > since_us ? *seen_us : since_us);
  }
};

}  // namespace server::experiments
