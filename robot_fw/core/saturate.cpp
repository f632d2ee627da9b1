// Judges the range before it converts: outside it a conversion is undefined, and chips differ.
#include "robot_fw/core/saturate.hpp"

#include <limits>

namespace robot_fw {

template <class Integer>
Integer saturated(float value) {
  using Limits = std::numeric_limits<Integer>;
  constexpr float kHalf = static_cast<float>(Integer{1} << (Limits::digits - 1));
  if (value >= 2 * kHalf) return Limits::max();  // exact, a power of two
  if (value <= (Limits::is_signed ? -2 * kHalf : 0.0F)) return Limits::min();
  if (value != value) return 0;
  return static_cast<Integer>(value);
}

template std::int32_t saturated(float value);
template std::uint32_t saturated(float value);
template std::uint64_t saturated(float value);

}  // namespace robot_fw
