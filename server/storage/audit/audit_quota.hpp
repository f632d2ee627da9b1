// Limits the audit entries that unauthenticated clients and broken scripts can cause: for each such action a burst,
// then one each 10 s. The rest is counted, and the count is an entry, at most one each 10 s.
//
// Plain bookkeeping; times are the caller's, steady. The actions are of a fixed set, so it is small.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "server/runtime/clock.hpp"

namespace server::storage {

class AuditQuota {
 public:
  static constexpr std::int64_t kBurst = 100;
  static constexpr microseconds kOneEach{10'000'000};

  // False: it is not to be written, and was counted.
  bool take(const std::string& action, std::int64_t now_us) {
    Allowance& allowance = allowances_.try_emplace(action, Allowance{.left = kBurst, .since_us = now_us}).first->second;
    const std::int64_t more = (now_us - allowance.since_us) / kOneEach.count();
    allowance.since_us += more * kOneEach.count();
    allowance.left = std::min(allowance.left + more, kBurst);
    const bool is_allowed = allowance.left > 0;
    is_allowed ? static_cast<void>(--allowance.left) : leave_out(action);
    return is_allowed;
  }

  // It was not written for another reason: the queue was full.
  void leave_out(const std::string& action) { ++left_out_[action].count; }

  bool has_left_out() const {
    return std::ranges::any_of(left_out_, [](const auto& entry) { return entry.second.count > 0; });
  }

  // What was left out since it was reported last; of each action each 10 s, or now.
  std::vector<std::pair<std::string, std::uint64_t>> report(std::int64_t now_us, bool at_once) {
    std::vector<std::pair<std::string, std::uint64_t>> reported;
    for (auto& [action, left] : left_out_) {
      const bool is_due = at_once || left.reported_us == 0 || now_us - left.reported_us >= kOneEach.count();
      if (left.count == 0 || !is_due) continue;
      left.reported_us = now_us;
      reported.emplace_back(action, std::exchange(left.count, 0));
    }
    return reported;
  }

 private:
  struct Allowance {
    std::int64_t left = 0;
    std::int64_t since_us = 0;
  };
  struct LeftOut {
    std::uint64_t count = 0;
    std::int64_t reported_us = 0;  // 0: never
  };
  std::map<std::string, Allowance> allowances_;
  std::map<std::string, LeftOut> left_out_;
};

}  // namespace server::storage
