// How late ticks ran: a histogram that never allocates, within 6 % of the value and up to 2^31 µs.
#pragma once

#include <array>
#include <cstdint>

namespace sim_robot {

class Lateness {
 public:
  void add(std::int64_t late_us);  // below 0: in time

  // The upper end of the step of the histogram in which the quantile lies, 0 without any tick; `share` in [0, 1].
  double quantile_ms(double share) const;
  double max_ms() const { return static_cast<double>(max_us_) / 1000; }
  std::uint64_t count() const { return count_; }

 private:
  // Sixteen steps for each power of two from 16 µs on, single microseconds below.
  static constexpr std::uint32_t kStepsPerOctave = 16;
  static constexpr std::size_t kSteps = kStepsPerOctave * 28;
  static std::size_t step_of(std::uint32_t late_us);
  static std::uint64_t end_us(std::size_t step);

  std::array<std::uint64_t, kSteps> counts_{};
  std::uint64_t count_ = 0;
  std::uint32_t max_us_ = 0;
};

}  // namespace sim_robot
