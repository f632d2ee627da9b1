// Measures the deepest use of the stack: paints it, and later finds the first overwritten byte.
#pragma once

#include <cstdint>

namespace robot_fw::lx106 {

// Paints the free stack below the caller.
void paint_stack();
// Bytes below the caller that were used since; the caller must be the one that painted.
std::uint32_t used_stack_bytes();

}  // namespace robot_fw::lx106
