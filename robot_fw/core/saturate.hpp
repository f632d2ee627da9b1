// Converts float to integer with saturation; the core converts nowhere else.
#pragma once

#include <cstdint>

namespace robot_fw {

// Towards zero. NaN gives 0; what does not fit gives the nearest value that does. For std::int32_t, std::uint32_t and
// std::uint64_t.
template <class Integer>
Integer saturated(float value);

}  // namespace robot_fw
