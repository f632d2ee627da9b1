// Finds the step of a lateness, and the lateness of a quantile.
#include "sim_robot/client/lateness.hpp"

#include <algorithm>
#include <bit>

namespace sim_robot {

std::size_t Lateness::step_of(std::uint32_t late_us) {
  if (late_us < kStepsPerOctave) return late_us;
  const std::size_t octave = std::bit_width(late_us / kStepsPerOctave) - 1U;
  return kStepsPerOctave * octave + (late_us >> octave);
}

std::uint64_t Lateness::end_us(std::size_t step) {
  if (step < kStepsPerOctave) return step;
  const std::size_t octave = step / kStepsPerOctave - 1;
  return ((step % kStepsPerOctave + kStepsPerOctave + 1) << octave) - 1;
}

void Lateness::add(std::int64_t late_us) {
  constexpr std::int64_t kMost = (std::int64_t{1} << 31) - 1;
  const auto within = static_cast<std::uint32_t>(std::clamp(late_us, std::int64_t{0}, kMost));
  ++counts_[step_of(within)];
  ++count_;
  max_us_ = std::max(max_us_, within);
}

double Lateness::quantile_ms(double share) const {
  if (count_ == 0) return 0;
  const double wanted = share * static_cast<double>(count_);
  std::uint64_t below = 0;
  std::size_t step = 0;
  while (step + 1 < kSteps && static_cast<double>(below += counts_[step]) < wanted) ++step;
  return static_cast<double>(std::min<std::uint64_t>(end_us(step), max_us_)) / 1000;
}

}  // namespace sim_robot
