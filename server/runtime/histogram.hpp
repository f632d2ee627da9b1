// Counts of values by upper bound, as Prometheus keeps them; the bounds are fixed for each kind of figure.
//
//   TimeHistogram commits;
//   commits.add(1'300);   // counted under the bound 2'000
//
// Of times in µs and of depths of queues. Plain counting, without errors; a value below 0 counts as 0. Loop thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace server::runtime {

// µs; from a stop on loopback (0.1 ms) to a disk or network that stalls (1 s and more).
inline constexpr std::array<std::int64_t, 14> kTimeBoundsUs{
    50, 100, 200, 500, 1'000, 2'000, 5'000, 10'000, 20'000, 50'000, 100'000, 200'000, 500'000, 1'000'000};
// Waiting entries of a queue; the recorder's is full at 2,000,000 samples.
inline constexpr std::array<std::int64_t, 6> kDepthBounds{10, 100, 1'000, 10'000, 100'000, 1'000'000};

template <const auto& bounds>
class Histogram {
 public:
  static constexpr auto& kBounds = bounds;

  void add(std::int64_t value) {
    const std::int64_t counted = std::max<std::int64_t>(value, 0);
    const auto bound = std::ranges::lower_bound(bounds, counted);
    ++counts_[static_cast<std::size_t>(bound - bounds.begin())];
    sum_ += counted;
  }

  // Of values up to kBounds[i] and above the bound before it; the last one of those above all.
  const std::array<std::uint64_t, bounds.size() + 1>& counts() const { return counts_; }
  std::int64_t sum() const { return sum_; }

 private:
  std::array<std::uint64_t, bounds.size() + 1> counts_{};
  std::int64_t sum_ = 0;
};

using TimeHistogram = Histogram<kTimeBoundsUs>;
using DepthHistogram = Histogram<kDepthBounds>;

}  // namespace server::runtime
