// The table of reset reasons.
#include "robot_fw/esp8266/reset_cause.hpp"

#include <user_interface.h>

namespace robot_fw::esp8266 {

protocol::ResetCause reset_cause(std::uint32_t reason, bool memory_kept) {
  switch (reason) {
    // SAFETY: a robot whose supply gave in under the motor does not move again by itself.
    case REASON_DEFAULT_RST: return memory_kept ? rheonaut_RESET_CAUSE_BROWN_OUT : rheonaut_RESET_CAUSE_POWER_ON;
    // SAFETY: a program that hung or crashed comes up latched.
    case REASON_WDT_RST:
    case REASON_EXCEPTION_RST:
    case REASON_SOFT_WDT_RST: return rheonaut_RESET_CAUSE_WATCHDOG;
    case REASON_SOFT_RESTART: return rheonaut_RESET_CAUSE_SOFTWARE;
    case REASON_EXT_SYS_RST: return rheonaut_RESET_CAUSE_EXTERNAL;
    default: return rheonaut_RESET_CAUSE_UNKNOWN;
  }
}

}  // namespace robot_fw::esp8266
