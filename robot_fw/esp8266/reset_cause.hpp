// The cause of the chip's reset, as an enumerator of the protocol.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw::esp8266 {

// `reason` is the SDK's. The chip has no word for a brown-out: it is a power-on over which `memory_kept` its contents.
// A crash (exception) counts as a watchdog reset, since both come up latched.
protocol::ResetCause reset_cause(std::uint32_t reason, bool memory_kept);

}  // namespace robot_fw::esp8266
