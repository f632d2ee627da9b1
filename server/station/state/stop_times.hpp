// Durations of emergency stops since the start of the program: from the request's arrival at the station until its
// frame was sent, until the robot answered that it had obeyed, and until telemetry showed duty 0. Only stops of
// connected robots count: a stop for an absent robot waits for its return.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace server::station {

// Counts of times by upper bound, as Prometheus keeps them.
class Histogram {
 public:
  static constexpr std::array<std::int64_t, 14> kBoundsUs{50,     100,    200,    500,     1'000,   2'000,   5'000,
                                                          10'000, 20'000, 50'000, 100'000, 200'000, 500'000, 1'000'000};

  void add(std::int64_t time_us) {
    const auto bound = std::ranges::lower_bound(kBoundsUs, time_us);
    ++counts_[static_cast<std::size_t>(bound - kBoundsUs.begin())];
    sum_us_ += time_us;
  }

  // Of times up to kBoundsUs[i] and above the bound before it; the last one of those above all.
  const std::array<std::uint64_t, kBoundsUs.size() + 1>& counts() const { return counts_; }
  std::int64_t sum_us() const { return sum_us_; }

 private:
  std::array<std::uint64_t, kBoundsUs.size() + 1> counts_{};
  std::int64_t sum_us_ = 0;
};

struct StopTimes {
  Histogram sent, acknowledged, verified;
};

}  // namespace server::station
