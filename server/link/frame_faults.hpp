// What of a robot's frame cannot be, though it decodes, and would harm those who compute with it.
//
// None of it ends the link: a robot sends again what is not acknowledged, so the same frame would end the next one,
// too.
#pragma once

#include <cstdint>
#include <string>

#include "protocol/messages.hpp"

namespace server {

constexpr std::uint64_t kMaxNumber = std::uint64_t{1} << 62;  // of a sample or µs: beyond any boot, and safe to add to

struct FrameFaults {
  std::uint64_t count = 0;   // values that cannot be; 0: all can
  const char* cause = "";    // of the first: not_finite, out_of_range
  std::string first;         // in words
  bool is_unusable = false;  // the frame's samples, or its event, cannot be recorded
  bool has_number = true;    // ... but it is known which they are
};

// Finds them. A number or time that cannot be and is not needed becomes 0, which says nothing.
FrameFaults mend(protocol::RobotFrame& frame);

}  // namespace server
