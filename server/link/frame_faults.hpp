// What of a robot's frame cannot be, though it decodes, and would harm those who compute with it.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace server {

constexpr std::uint64_t kMaxNumber = std::uint64_t{1} << 62;  // of a sample or µs: beyond any boot, and safe to add to

// A word for the log; null when all can be.
const char* fault_of(const protocol::RobotFrame& frame);

}  // namespace server
