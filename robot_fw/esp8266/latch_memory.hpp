// Stores the emergency latch over a reset, in the memory of the chip's real-time clock.
//
//   record := magic emergency_id cause crc     20 bytes, from the 64th of its 128 words on
// A loss of power erases it, so the CRC decides whether there is a record. A record is always kept, latched or not: a
// valid one after a "power-on" shows that the supply only dipped.
#pragma once

#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw::esp8266 {

class LatchMemory {
 public:
  // Reads what the last boot left.
  void begin();
  bool kept() const { return kept_; }                           // a sound record was there
  std::uint64_t emergency_id() const { return emergency_id_; }  // 0: not latched
  protocol::EmergencyCause cause() const { return cause_; }

  // Writes when it differs from what is there; takes microseconds.
  void keep(std::uint64_t emergency_id, protocol::EmergencyCause cause);

 private:
  void write() const;

  bool kept_ = false;
  std::uint64_t emergency_id_ = 0;
  protocol::EmergencyCause cause_ = rheonaut_EMERGENCY_CAUSE_NONE;
};

}  // namespace robot_fw::esp8266
